"""The paper's claims about limits: hard cases, empty images, windows, odometry, and what cannot be tested;
and what it proposes to try next."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from lmmap.settings import PAPER

from ..provenance import DATA
from .verdicts import FAILS, HOLDS, PARTLY, TRIED, UNTESTED, other_results, row, verdict

SEES_PERCENT, BLIND_PERCENT = 50.0, 10.0  # images with an ellipse: of a camera that sees, of a blind one
RARE = 1e-3  # of images without a port: the paper's 5 in 5000
OFTEN_PERCENT = 25.0  # of the frames without a pose: an odometry that loses its track often


def claims_of_limits(counts: pd.DataFrame) -> Iterator[dict]:
    """Rows of `verdicts.row`, from ``images, ellipses, poses`` by ``sequence`` and ``modality``."""
    yield from _hard_cases(counts)
    yield _false_detections(counts)
    yield _window()
    yield _odometry()
    yield from _elsewhere()
    yield _spikes()


def _hard_cases(counts):
    paper = other_results().set_index(["quantity", "condition"]).value
    for name, case, weak, strong, word in (
        ("hard-slow", "slow motion", "event", "rgb", "event"),
        ("hard-reflect", "full reflect", "rgb", "event", "RGB"),
    ):
        case_counts = counts[counts.sequence == name].set_index("modality")
        rate = 100 * case_counts.ellipses / case_counts.images
        reported = " | ".join(paper[(f"ellipse detection success, {m}", case)] for m in ("rgb", "event"))
        fused = 100 * case_counts.poses["fused"] / case_counts.images["fused"]
        sees, poor = rate[strong] > SEES_PERCENT, rate[weak] < 0.5 * rate[strong]
        judged = HOLDS if sees and rate[weak] < BLIND_PERCENT else PARTLY if sees and poor else FAILS
        yield row(
            f"{case.capitalize()} blinds the {word} camera only (images with an ellipse, %: RGB | events)",
            reported,
            {"ours": (f"{rate['rgb']:.1f} | {rate['event']:.1f}; fused poses {fused:.1f}", judged)},
            f"blinded: an ellipse in under {BLIND_PERCENT:.0f} %, the other camera in over half; partly: in "
            "less than half as many as the other",
        )


def _false_detections(counts):
    empty = counts[counts.sequence.str.startswith("empty") & (counts.modality != "fused")]
    false, images = int(empty.poses.sum()), int(empty.images.sum())
    judged = verdict(false <= RARE * images) if images >= 1 / RARE or false else UNTESTED
    return row(
        "False detections are rare without a port",
        "5 in more than 5000 images",
        {"ours": (f"{false} in {images} images", judged)},
        f"rare: at most 1 in {1 / RARE:.0f}",
    )


def _window():
    """Whether N events are enough, by the images that tune the second look."""
    looks = pd.read_csv(DATA / "results" / "looks.csv").groupby("factor")[["images", "right"]].sum()
    images, first = looks.loc[1.0, "images"], looks.loc[1.0, "right"]
    more = looks.right.drop(1.0).max()
    return row(
        f"Histograms of {PAPER.events_per_window:,} events are enough",
        "N is used throughout",
        {
            "ours": (
                f"right in {100 * first / images:.0f} %; a second look at more events adds "
                f"{100 * more / images:.0f} %",
                verdict(more < 0.1 * first),
            )
        },
        "enough: more events add less than a tenth; on sequences of the tuning",
    )


def _odometry():
    runs = pd.read_csv(DATA / "results" / "odometry" / "runs.csv").query("method != 'lmmap'")
    totals = runs.groupby("modality")[["tracked", "frames"]].sum()
    percent = 100 * totals.tracked / totals.frames
    text = f"frames with a pose: {percent['rgb']:.0f} % | event frames: {percent['event']:.0f} %"
    return row(
        "ORB-SLAM3 and SVO lose their track often, and are not accurate enough to dock",
        "in words",
        {"ours": (text, verdict(percent < 100 - OFTEN_PERCENT))},
        f"often: no pose in over {OFTEN_PERCENT:.0f} %; accuracy and reasons are in the chapter on visual "
        "odometry",
    )


def _spikes():
    """What the best spiking network makes of whole windows."""
    outcomes = pd.read_csv(DATA / "results" / "spikes" / "outcomes.csv").query("group == 'all'")
    whole = outcomes[outcomes.events == PAPER.events_per_window].set_index("network").right_percent
    spiking = whole.drop("ordinary").max()
    return row(
        "Spiking networks are to exploit the time of events better",
        "future work",
        {"ours": (f"right in {spiking:.0f} %; the ordinary network in {whole['ordinary']:.0f} %", TRIED)},
        "no claim, and so no verdict; the best of our spiking networks, on whole windows, is shown, and the "
        "chapter on spikes has the rest",
    )


def _elsewhere():
    """Claims that this bench cannot judge, and where to look instead."""
    for claim, paper, ours, why in (
        (
            "EVO fails on every sequence",
            "tracking failed after seconds",
            "not the authors' program",
            "the chapter on visual odometry runs one that is written from its paper",
        ),
        (
            "Such are the errors of real sensors in a laboratory",
            "Table I",
            "a simulated bench",
            "the authors' 145 GB are not here; `lmmap evaluate` reads such recordings",
        ),
        (
            "10 Hz on a laptop; the search for the yaw takes longest",
            "10 Hz, 25 % of the processor, 330 MB of video memory",
            "another machine",
            "`make bench` measures each stage on the machine at hand",
        ),
    ):
        yield row(claim, paper, {"ours": (ours, UNTESTED)}, why)
