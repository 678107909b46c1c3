"""The bench, a photometric simulator of the paper's laboratory: `cad`, `skins`, `renderer` and
`event_sensor` make images; `laboratory` and `sequences` say what happens in them.
"""
