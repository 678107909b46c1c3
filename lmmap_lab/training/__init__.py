"""Training of the filters: their data, how it is varied, and how a network learns from it.

Read `dataset` (samples on disk), `augment` (variations of an image), `recipe` (what is trained, and for how
long), `train` and `checkpoint` (how), and `mask_quality` (how well the masks fit the true ones).  `spiking`
is the network of spiking neurons, and `slices` has its samples.
"""
