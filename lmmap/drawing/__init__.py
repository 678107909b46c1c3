"""Poses drawn on the images that they were estimated from: as pictures, as a video, and for Rerun."""
