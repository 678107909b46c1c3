"""Networks that learn a new place by themselves, from the poses that an estimator is sure of.

Read `smooth_track` (where the port was, by the images before and after), `self_labels` (which images teach
what), `learning` (how), `guard` (whether what was learned is taken, and how sure it may be), and `adapt`.
"""
