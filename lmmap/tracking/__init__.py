"""From single poses to a track: the paper's `outliers` filter; `motion_model` and `fusion`, a Kalman filter
over both cameras; `tracker`, which looks where that filter predicts the port; `between`, by events alone."""
