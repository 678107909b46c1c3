"""What a person measured in the published pictures, and how it is compared with."""

import judge_pictures
import numpy as np
import pandas as pd
import pytest

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import project
from lmmap.pipeline import ellipse
from lmmap.types import Camera, Estimate, Port, Pose, Status
from lmmap_lab.provenance import DATA
from lmmap_lab.studies.any_lens import Look, markers_px

PICTURES = pd.read_csv(DATA / "paper" / "pictures.csv").set_index("picture")
POINTS = pd.read_csv(DATA / "paper" / "picture-points.csv")
EDGES = POINTS[POINTS.kind == "edge"]


@pytest.mark.parametrize("name", EDGES.picture.unique())
def test_the_points_of_an_edge_lie_on_an_ellipse(name):
    points_px = EDGES[EDGES.picture == name][["u_px", "v_px"]].to_numpy()
    on_ellipse_px = ellipse.fit(points_px).points(2000)
    off_px = np.linalg.norm(points_px[:, None] - on_ellipse_px, axis=-1).min(1)
    off_px *= Camera.davis346().width_px / PICTURES.width_px[name]
    assert np.sqrt(np.mean(off_px**2)) < 1.0 and off_px.max() < 2.0


def test_the_true_ring_and_markers_are_right_and_others_are_not():
    camera, port = Camera.davis346(), Port.lm_map()
    truth = Pose(np.diag([1.0, -1.0, -1.0]), [0.02, 0.0, 0.5])
    edge = project(truth @ circle_points_m(port.ring_outer_radius_m, 40), camera)
    outer, corners = ellipse.fit(edge), markers_px(truth, port, camera)
    picture = np.zeros((*camera.size_px[::-1], 3), np.uint8)

    def judged(pose):
        ring = circle_ellipse(pose, port.ring_radius_m, camera)
        look = Look(camera, picture, picture[..., 0], Estimate(0, Status.OK, pose, ellipse=ring), ring, 1.0)
        return judge_pictures.judged(
            look, picture, lambda _: np.ones(picture.shape[:2]), outer, corners.mean(1)
        )

    right = judged(truth)
    assert right["ring_right"] and right["pose_plausible"] and right["markers_found"] == 3
    assert right["centre_px"] < 0.1 and abs(right["major_ratio"] - 1) < 0.01
    assert not judged(Pose(truth.rotation, [0.03, 0.0, 0.5]))["ring_right"]
    assert not judged(Pose(truth.rotation, [0.02, 0.0, 0.6]))["ring_right"]
    turned = judged(Pose(truth.rotation @ np.diag([-1.0, -1.0, 1.0]), truth.position_m))
    assert turned["ring_right"] and not turned["pose_plausible"]


def test_drawn_lines_are_taken_out_and_nothing_else_changes():
    picture = np.full((60, 60, 3), 90, np.uint8)
    picture[30] = (0, 255, 0)
    cleaned = judge_pictures.without_lines(picture)
    assert np.abs(cleaned.astype(int) - 90).max() < 5 and np.array_equal(cleaned[:28], picture[:28])


def test_each_reported_pose_of_the_published_pictures_lies_on_the_port():
    """What README, quickstart and model cards say."""
    found = pd.read_csv(DATA / "results" / "pictures.csv").query("lines != 'taken out' and local_search")
    reported = found[found.status == Status.OK]
    assert len(reported) and reported.ring_right.all()
    assert reported.pose_plausible[reported.markers_seen > 0].all()
