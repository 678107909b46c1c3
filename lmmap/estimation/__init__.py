"""From a recording or a camera to poses: images in time order, their estimates, and tracks."""
