"""A number that stands in two places is one number: one glue in the book, and README's are the results'."""

import json
import re
from collections import defaultdict
from itertools import combinations

import numpy as np
import pandas as pd
import pytest

from lmmap.settings import OURS
from lmmap.types import Camera, Port, Pose
from lmmap_lab.pages import intro_page
from lmmap_lab.provenance import DATA, ROOT, load_json, load_table
from lmmap_lab.studies import domain_gap, five_degrees_study, formula, sensitivity
from lmmap_lab.studies.accuracy_run import COMMITTED
from lmmap_lab.studies.five_degrees_fit import ASKEW, LITERAL, NOISE
from lmmap_lab.studies.table1 import LIGHTS
from lmmap_lab.studies.verdicts import FAILS

PAGES = {path.name: path.read_text() for path in sorted((ROOT / "book").glob("*.md"))}
README = " ".join((ROOT / "README.md").read_text().split())
ONE_PLACE = {  # where a number is glued, and how; every other page takes it from there
    "accuracy_right_mm": ("accuracy.md", "accuracy_right_mm"),
    "accuracy_right_normal": ("accuracy.md", "accuracy_right_normal"),
    "accuracy_right_rotation": ("accuracy.md", "accuracy_right_rotation"),
    "accuracy_as_printed_deg": ("accuracy.md", "accuracy_{name}_deg"),
    "accuracy_paper_deg": ("accuracy.md", "accuracy_{name}_deg"),
    "accuracy_ours_deg": ("accuracy.md", "accuracy_{name}_deg"),
    "accuracy_exact_deg": ("accuracy.md", "accuracy_exact_deg"),
    "accuracy_claims": ("accuracy.md", "accuracy_claims"),
    "accuracy_seconds": ("accuracy.md", "accuracy_seconds"),
    "circles_frontal_deg": ("circles.md", "circles_frontal_deg"),
    "circles_rms_0_deg": ("circles.md", "circles_rms_{tilt_deg}_deg"),
    "degrees_noise": ("accuracy.md", "degrees_{words}"),
    "degrees_literal": ("accuracy.md", "degrees_{words}"),
    "degrees_askew": ("accuracy.md", "degrees_{words}"),
    "sensitivity_45_deg": ("sensitivity.md", "sensitivity_45_deg"),
    "intro_minutes": ("intro.md", "intro_minutes"),
    "hard_noise_ours": ("both-cameras.md", "hard_noise_ours"),
    "bench_frames_p95": ("port.md", "bench_{name}_p95"),
}
LIMITS = ("right_position_m", "right_normal_rad", "right_rotation_rad")


@pytest.mark.parametrize("name", ONE_PLACE)
def test_a_number_is_glued_once_and_taken_from_there(name):
    page, made = ONE_PLACE[name]
    assert [place for place, text in PAGES.items() if re.search(rf'glue\(f?"{re.escape(made)}"', text)] == [
        page
    ]
    uses = {
        place: set(re.findall(rf"glue:text}}`([^`]*\b{name})(?::[^`]*)?`", text))
        for place, text in PAGES.items()
    }
    assert set.union(*uses.values())
    for place, words in uses.items():
        assert words <= ({name} if place == page else {f"{page}::{name}"}), place


@pytest.mark.parametrize("limit", LIMITS)
def test_the_limits_of_a_right_pose_are_glued_on_one_page(limit):
    glued = [place for place, text in PAGES.items() if re.search(rf"glue\([^\n]*OURS\.{limit}\b", text)]
    assert glued == ["accuracy.md"]


def test_readme_and_pages_name_the_same_limits_and_minutes():
    millimetres, normal, rotation = (getattr(OURS, limit) for limit in LIMITS)
    limits = f"{1e3 * millimetres:.0f} mm, {np.rad2deg(normal):.0f} degrees in the normal and"
    assert f"{limits} {np.rad2deg(rotation):.0f} degrees in rotation" in README
    assert f"| {intro_page.REPRODUCE_MINUTES} min, " in README
    for place in ("intro.md", "check.md"):
        assert "intro_minutes" in PAGES[place] and "`make reproduce`" in PAGES[place]


def test_page_one_and_readme_say_of_the_five_degrees_what_the_study_and_the_verdict_say():
    study = load_table(five_degrees_study.COMMITTED).query("variation == 'as it is'").set_index("hypothesis")
    noise, literal, askew = (study.misfit[name] for name in (NOISE, LITERAL, ASKEW))
    assert f"misfit of {noise:.3f}; two explanations fit, a biased formula ({literal:.3f}) and" in README
    assert f"a misaligned ground truth ({askew:.3f})" in README and "systematic, not noise" in README
    claims = load_table(COMMITTED / "claims.csv").set_index("key")
    assert claims.verdict["sensitivity_explains"] == FAILS, "or it is not said so"
    assert claims.ours["sensitivity_explains"].startswith(f"{noise:.3f}; {literal:.3f}; ")
    page = " ".join(PAGES["intro.md"].split())
    for word in (
        "systematic, not noise",
        "Two explanations fit",
        "degrees_noise",
        "degrees_literal",
        "degrees_askew",
    ):
        assert word in page
    for text in (*PAGES.values(), README):
        assert "misread" not in text and "lies in the formula" not in text


def test_readme_has_the_rates_of_the_full_test():
    rates = load_table(COMMITTED / "default.csv").query("light != 'no port'")
    right, wrong = (rates.pivot(index="modality", columns="light", values=f"{what}_percent")[list(LIGHTS)]
                    for what in ("right", "wrong"))  # fmt: skip
    frames, events, both = (", ".join(f"{v:.0f}" for v in right.loc[m]) for m in ("rgb", "event", "fused"))
    assert (
        f"in {frames} % of the frames, in {events} % of the histograms and, fused, in {both} % of" in README
    )
    frames, events, both = (
        f"{np.ceil(10 * wrong.loc[m].max()) / 10:.1f} %" for m in ("rgb", "event", "fused")
    )
    assert f"at most {frames} of the frames, {events} of the histograms and {both} of the instants" in README


def test_readme_and_the_page_on_recordings_say_how_much_faster_a_tracker_is():
    pace = load_table(DATA / "results" / "pace.csv").pivot(
        index=["precision", "modality"], columns="part", values="ms"
    )
    times = pace["image to pose"] / pace["tracker"]
    assert "more than twice as fast" in README and times.min() > 2
    assert "less than half the time" in " ".join(PAGES["your-recording.md"].split())


def test_readme_says_of_the_gap_what_the_study_says():
    table = load_table(DATA / "results" / "domain-gap.csv")
    cost = domain_gap.cell(table, "film", "mask_overlap", "mean", domain_gap.EITHER, "cost of the gap")
    assert "events lose less of their masks to a domain gap than frames" in README and cost["low"] > 0


def test_the_button_head_on_gives_the_formula_s_own_number():
    """Off the axis by half a pixel the ring is not quite head-on, and the bias is another."""
    script = (ROOT / "book" / "_static" / "ring-lab.js").read_text()
    (values,) = re.findall(r"data-set='(\{[^}]*\})'>head-on at 0\.6 m<", script)
    start, camera, radius_m = json.loads(values), Camera.davis346(), Port.lm_map().ring_radius_m
    place = (np.array([start["u_px"], start["v_px"]]) - [camera.cx_px, camera.cy_px]) / camera.fx_px
    tilted = sensitivity.tilted_pose(start["distance_m"], np.deg2rad(start["tilt_deg"]))
    T = Pose(tilted.rotation[None], start["distance_m"] * np.r_[place, 1][None])
    error_rad = formula.errors_rad(T, camera, radius_m, "printed")[0]
    assert error_rad == pytest.approx(2 * np.arctan(radius_m / start["distance_m"]), abs=np.deg2rad(0.05))


def test_white_pixels_of_the_test_come_from_one_table():
    assert not [place for place, text in PAGES.items() if "saturation-test" in text]
    assert any('COMMITTED / "saturation.csv"' in text for text in PAGES.values())


def test_the_tolerances_at_our_limits_are_the_ladder_s_wrong_poses():
    ladder = pd.read_csv(COMMITTED / "ladder.csv")
    ladder = ladder.query("metric == 'wrong_percent' and outlier_filter == 'without'")
    ours = pd.read_csv(COMMITTED / "tolerances.csv").query("factor == 1 and limits == 'all limits'")
    both = ours.merge(ladder, on=["rung", "light", "modality", "training"])
    assert len(both) == len(ours) and np.allclose(both.wrong_percent, both.value, atol=1e-3)


@pytest.mark.parametrize("place", ["intro.md", "accuracy.md"])
def test_the_printed_procedure_is_said_to_be_read_literally(place):
    text = " ".join(PAGES[place].split())
    assert "read literally" in text and "code is not public" in text
    assert "read literally" in README and "code is not public" in README


def test_simulated_is_said_where_a_new_place_is_judged():
    for place, text in PAGES.items():
        words = text.replace('"other laboratory, judged once"', "").replace(
            "another laboratory and another", ""
        )
        assert not re.search(r"\b(other|another|foreign) laboratory", words), place
    assert "second simulated scene" in README
    assert "come from our own simulation" in PAGES["intro.md"].split("```{code-cell}")[1]


SHARES = ["right_percent", "wrong_percent", "none_percent", "images"]


def _rows(name: str, query: str, *keys: str) -> pd.DataFrame:
    """Shares of a committed table's rows, by the names of `keys` there."""
    table = pd.read_csv(DATA / "results" / f"{name}.csv").query(query)
    return table.set_index(list(keys)).rename_axis(range(len(keys)))[SHARES].sort_index()


PLACES = "set", "modality", "light"
LEARNED = "method in ('pnp', 'pose', 'crop') and place == 'second scene'"
ONE_NUMBER = [
    (("wrong-poses", "weights == 'robust' and estimator == 'confident poses'", *PLACES),
     ("slim", "weights == 'robust' and light != 'all' and set != 'tuning'", *PLACES)),
    (("wrong-poses", "weights == 'robust' and estimator == 'confident poses'", *PLACES),
     ("turned", "looks == 'looks again'", *PLACES)),
    (("accuracy/default", "modality in ('rgb', 'event') and light != 'no port'", "light", "modality"),
     ("tracks-paper", "estimates == 'frame by frame'", "light", "camera")),
    (("peers/places", LEARNED, "method", "modality"),
     ("peers/curves", LEARNED + " and images_learned > 1000", "method", "modality")),
]  # fmt: skip


@pytest.mark.parametrize("one, other", ONE_NUMBER)
def test_what_two_tables_measure_is_one_number(one, other):
    pd.testing.assert_frame_equal(_rows(*one), _rows(*other), check_dtype=False, rtol=1e-5)


def test_two_studies_of_one_image_by_the_same_networks_have_one_answer():
    """Before anything was learned: what is learned later depends on the seconds that taught."""
    image = ["judged_on", "modality", "t_us"]
    places, whole = (
        pd.read_csv(DATA / "results" / "adaptation" / f"{name}-images.csv").query("when == 'before'")
        for name in ("places", "whole")
    )
    both = places.drop_duplicates(image).merge(whole.drop_duplicates(image), on=image)
    assert len(both) > 100
    for answer in ("status", "confidence", "right", "wrong"):
        pd.testing.assert_series_equal(both[f"{answer}_x"], both[f"{answer}_y"], check_names=False)


def test_the_region_of_the_chosen_fusion_is_that_of_the_present_one():
    choices, present = (
        load_json(DATA / "results" / "fusion" / f"{name}.json") for name in ("choices", "present")
    )
    assert present["inside_95_percent"] == pytest.approx(choices["inside_95_percent"])


def _one_run(name: str) -> str:
    """A committed result by its name; the accuracy study's tables, which one run writes, are one."""
    return "accuracy" if name.startswith("accuracy/") else name


COMPARED = {  # what the tests above compare
    *(frozenset(map(_one_run, (name for name, *_ in pair))) for pair in ONE_NUMBER),
    frozenset({"adaptation/places-images", "adaptation/whole-images"}),
    frozenset({"fusion/choices", "fusion/present"}),
}
NUMBER = re.compile(r"(?<![\w.:-])\d*\.\d+(?:e[-+]?\d+)?(?![\w.:])")


def _digits(value: float) -> int:
    return len(f"{value:.15g}".split("e")[0].replace(".", "").strip("0"))


def _informative(values: np.ndarray) -> np.ndarray:
    """Of numbers (N,), those with five digits, from zero and from one, that are no ratio of small counts."""
    least = [min(_digits(v), _digits(round(abs(1 - v), 6))) for v in values]
    values = values[np.array(least) >= 5] if len(values) else values
    close, counts = np.array([6e-6 if _digits(v) <= 6 else 1e-10 for v in values]), np.arange(1, 150)
    off = [np.abs(y - np.rint(y * counts) / counts) / y for y in (values[:, None], values[:, None] / 100)]
    return values[(np.minimum(*off) > close[:, None]).all(axis=1)]


def _measured() -> dict[str, set[float]]:
    """Numbers by committed result."""
    numbers, folder = defaultdict(set), DATA / "results"
    for path in [*folder.rglob("*.csv"), *folder.rglob("*.json")]:
        if not path.name.endswith(".provenance.json"):
            name = path.relative_to(folder).with_suffix("").as_posix()
            found = np.array([*map(float, set(NUMBER.findall(path.read_text())))])
            numbers[_one_run(name)] |= set(_informative(found))
    return numbers


def test_no_number_stands_in_two_results_unless_a_test_compares_them():
    """So none of the two can be old.  Of six digits a few agree by chance; one of more digits cannot."""
    twice = set()
    for one, other in combinations(sorted(numbers := _measured()), 2):
        both = numbers[one] & numbers[other]
        by_chance = len(numbers[one]) * len(numbers[other]) / 1e6
        if len(both) > 3 + 3 * by_chance or any(_digits(value) > 8 for value in both):
            twice.add(frozenset({one, other}))
    assert twice <= COMPARED, twice - COMPARED
    assert len(twice) >= 3, "or the rule sees nothing"


def test_the_accuracy_tables_are_of_one_run():
    """But for the claims, which a test computes again from the others."""
    made = {path.name: json.loads(path.read_text()) for path in COMMITTED.glob("*.provenance.json")}
    del made["claims.provenance.json"]
    assert len(made) > 10 and len({(facts["commit"], facts["profile"]) for facts in made.values()}) == 1
