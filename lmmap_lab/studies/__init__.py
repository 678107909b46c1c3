"""The experiments of the paper, each from recordings to tables.

Errors against a truth are those of `lmmap.evaluation`.  `table1` has the cells of the paper's table, with
intervals by `bootstrap`, and `error_statistics` what else is said of many images' errors.  `accuracy_run`
runs the accuracy study: `sequence_files` keeps its recordings and estimates, `accuracy_tables` tabulates it,
`ladder` goes from the paper's procedure to ours on the same images, `assumptions` varies what the paper
leaves open, `archive` packs results, and `claims` judges what the paper says.  `sensitivity` and `odometry`
are the two other studies; the latter scores tracks by `trajectory_errors`, and `odometry_files` exchanges
files with other odometries.  `on_authors_bags` runs the studies on recorded bags.
"""
