"""The bench: a photometric simulator of the paper's laboratory, which records sequences in its place.

Read `cad` (the port as surfaces), `skins` (the panel's covers), `shading`, `renderer` and `optics` (from
lamps to a frame) and `event_sensor`; then `laboratory` (what happens in a sequence), `sequences` (a sequence
as a recording), `simulate` (recordings as files), `labels` (true masks) and `photometry` (how bright the
lamps are).
"""
