"""Refinement of a pose: `contour` traces the ring to a fraction of a pixel, `joint` refines ring and markers
together, `image_edges` uses the image's own edges, `uncertainty` and `verify` say how far to trust the pose.
"""
