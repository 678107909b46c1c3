"""How the filters are trained: `dataset`, `augment`, `recipe`, `train`; `mask_quality` judges what
they learned."""
