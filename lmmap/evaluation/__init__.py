"""Estimates against a truth: `pose_errors` has the errors of poses, `error_table` those of a recording's
estimates, one row each, and `cells` what the paper's table says of them."""
