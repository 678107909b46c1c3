"""From single poses to a track: the paper's `outliers` filter; `motion_model` and `fusion`, a
Kalman filter over both cameras."""
