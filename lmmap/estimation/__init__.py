"""From a recording, or a camera, to poses: its images in order, estimates of them, and tracks."""
