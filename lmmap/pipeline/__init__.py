"""The paper's pipeline, in its order: `histograms`, `network`, `ellipse`, `circle`, `yaw`.
`estimator` runs the steps on one image, `lmmap.estimation` on a recording.
"""
