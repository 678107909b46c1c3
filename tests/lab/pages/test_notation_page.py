"""The figure of both frames: axes end where their points project to, and the camera's y points down."""

import numpy as np

from lmmap.geometry.projection import project
from lmmap.types import Camera, Port, Pose
from lmmap_lab.pages import notation_page


def test_axes_of_the_port_end_at_their_projections():
    camera, T_cam_port = Camera.davis346(), Pose(np.diag([1.0, -1.0, -1.0]), [0.05, -0.02, 0.4])
    space, image = notation_page.draw_frames(T_cam_port, Port.lm_map(), camera).axes
    ends = [line.get_xydata()[1] for line in image.lines[-3:]]
    np.testing.assert_allclose(ends, project(T_cam_port @ (0.1 * np.eye(3)), camera))
    assert [text.get_text().strip() for text in image.texts] == ["x", "y", "z"]
    y_of_camera = np.array(space.lines[-5].get_data_3d())
    np.testing.assert_allclose(y_of_camera[:, 1], [0, 0, -0.1])
