"""Model cards of the shipped sets of networks: what their files, and the results that are committed, say."""

from __future__ import annotations

from itertools import product

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.estimation.images import images
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.rescale import trained_range_m
from lmmap.pipeline.weights import FILTERS, SETS, load_card, load_network, weight_path
from lmmap.settings import OURS
from lmmap.types import Camera, Port, Recording

from ..provenance import DATA
from . import networks_page
from .tables import CAMERAS, LIGHTS, sentence_table, shares_with_ends

NETWORKS = {"ring": "ring", "reflector": "markers"}
ENOUGH = 10  # images, to say where a set is weakest
LENSES = {  # for the range of distances
    "DAVIS 346, 6 mm": Camera.davis346(),
    "focal length 225 px": Camera(240, 180, 225.0, 225.0, 119.5, 89.5),
    "focal length 162 px": Camera(346, 260, 162.0, 162.0, 172.5, 129.5),
}


def training(networks: str) -> pd.DataFrame:
    """A row for each network of a set, from its card."""
    rows = []
    for name in FILTERS:
        for modality in CHANNELS:
            path = weight_path(name, modality, networks)
            card = load_card(path)
            kinds = sorted({sequence.split("-")[0] for sequence in card["training_sequences"]})
            rows.append({
                "network": f"{NETWORKS[name]}, {CAMERAS[modality]}",
                "training sequences": ", ".join(kinds),
                "images": card["training_images"], "steps": card["recipe"]["steps"],
                "learning rate": card["recipe"]["rate"],
                "started from": card["recipe"]["start_from"] or "random weights",
                "validation overlap": card["curve"][-1]["iou"], "sha256": card["sha256"][:12],
            })  # fmt: skip
    return pd.DataFrame(rows)


def training_table(networks: str):
    """`training`, styled."""
    return sentence_table(training(networks)).format(precision=3, thousands=",")


def devices() -> str:
    """On what the shipped networks were trained, by their cards."""
    cards = [load_card(weight_path(f, m, gap)) for f, m, gap in product(FILTERS, CHANNELS, SETS)]
    words = {"cuda": "a graphics card", "cpu": "processor cores"}
    return " and ".join(sorted({f"{words[c['device']]} (torch {c['torch'].split('+')[0]})" for c in cards}))


def tests(networks: str) -> pd.DataFrame:
    """Right, wrong and missing poses of a set, by place, camera and light; empty where none were measured."""
    if networks == "slim":
        table = pd.read_csv(DATA / "results" / "slim.csv").query("light != 'all'")
    else:
        table = pd.read_csv(DATA / "results" / "wrong-poses.csv").query("estimator != 'every pose'")
    chosen = table[table.weights == networks]
    chosen = chosen[chosen.set.str.endswith(("held out", "judged once"))]
    return pd.DataFrame({
        "place": chosen.set.str.removesuffix(", held out").str.replace("other laboratory", "second scene"),
        "camera": chosen.modality.map(CAMERAS),
        "light": chosen.light, "right (%)": chosen.right_percent, "wrong (%)": chosen.wrong_percent,
        "no pose (%)": chosen.none_percent, "images": chosen.images,
    })  # fmt: skip


def tests_table(networks: str):
    """`tests`, styled: the rows grouped by place and camera."""
    table = tests(networks).replace(
        {
            "light": LIGHTS,
            "place": {"slow": "slow motion", "second scene, judged once": "second scene, final test"},
        }
    )
    rows = table.set_index(["place", "camera", "light"]).rename_axis(index=(None,) * 3)
    return rows.style.format(precision=1)


def hardest(networks: str) -> tuple[str, float]:
    """Of the `tests` of a set that have `ENOUGH` images, where the most of these have no pose, in words, and
    in how many percent."""
    table = tests(networks).query("images >= @ENOUGH")
    row = table.loc[table["no pose (%)"].idxmax()]
    place = row.place.removesuffix(", judged once")
    return f"{row.camera} in {row.light} light ({place})", row["no pose (%)"]


def beside(place: str) -> pd.DataFrame:
    """Rows of data/results/slim.csv, of `slim` and the default set, on one set of sequences."""
    return pd.read_csv(DATA / "results" / "slim.csv").query("set == @place")


def beside_default() -> pd.DataFrame:
    """Texts on the tuning sequences by camera and light: right and wrong poses of `slim` and of the default
    set, and how many more are right with `slim`; in brackets 95 % intervals."""
    rows = beside("tuning").set_index(["modality", "light"]).loc[list(product(CHANNELS, (*LIGHTS, "all")))]
    of = {name: rows[rows.weights == name] for name in ("slim", OURS.weights)}
    columns = {("right (%)", name): shares_with_ends(own, "right", ".1f") for name, own in of.items()}
    columns["right (%)", "difference"] = shares_with_ends(of["slim"], "more_right", ".1f")
    columns |= {("wrong (%)", name): shares_with_ends(own, "wrong", ".1f") for name, own in of.items()}
    columns["images", ""] = of["slim"].images.astype(str)
    words = {**CAMERAS, **LIGHTS, "all": "all lights"}
    return pd.DataFrame(columns).rename(index=words).rename_axis([None, None])


def worst_masks(networks: str, recording: Recording, quality: pd.DataFrame) -> list[tuple]:
    """Of a recording with truth, each camera's image whose ring mask by a set overlaps least with the truth.

    Parameters
    ----------
    quality
        Fits of the masks, as `mask_quality.filter_quality` returns them.

    Returns
    -------
    For each camera ``(title, modality, image, true pose)``, as `networks_page.draw_masks` takes them.
    """
    pictures = []
    rings = quality.query("filter == 'ring' and domain_gap == @networks")
    for modality, rows in rings.groupby("modality", sort=False):
        worst = rows.loc[rows.iou.idxmin()]
        image = next(image for t_us, image in images(recording, modality) if t_us == worst.t_us)
        title = f"{CAMERAS[modality]}, overlap {worst.iou:.2f}"
        pictures.append((title, modality, image, recording.truth.at(np.array([worst.t_us], np.int64))[0]))
    return pictures


def draw_failures(networks: str, recording: Recording, quality: pd.DataFrame):
    """Figure of the `worst_masks` of a set: each image, and beside it what its masks have wrong."""
    loaded = {
        (name, m): load_network(weight_path(name, m, networks), m) for name in FILTERS for m in CHANNELS
    }
    pictures = worst_masks(networks, recording, quality)
    fig, axes = plt.subplots(1, 2 * len(pictures), figsize=(7.6, 1.8))
    networks_page.draw_masks(axes.reshape(-1, 2), pictures, loaded, Port.lm_map())
    return fig


def ranges() -> pd.DataFrame:
    """From which to which distance the networks know the ring, by lens."""
    near_far = {name: trained_range_m(camera, Port.lm_map()) for name, camera in LENSES.items()}
    rows = [(name, f"{near:.2f} to {far:.2f}") for name, (near, far) in near_far.items()]
    return pd.DataFrame(rows, columns=["lens", "distance of the port (m)"])


def sensors() -> pd.DataFrame:
    """Right and wrong poses by sensor, over all lights, of rings of a size that the networks know; in
    brackets the 95 % interval of the comparison with the DAVIS 346."""
    table = pd.read_csv(DATA / "results" / "sensors.csv").query("light == 'all' and ring != 'other'")
    table = table.assign(order=pd.factorize(table.sensor)[0]).sort_values(
        ["order", "modality", "ring"], ascending=[True, False, False]
    )
    ends = table[["gain_percent", "gain_percent_low", "gain_percent_high"]].to_numpy()
    gains = ["" if np.isnan(row[0]) else "{:+d} ({:+d} to {:+d})".format(*map(round, row)) for row in ends]
    texts = table[["right_percent", "wrong_percent", "images", "cpu_ms"]].map("{:.0f}".format)
    right, wrong, images, time_ms = texts.to_numpy().T
    return pd.DataFrame({
        "sensor": table.sensor, "camera": table.modality.map(CAMERAS),
        "ring": table.ring.replace({"trained": "known"}), "right (%)": right, "minus DAVIS 346": gains,
        "wrong (%)": wrong, "images": images, "time (ms)": time_ms,
    }).set_index(["sensor", "camera", "ring"])  # fmt: skip


def formats() -> pd.DataFrame:
    """What each command does with each format, as the tests found it."""
    table = pd.read_csv(DATA / "results" / "formats.csv").drop(columns="name")
    words = {"images": "tested with", "bad input is one line": "bad input: one-line error",
             "clocks": "clocks of two cameras"}  # fmt: skip
    return table.replace({"images": CAMERAS, "clocks": {"of one camera": "one camera only"}}).rename(
        columns=words
    )


def ring_range_px() -> tuple[float, float]:
    """Smallest and largest semi-major axis of the ring in the training, in pixels."""
    return OURS.trained_ring_px
