"""The rig of the authors' laboratory: a camera beside a UR5e that carries the port, and its calibration.

Read `ur5e` and `tf` (the arm's motion), `truth` (that of the port), `hand_eye_file`, `hand_eye_starts`,
`hand_eye` and `calibration` (a rig from detections), `checkerboard` (a camera's intrinsics); then
`authors_bags` (what the authors' data set holds) and `standin` (bags of the bench in its place).
"""
