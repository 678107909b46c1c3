"""Nothing is tuned on what it is tested with: constants come from sequences that neither train nor test."""

import json
from dataclasses import asdict
from pathlib import Path

import calibrate_uncertainty
import choose_look
import choose_thresholds
import judge_gap
import judged_images
import measure_ports
import numpy as np
import pandas as pd
import pytest
import train_spikes
import tune_between
import tune_fusion
import validation_world

from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import load_card, weight_path
from lmmap.settings import OURS
from lmmap_lab.bench import photometry, varied
from lmmap_lab.bench.laboratory import sequence
from lmmap_lab.provenance import DATA, load_json
from lmmap_lab.rig import port_views
from lmmap_lab.studies import accuracy_run, between_images, spikes
from lmmap_lab.training import dataset


def drawn_as(name):
    """The laboratory's sequence whose motion a training sequence has."""
    return varied.base_sequence(name).name if varied.NAME.fullmatch(name) else name


TUNED_ON = {
    "tuning/tune_between.py": tune_between.SEQUENCES,
    "tuning/tune_fusion.py": tune_fusion.SEQUENCES,
    "tuning/calibrate_uncertainty.py": calibrate_uncertainty.SEQUENCES,
    "tuning/choose_thresholds.py": [*choose_thresholds.SEQUENCES, *choose_thresholds.EMPTY],
    "tuning/choose_look.py": choose_look.SEQUENCES,
    "tuning/validate_robust.py": validation_world.SEQUENCES + validation_world.PICTURES,
    "tuning/calibrate_confidence.py": judged_images.SEQUENCES,
    "tuning/measure_ports.py": measure_ports.SEQUENCES,
    "lmmap photometry": photometry.TRAJECTORIES,
    "filters": [drawn_as(name) for names in dataset.SETS.values() for name in names],
}
FUSION = DATA / "results" / "fusion"


@pytest.mark.parametrize("names", TUNED_ON.values(), ids=TUNED_ON)
def test_nothing_is_chosen_on_test_hard_or_empty_sequences(names):
    assert all(name.startswith(("realistic-", "augmented-", "speed-", "empty-1")) for name in names)
    judged = {name for profile in ("quick", "paper") for name in accuracy_run.sequences_of(profile)}
    assert all(name.startswith(("test-", "hard-", "empty-")) for name in judged)
    assert not (judged | set(between_images.SEQUENCES)) & set(names)


def test_the_filters_never_saw_what_their_covariances_and_fusion_are_tuned_on():
    trained = set(TUNED_ON["filters"])
    assert not trained & {*tune_fusion.SEQUENCES, *calibrate_uncertainty.SEQUENCES}


def test_the_gap_is_judged_by_equal_trainings_on_what_nothing_else_uses():
    judging = [name for names in judge_gap.SEQUENCES.values() for name in names]
    assert len(set(judging)) == len(judging) == 2 * 3 * 8
    assert not set(judging) & {name for names in TUNED_ON.values() for name in names}
    rings = [(m, gap, seed) for m in CHANNELS for gap in ("high", "low") for seed in judge_gap.SEEDS[gap]]
    cards = [load_card(weight_path("ring", *ring)) for ring in rings]
    alike = {tuple(card["recipe"][key] for key in ("steps", "rate", "start_from")) for card in cards}
    assert len(alike) == 1 and len({card["sha256"] for card in cards}) == len(rings) == 12
    assert not set(judging) & {drawn_as(name) for card in cards for name in card["training_sequences"]}


def test_no_two_choices_are_made_on_the_same_sequences():
    """What the robust set is judged on neither trains the filters nor tunes anything else."""
    reserved = TUNED_ON["tuning/validate_robust.py"]
    others = [name for user, names in TUNED_ON.items() if names is not reserved for name in names]
    assert len(set(reserved)) == len(reserved)
    assert not set(reserved) & set(others)


def test_what_the_confidence_is_held_out_on_tunes_nothing():
    held_out = {name for place, names in judged_images.SETS.items() if "held out" in place for name in names}
    tuned = [name for user, names in TUNED_ON.items() if "confidence" not in user for name in names]
    tuned += [name for place, names in judged_images.SETS.items() if "tuning" in place for name in names]
    assert len(held_out) > 20 and not held_out & set(tuned)


def test_the_confidence_is_the_script_s_choice():
    """At the committed limit the committed shares are those of the settings, and few poses are wrong."""
    shares = pd.read_csv(DATA / "results" / "wrong-poses.csv")
    images = shares.groupby(["set", "estimator"]).images.sum().unstack()
    assert (images["every pose"] == images["confident poses"]).all()
    wrong = shares.assign(wrong=shares.wrong_percent * shares.images).groupby("estimator").wrong.sum()
    assert wrong["confident poses"] < 0.5 * wrong["every pose"]


def test_training_and_test_move_differently():
    """Sequences of other names have other motions; the three tests share theirs."""
    drawn = {
        name: tuple(sequence(name).rng("motion").uniform(size=4))
        for name in (*tune_fusion.SEQUENCES, *accuracy_run.sequences_of("paper"))
    }
    assert len({drawn[f"test-{light}"] for light in ("low", "medium", "high")}) == 1
    assert len(set(drawn.values())) == len(drawn) - 2


def test_the_constants_are_the_scripts_choice():
    """The committed grid's row by the rule, and the committed choices, are what the module holds."""
    grid, choices = pd.read_csv(FUSION / "grid.csv"), load_json(FUSION / "choices.json")
    best = tune_fusion.choice(grid)
    assert asdict(OURS.motion) == pytest.approx(choices["motion"])
    for name in ("acceleration_m", "acceleration_rad", "correlation_s"):
        assert getattr(OURS.motion, name) == best[name]
    assert Path(FUSION / "grid.provenance.json").exists()


def test_of_honest_settings_the_best_is_chosen():
    grid = pd.DataFrame({"score": [3.0, 2.5, 2.8, 2.9], "inside_95_percent": [90.0, 95.0, 94.2, 97.5],
                         "chance": [1.0, 1.0, 1.0, 2.0]})  # fmt: skip
    assert tune_fusion.choice(grid).score == 2.8
    assert tune_fusion.choice(grid.assign(chance=0.0)).score == 2.5
    assert tune_fusion.choice(grid.drop(index=[1, 2, 3])).score == 3.0


def test_the_second_look_is_the_scripts_choice():
    looks = pd.read_csv(DATA / "results" / "looks.csv")
    assert set(looks.factor) == set(choose_look.FACTORS)
    assert choose_look.choice(looks, OURS.second_look_factor) == OURS.second_look_factor


def test_the_deviations_of_a_measured_port_are_the_scripts_choice():
    table = pd.read_csv(DATA / "results" / "measured-ports.csv")
    assert set(table.sequence) == set(measure_ports.SEQUENCES)
    assert measure_ports.choice(table, port_views.ALIKE) == port_views.ALIKE


def test_another_second_look_needs_more_right_poses_than_chance():
    """Of 100 images 36 right are within a standard error (4.9) of 40; 35 are not."""
    looks = pd.DataFrame({"factor": [1.0, 1.5, 2.0], "images": [500, 100, 100], "right": [400, 36, 40]})
    assert choose_look.choice(looks, 1.5) == 1.5 and choose_look.choice(looks, 2.0) == 2.0
    assert choose_look.choice(looks.replace(36, 35), 1.5) == 2.0


def test_the_thresholds_are_the_scripts_choice():
    """The settings stay, and the same table would not let thresholds stay that are much worse."""
    table, names = pd.read_csv(DATA / "results" / "thresholds.csv"), list(choose_thresholds.NAMES)
    ours = OURS.mask_threshold, OURS.peak_share, OURS.min_marker_score
    assert tuple(choose_thresholds.choice(table, ours)[names]) == ours
    for worse in ((0.2, OURS.peak_share, OURS.min_marker_score), (0.9, 0.9, 0.9)):
        assert tuple(choose_thresholds.choice(table, worse)[names]) != worse


def test_thresholds_stay_within_chance_and_without_false_poses():
    """Of 100 images: 80 right now, 81 or 90 with the next; a pose without a port rules out the best."""
    rows = [(0.5, 0.9, 0.1, 100, 80, 0, 0), (0.6, 0.9, 0.1, 100, 81, 0, 0), (0.7, 0.9, 0.1, 100, 99, 0, 1)]
    table = pd.DataFrame(rows, columns=[*choose_thresholds.NAMES, "images", "right", "wrong", "false"])
    present = (0.5, 0.9, 0.1)
    assert choose_thresholds.choice(table, present).mask_threshold == 0.5
    assert choose_thresholds.choice(table.assign(right=[80, 90, 99]), present).mask_threshold == 0.6
    assert choose_thresholds.choice(table.assign(wrong=[9, 0, 0]), present).mask_threshold == 0.6
    assert choose_thresholds.choice(table.assign(false=0), present).mask_threshold == 0.7


def test_how_late_events_are_is_the_scripts_choice():
    grid = pd.read_csv(DATA / "results" / "between" / "grid.csv")
    assert tune_between.choice(grid).late_us == OURS.between.late_us
    edges = pd.read_csv(DATA / "results" / "between" / "edges.csv")
    single = edges[edges.events == 1]
    assert abs(np.average(single.outward_px, weights=single.pieces) - OURS.between.outward_px) < 0.15
    variance_px2 = np.average(single.variance_px2, weights=single.pieces)
    assert abs(np.sqrt(variance_px2) - np.hypot(OURS.between.sigma_px, OURS.between.common_px)) < 0.15


def test_a_speed_of_the_study_is_another_path_than_those_that_tune():
    numbers = {name.rsplit("-", 1)[1] for name in between_images.SEQUENCES}
    assert not numbers & {name.rsplit("-", 1)[1] for name in tune_between.SEQUENCES}


def test_spiking_networks_are_judged_on_what_nothing_else_uses():
    judging = {f"realistic-{n}" for n in range(50_000, 50_150)}  # of benchmarks/spikes.py
    assert not judging & {name for names in TUNED_ON.values() for name in names}
    assert {*train_spikes.SEQUENCES} < {*dataset.SETS["low"]}
    trained, _ = dataset.split(train_spikes.SEQUENCES)
    assert {*train_spikes.BALANCED} <= {*trained}
    made_by = json.loads(spikes.RESULTS.joinpath("outcomes.provenance.json").read_text())
    assert made_by["first_sequence"] == 50_000 and made_by["sequences"] <= 150
