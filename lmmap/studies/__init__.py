"""The experiments of the paper, each from recordings to tables."""
