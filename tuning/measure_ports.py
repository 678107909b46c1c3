"""How well `lmmap calibrate --port` measures a port, and how far its standard deviations can be believed.

    python tuning/measure_ports.py

Short sequences of the bench that neither train nor test anything show the standard port, and one whose plate
is a fifth higher; frames only, one a second.  data/results/measured-ports.csv has each
dimension with its error and its standard deviation.  `port_views.ALIKE` is what makes the root mean square
of their ratio 1, rounded up to a half: masks of one recording err alike, which the scatter between its images
does not show.
"""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pandas as pd
from tqdm import tqdm

from lmmap.types import Port
from lmmap_lab.bench import sequences
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.rig import port_views
from lmmap_lab.rig.port_outline import DIMENSIONS, dimensions_m, with_dimensions

SEQUENCES, SECONDS, FRAME_HZ = [f"realistic-{n}" for n in range(53001, 53007)], 40.0, 1.0
STANDARD = Port.lm_map()
PORTS = {
    "standard": STANDARD,
    "plate 20 % higher": with_dimensions(STANDARD, [1.2, 1, 1, 1, 1] * dimensions_m(STANDARD)),
}


def errors(name: str, shape: str) -> list[dict]:
    """A row for each dimension."""
    setup = sequences.Setup(frame_hz=FRAME_HZ)
    with patch.object(sequences, "render_times_us", lambda *_: np.zeros(1, np.int64)):  # no events
        recording = sequences.simulate(name, SECONDS, setup=setup, port=PORTS[shape])
    fit, _ = port_views.measure_port(recording)
    values = zip(DIMENSIONS, dimensions_m(PORTS[shape]), dimensions_m(fit.port), fit.sigma_m, strict=True)
    facts = {"sequence": name, "port": shape, "images": int(fit.kept.sum())}
    return [facts | {"dimension": what, "true_mm": 1e3 * true, "error_mm": 1e3 * (value - true),
                     "sigma_mm": 1e3 * sigma} for what, true, value, sigma in values]  # fmt: skip


def choice(table: pd.DataFrame, present: float) -> float:
    """What standard deviations are to be multiplied by, from a table made with the present factor."""
    return np.ceil(2 * present * np.sqrt(np.mean(table.sigmas**2))) / 2


def main() -> None:
    runs = [(name, shape) for name in SEQUENCES for shape in PORTS]
    table = pd.DataFrame([row for run in tqdm(runs, disable=None) for row in errors(*run)])
    table["sigmas"] = table.error_mm / table.sigma_mm
    rms = table.groupby(["port", "dimension"], sort=False)[["error_mm", "sigmas"]]
    print(rms.agg(lambda v: np.sqrt(np.mean(v**2))).round(2).to_string())
    print(f"ALIKE: {choice(table, port_views.ALIKE):g} by these, {port_views.ALIKE:g} now")
    save_table(DATA / "results" / "measured-ports.csv", table, sequences=SEQUENCES, seconds=SECONDS)


if __name__ == "__main__":
    main()
