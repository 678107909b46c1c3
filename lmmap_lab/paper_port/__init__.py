"""A port of paper: two sheets to print, and the plate that one of them folds into."""
