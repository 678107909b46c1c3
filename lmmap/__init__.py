"""lmmap: pose of the LM-MAP docking port from an RGB or event camera, reproducibly."""
