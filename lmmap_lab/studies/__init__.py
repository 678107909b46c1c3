"""The experiments of the paper, each from recordings to tables.

`metrics` has the errors of a pose, `pose_errors` those of a recording and `error_statistics` those of many
images, with intervals by `bootstrap`.  `accuracy_run` runs the accuracy study: `sequence_files` keeps its
recordings and estimates, `accuracy_tables` tabulates it, `ladder` goes from the paper's procedure to ours on
the same images, `assumptions` varies what the paper leaves open, `archive` packs results, and `claims` judges
what the paper says.  `sensitivity` and `odometry` are the two other studies; `odometry_files` exchanges files
with other odometries.  `on_authors_bags` runs the studies on recorded bags.
"""
