"""What stands under the book's figures: which functions and data they are made of, and what they show."""

import matplotlib.pyplot as plt
import pytest
from lmmap_sources import COMMITTED, NOW, PAPER, origins, sources

from lmmap_lab.pages import drawings

IMPORTS = """
import numpy as np
from lmmap_lab.pages import drawings
from lmmap.pipeline import histograms
from lmmap.geometry.projection import project
from lmmap.recordings.formats import open_recording
from lmmap_lab.provenance import DATA, DERIVED_DATA, profile
"""


@pytest.mark.parametrize("cell, expected", [
    ("x = histograms.windows([], 1)", {"lmmap.pipeline.histograms.windows"}),
    ("open_recording(DATA / 'a' / 'b')", {"lmmap.recordings.formats.open_recording", "data/a/b"}),
    ("t = DERIVED_DATA / profile() / 'summary.csv'", {"data/derived"}),
    ("x = (COMMITTED / 'worst.jpg').read_bytes()", {"data/results/accuracy/worst.jpg"}),
    ("cv2.imread(str(odometry.FOLDER / 'a.png'))", {"data/results/odometry/a.png"}),
    ("drawings.use_style(); np.zeros(3); print('x')", set()),
    ("def f(x):\n    return project(x, None)", {"lmmap.geometry.projection.project"}),
])  # fmt: skip
def test_a_cell_names_its_functions_and_files(cell, expected):
    assert sources([IMPORTS, cell])[1] == expected


def test_a_figure_has_the_sources_of_its_variables_and_no_others():
    loop = "for k in range(3):\n    some.append(project(r, k))"
    first = "r = open_recording(DATA / 'a')\nsome = []"
    cells = [IMPORTS, first, loop, "ax = drawings.strip(r)", "plt.plot(some)", "ax = 1\nplt.plot(ax)"]
    of_r = {"lmmap.recordings.formats.open_recording", "data/a"}
    by_cell = sources(cells)
    assert by_cell[3] == of_r | {"lmmap_lab.pages.drawings.strip"}
    assert by_cell[4] == of_r | {"lmmap.geometry.projection.project"}
    assert by_cell[5] == set()


def test_a_variable_assigned_anew_forgets_what_it_was():
    cells = [IMPORTS, "x = project(0, 0)\nx = histograms.windows([], 1)", "plt.plot(x)"]
    assert sources(cells)[2] == {"lmmap.pipeline.histograms.windows"}


def test_variables_of_comprehensions_stay_in_them():
    cells = [
        IMPORTS,
        "t = [project(k, 0) for k in range(3)]",
        "plt.plot([k for k in range(2)])",
        "plt.plot(t)",
    ]
    assert [sources(cells)[k] for k in (2, 3)] == [set(), {"lmmap.geometry.projection.project"}]


@pytest.mark.parametrize("used, expected", [
    ({"lmmap.geometry.projection.project"}, [NOW]),
    ({"data/results/accuracy/ladder.csv", "lmmap_lab.pages.waterfall.draw"}, [COMMITTED]),
    ({"lmmap_lab.pages.model_cards.tests_table"}, [COMMITTED]),  # by a function that it calls
    ({"lmmap_lab.pages.model_cards.training_table"}, [COMMITTED]),  # by the cards
    ({"lmmap_lab.studies.table1.compare", "data/results/accuracy"}, [COMMITTED, PAPER]),
    ({"lmmap_lab.bench.sequences.simulate", "data/results/port-outlines.json"}, [NOW, COMMITTED]),
    ({"lmmap_lab.studies.five_degrees_fit.paper_cells"}, [NOW, PAPER]),
    ({"lmmap_lab.pages.player.Player"}, [COMMITTED]),
    ({"book/_static/paper-steps.jpg"}, [COMMITTED]),
])  # fmt: skip
def test_it_is_said_whether_numbers_are_computed_now(used, expected):
    assert origins(used) == expected


def test_a_figure_is_described_by_its_labels_titles_and_legend():
    fig, (left, right) = plt.subplots(1, 2)
    left.plot([0, 1], label="ours")
    left.set(xlabel="tilt (deg)", ylabel="error (mm)", title="half an ellipse")
    left.legend()
    right.imshow([[0]])
    assert drawings.describe(fig) == "half an ellipse: error (mm) over tilt (deg) (ours); image"
    plt.close(fig)
    fig, axes = plt.subplots(1, 3)
    for ax in axes:
        ax.set_label("a hexagon")
    assert drawings.describe(fig) == "3 times a hexagon"
    plt.close(fig)
