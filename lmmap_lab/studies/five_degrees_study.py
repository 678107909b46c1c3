"""The study of what made five degrees: hypotheses beside Table I, their intervals, and what they lean on.

python -m lmmap_lab.studies.five_degrees_study
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import pandas as pd

from ..provenance import DATA, save_table
from . import bootstrap, five_degrees_masks
from .five_degrees import Scene, bench_scene, draws, errors_deg
from .five_degrees_besides import mixture, outliers_deg, yaw_of
from .five_degrees_fit import ASKEW, HYPOTHESES, NOISE, VARIED, Hypothesis, finest, fit, fits, paper_cells

COMMITTED = DATA / "results" / "five-degrees.csv"
TYPICAL_M = 0.6  # the paper's distance
LASTING = 0.5  # correlation of the noise of an image and the next: see `main`
DRAWS = 40


def study(scene: Scene, count: int = 0, hypotheses: Sequence[Hypothesis] = HYPOTHESES, seed: int = 0,
          **options) -> pd.DataFrame:  # fmt: skip
    """A row for each hypothesis: misfit and free numbers, and what they predict besides.

    Intervals are of ``count`` trajectories that might have been the paper's, `draws` of the scene's poses.

    Returns
    -------
    DataFrame
        ``hypothesis, free``; ``misfit, nu_over_z, misaligned_deg`` and their 95 % intervals, ``_low`` and
        ``_high``; the cells' ``noise_low_px, noise_high_px``, and ``kept_low, kept_high``, the share that the
        filter keeps; ``rotation``, the root mean square of the log ratios of the rotation; ``unfiltered``,
        that of the normals' medians without filter; ``by_chance``, the share of tables, made by this
        hypothesis on other trajectories, that it fits as badly; and the shares of trajectories in which it
        fits better than noise alone, ``beats_noise``, and than a misaligned truth, ``beats_askew``.
    """
    normal = paper_cells().to_numpy()
    rotation = paper_cells("rotation_error_deg").to_numpy()
    bare = paper_cells(outlier_filter="without").to_numpy()
    rng, rows, misfits = np.random.default_rng(seed), [], {}
    found = fits(scene, hypotheses, draws(scene, count, seed), **options)
    for h in hypotheses:
        best, predicted = found[h.name]
        off = partial(errors_deg, scene, h.reading, best.ratio, tilts_deg=[best.tilt_deg])
        turned, unfiltered = [], []
        for c, noise_px in enumerate(best.noise_px):
            turned.append(yaw_of(off(noise_px, **options)[0], rotation[c])[2])
            near = off(noise_px, **options | {"limit_rad": np.pi})[0]
            far = outliers_deg(len(near), np.random.default_rng(c))
            unfiltered.append(np.log(mixture(near[np.isfinite(near)], far, bare[c, 1])[1] / bare[c, 0]))
        more = float(np.sum(np.square(turned)))
        best = fit(h, finest(predicted[0]), normal, more)
        there = [finest(part) for part in predicted[1:]]
        others = [fit(h, part, normal, more) for part in there]
        made = np.array([np.exp(part[*best.at, :2]) for part in there])
        cells, whole = np.arange(len(normal)), finest(predicted[0])
        again = [fit(h, whole, made[rng.integers(0, count, len(cells)), cells]).misfit for _ in there]
        misfits[h.name] = np.array([f.misfit for f in others])
        row = {"hypothesis": h.name, "free": h.free}
        unit = scene.radius_m / TYPICAL_M
        for name, value, values in (
            ("misfit", best.misfit, misfits[h.name]),
            ("nu_over_z", best.ratio * unit, [f.ratio * unit for f in others]),
            ("misaligned_deg", best.tilt_deg, [f.tilt_deg for f in others]),
        ):
            low, high = bootstrap.interval(values)
            row |= {name: value, f"{name}_low": low, f"{name}_high": high}
        rows.append(row | {
            "noise_low_px": best.noise_px.min(), "noise_high_px": best.noise_px.max(),
            "kept_low": best.kept.min(), "kept_high": best.kept.max(),
            "rotation": np.sqrt(more / rotation.size),
            "unfiltered": np.sqrt(np.mean(np.square(unfiltered))),
            "by_chance": np.mean(np.array(again) >= best.misfit) if there else np.nan,
        })  # fmt: skip
    return pd.DataFrame(rows).assign(**{
        f"beats_{word}": [np.mean(m < misfits[of]) if count else np.nan for m in misfits.values()]
        for word, of in (("noise", NOISE), ("askew", ASKEW))
    })  # fmt: skip


def main() -> None:
    """The study, and what it leans on, varied.

    Of the correlations of the noise, `LASTING` is that with which the medians without filter are right, too.
    """
    parts = {"as it is": study(bench_scene(LASTING), DRAWS)}
    varied = partial(study, hypotheses=VARIED)
    for lasting in (0.0, 0.25, 0.75):
        parts[f"noise lasts {lasting:g}"] = varied(bench_scene(lasting))
    parts["no filter"] = varied(bench_scene(LASTING), limit_rad=np.pi)
    for factor in (0.8, 1.25):
        parts[f"distances x {factor:g}"] = varied(bench_scene(LASTING, distance=factor))
        parts[f"tilts x {factor:g}"] = varied(bench_scene(LASTING, tilt=factor))
    parts["camera askew"] = varied(bench_scene(LASTING), on_camera=True)
    masks = pd.read_csv(five_degrees_masks.COMMITTED)
    parts["noise of masks"] = varied(five_degrees_masks.mask_scene(masks, bench_scene()))
    table = pd.concat([rows.assign(variation=name) for name, rows in parts.items()])
    print(table.to_string(index=False, float_format="%.3f"))
    save_table(COMMITTED, table, draws=DRAWS, lasting=LASTING)


if __name__ == "__main__":
    main()
