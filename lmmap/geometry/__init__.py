"""Geometry: how cameras, circles and ellipses meet.  Read `projection`, then `conics`."""
