"""The sheets have the port's dimensions, by their own vectors and for another program, and fold into it."""

import json
import shutil
import subprocess
from dataclasses import replace

import cv2
import numpy as np
import pytest
from pypdf import PdfReader
from pypdf.generic import ContentStream

from lmmap.types import InputError, Port
from lmmap_lab.cli.arguments import PAPERS
from lmmap_lab.paper_port import net, sheets
from lmmap_readers.rig import scale_port

LM_MAP = Port.lm_map()
HALF = scale_port(LM_MAP, LM_MAP.ring_radius_m / 2)
NO_WINDOWS = replace(LM_MAP, window_radius_m=0.0, window_size_m=(0.0, 0.0))
PORTS = {
    "LM-MAP": LM_MAP,
    "half": HALF,
    "two markers": replace(NO_WINDOWS, symmetry=2, marker_size_m=(0.04, 0.016)),
    "one marker": replace(NO_WINDOWS, symmetry=1, marker_size_m=(0.04, 0.016)),
    "six markers": replace(NO_WINDOWS, symmetry=6, marker_size_m=(0.015, 0.01)),
    "flat": replace(LM_MAP, plate_height_m=0.0),
}
TOLERANCE_MM = 0.1
MM_PER_POINT = 25.4 / 72


@pytest.fixture(params=PORTS)
def any_port(request):
    return PORTS[request.param]


def test_the_sheet_folds_into_the_plate(any_port):
    """Feet on the ring's plane, walls that close, tabs behind them, markers where the port has them."""
    faces = net.plate_net(any_port)
    moves = net.fold(faces)
    folded = [net.moved(face.corners_m, move) for face, move in zip(faces, moves, strict=True)]
    feet = [corners for face, corners in zip(faces, folded, strict=True) if face.kind == net.FOOT]
    ground = feet[0][0, 2] if feet else -any_port.plate_height_m
    assert np.allclose([corners[:, 2] for corners in feet], ground, atol=1e-12)
    assert len(feet) == (net.plate_sides(any_port) if any_port.plate_height_m else 0)
    corners = net.moved(any_port.marker_corners_m()[..., :2], moves[0]) - [0, 0, ground]
    assert np.abs(corners - any_port.marker_corners_m()).max() < 1e-3 * TOLERANCE_MM
    walls = [corners for face, corners in zip(faces, folded, strict=True) if face.kind == net.WALL]
    tabs = [corners for face, corners in zip(faces, folded, strict=True) if face.kind == net.TAB]
    for wall, following, tab in zip(walls, walls[1:] + walls[:1], tabs, strict=True):
        assert np.allclose(wall[[1, 2]], following[[0, 3]], atol=1e-12)
        along, down = following[1] - following[0], following[3] - following[0]
        inside = np.linalg.lstsq(np.stack([along, down], 1), (tab - following[0]).T, rcond=None)
        assert np.all((inside[0] > -1e-9) & (inside[0] < 1 + 1e-9)) and np.all(inside[1] < 1e-18)


def test_no_two_faces_share_paper(any_port):
    """Drawn one by one on a grid of 0.2 mm, faces cover what all together do, but for their edges."""
    faces = [np.round(5e3 * face.corners_m + 750).astype(np.int32) for face in net.plate_net(any_port)]
    cover = np.zeros((1500, 1500), np.uint8)
    for face in faces:
        alone = cv2.fillPoly(np.zeros_like(cover), [face], 1)
        cover += cv2.erode(alone, np.ones((3, 3), np.uint8))
    assert cover.max() == 1


def test_markers_lie_on_the_plate(any_port):
    plate = net.plate_net(any_port)[0].corners_m
    side = np.roll(plate, -1, 0) - plate
    outward = np.stack([side[:, 1], -side[:, 0]], -1) / np.linalg.norm(side, axis=1, keepdims=True)
    reach = (any_port.marker_corners_m()[..., None, :2] - plate) * outward
    assert reach.sum(-1).max() < -0.999 * net.BORDER_M + 1e-9 or any_port.symmetry == 6


def test_by_its_own_vectors(tmp_path, any_port):
    sheets.write_sheets(tmp_path / "p.pdf", any_port, "a4", "x", 1.0)
    ring, plate = (filled(page) for page in PdfReader(tmp_path / "p.pdf").pages)
    square, *circles = (points for _, points in ring)
    centre = (square.min(0) + square.max(0)) / 2
    white, black = (circle - centre for circle in circles[:2])
    for circle, radius_m in ((white, any_port.ring_outer_radius_m), (black, any_port.ring_inner_radius_m)):
        assert np.abs(np.linalg.norm(circle, axis=1) - 1e3 * radius_m).max() < TOLERANCE_MM
    markers = [p - centre for colour, p in plate if colour == "white"]
    assert len(markers) == any_port.symmetry
    for found, corners in zip(markers, 1e3 * any_port.marker_corners_m()[..., :2], strict=True):
        assert np.abs(found[:4] - corners).max() < 1e-2 * TOLERANCE_MM
    assert len([1 for colour, _ in plate if colour == "black"]) == sum(
        face.kind != net.TAB for face in net.plate_net(any_port))  # fmt: skip


def filled(page):
    """Colour and points (K, 2) mm of each filled path; of curves the points on them."""
    grey, points, found = None, [], []
    for operands, operator in ContentStream(page.get_contents(), page.pdf).operations:
        name = operator.decode()
        if name in ("g", "rg"):
            values = set(map(float, operands))
            grey = {0.0: "black", 1.0: "white"}.get(values.pop()) if len(values) == 1 else None
        elif name in ("m", "l", "c"):
            points = [] if name == "m" else points
            new = np.array(operands, float).reshape(-1, 2) * MM_PER_POINT
            if name == "c":  # Bezier's curve at a half
                points.append(np.array([1, 3, 3, 1]) / 8 @ np.vstack([points[-1], new]))
            points.append(new[-1])
        elif name in ("f", "b", "B", "f*", "b*", "B*"):
            found.append((grey, np.array(points)))
    return found


@pytest.mark.skipif(shutil.which("pdftoppm") is None, reason="needs poppler-utils")
def test_in_the_eyes_of_poppler(tmp_path):
    """The white of ring and markers, measured on the picture that another program makes of the sheets."""
    dpi, paper = 300, "a4"
    sheets.write_sheets(tmp_path / "p.pdf", LM_MAP, paper, "x", 1.0)
    subprocess.run(["pdftoppm", "-r", str(dpi), "-gray", tmp_path / "p.pdf", tmp_path / "p"], check=True)
    ring, plate = (cv2.imread(str(tmp_path / f"p-{k}.pgm"), 0) for k in (1, 2))
    mm = 25.4 / dpi
    assert np.allclose(np.array(ring.shape[::-1]) * mm, sheets.PAPERS_MM[paper], atol=mm)
    count, labels, facts, centres = cv2.connectedComponentsWithStats((ring > 127).astype(np.uint8))
    whole = next(k for k in range(1, count) if abs(facts[k, 2] * mm - 178.6) < 1)
    soft = (ring / 255.0)[facts[whole, 1] :, facts[whole, 0] :][: facts[whole, 3], : facts[whole, 2]]
    v, u = np.indices(soft.shape)
    radius = np.hypot(u - (soft.shape[1] - 1) / 2, v - (soft.shape[0] - 1) / 2) * mm
    edges = (1e3 * LM_MAP.ring_inner_radius_m, 1e3 * LM_MAP.ring_outer_radius_m)
    middle = sum(edges) / 2
    half = {"in": (radius > 60) & (radius < middle), "out": (radius >= middle) & (radius < 92)}
    area = {side: soft[part].sum() * mm**2 for side, part in half.items()}
    inner, outer = np.sqrt(middle**2 + np.array([-area["in"], area["out"]]) / np.pi)
    assert np.abs(np.array([inner, outer]) - edges).max() < TOLERANCE_MM

    count, labels, facts, centres = cv2.connectedComponentsWithStats((plate > 127).astype(np.uint8))
    markers = [k for k in range(1, count) if abs(facts[k, 4] * mm**2 - 53.6 * 16.1) < 9]
    assert len(markers) == 3
    corners = 1e3 * LM_MAP.marker_corners_m()[..., :2]
    middle = np.array([plate.shape[1], 2 * (5 + (sheets.PAPERS_MM[paper][1] - 68) / 2) / mm]) / 2
    found = (centres[markers] + 0.5 - middle) * mm * [1, -1]
    apart_mm = np.abs(found[:, None] - corners.mean(1)).max(-1)
    assert np.all(apart_mm.min(0) < TOLERANCE_MM) and np.all(apart_mm.min(1) < TOLERANCE_MM)
    for k in markers:
        near = cv2.dilate((labels == k).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        area_mm2 = (plate[near] / 255).sum() * mm**2  # its borders are black
        assert abs(area_mm2 - 53.6 * 16.1) < TOLERANCE_MM * (53.6 + 16.1)
    k = markers[np.argmax(centres[markers, 0])]  # the first lies along the rows
    u, v = np.round(centres[k]).astype(int)
    row, column = (plate[v, u - 150 : u + 97], plate[v - 350 : v + 351, u])  # as far as the fold's line
    sizes_mm = [line.sum() / 255 * mm for line in (row, column)]
    assert np.abs(np.subtract(sizes_mm, [16.1, 53.6])).max() < TOLERANCE_MM


def test_a_ruler_that_came_out_shorter_gives_the_port_that_came_out(tmp_path, lmmap):
    code, out, _ = lmmap("print", "--ruler", "97.5", "--scale", "0.5", "-o", tmp_path / "port.json")
    assert code == 0 and "port.json" in out
    port = Port.load(tmp_path / "port.json")
    assert np.allclose(port.marker_corners_m(), 0.4875 * LM_MAP.marker_corners_m())
    assert port.ring_outer_radius_m == pytest.approx(0.4875 * LM_MAP.ring_outer_radius_m)
    assert port.plate_height_tolerance == LM_MAP.plate_height_tolerance


def test_the_scale_that_would_fit_fits(tmp_path, lmmap):
    for paper in PAPERS:
        code, _, err = lmmap("print", "--paper", paper, "--scale", "3", "-o", tmp_path / f"{paper}.pdf")
        assert code == 1 and "does not fit" in err and not list(tmp_path.iterdir())
        scale = float(err.split("--scale ")[1])
        for s, fits in ((scale, True), (scale + 0.02, False)):
            port = scale_port(LM_MAP, s * LM_MAP.ring_radius_m)
            if fits:
                sheets.check(tmp_path / "x.pdf", port, paper, s)
            else:
                with pytest.raises(InputError, match="does not fit"):
                    sheets.check(tmp_path / "x.pdf", port, paper, s)


def test_each_sheet_says_what_it_is(tmp_path, lmmap):
    LM_MAP.save(tmp_path / "mine.json")
    argv = ("--port", tmp_path / "mine.json", "--scale", "0.5", "-o", tmp_path / "p.pdf")
    code, out, _ = lmmap("print", *argv)
    assert code == 0 and "--ruler 100" in out
    texts = [page.extract_text() for page in PdfReader(tmp_path / "p.pdf").pages]
    assert len(texts) == 2
    for text in texts:
        assert "mine.json" in text and "scale 0.5" in text and "100 mm" in text
        assert all(f"{k}  " in text or f"{k} " in text for k in range(1, 6))


BAD = {
    "markers": ({"marker_size_m": [1e-5, 1e-5]}, "without markers"),
    "hole": ({"plate_height_m": -0.01}, "below the ring"),
    "wide": ({"marker_size_m": [0.08, 0.0161], "window_size_m": [0.0, 0.0]}, "leave the plate"),
}


@pytest.mark.parametrize("case", BAD)
def test_ports_that_paper_cannot_be(tmp_path, lmmap, case):
    changes, words = BAD[case]
    LM_MAP.save(tmp_path / "port.json")
    values = json.loads((tmp_path / "port.json").read_text()) | changes
    (tmp_path / "port.json").write_text(json.dumps(values))
    code, out, err = lmmap("print", "--port", tmp_path / "port.json", "-o", tmp_path / "p.pdf")
    assert code == 1 and words in err and err.count("\n") == 1 and not out
    assert not (tmp_path / "p.pdf").exists()


@pytest.mark.parametrize(
    "argv", [("--scale", "0"), ("--scale", "nan"), ("--ruler", "9.75"), ("--ruler", "100")]
)
def test_numbers_and_names_out_of_range(tmp_path, lmmap, argv):
    code, _, err = lmmap("print", *argv, "-o", tmp_path / "p.pdf")
    assert code == 1 and err.count("\n") == 1


def test_words_of_the_command_line():
    assert set(PAPERS) == set(sheets.PAPERS_MM)
