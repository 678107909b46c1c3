"""Geometry of cameras, circles and ellipses.  Read `projection`, then `conics`."""
