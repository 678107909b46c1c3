"""From single poses to a track: the paper's `outliers` filter; `motion_model`, `gate`, `fusion` and
`within_limits`, a Kalman filter over both cameras and its confidence; `tracker`, which searches where that
filter predicts the port; `between`, for poses from events alone."""
