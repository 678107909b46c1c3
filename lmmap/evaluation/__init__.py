"""Estimates compared with ground truth: `pose_errors` computes the errors of poses, `error_table` those of a
recording's estimates, one row each, and `cells` their statistics in the paper's table."""
