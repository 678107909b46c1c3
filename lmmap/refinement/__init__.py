"""What sharpens a pose on the image itself: `contour` traces the ring below a pixel, `joint` refines ring and
markers together, `uncertainty` says how far the answer can be trusted.
"""
