"""The laboratory's rig: how camera, arm and port hang together, calibrated and read from the
authors' bags."""
