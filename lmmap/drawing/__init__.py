"""Poses drawn on the images that they were estimated from, as pictures or as a video."""
