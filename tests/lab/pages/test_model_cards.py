"""Model cards say what the weights' own cards and the committed results say."""

import hashlib

import pytest

from lmmap.pipeline.ring import binarise
from lmmap.pipeline.weights import FILTERS, SETS, load_network, weight_path
from lmmap.recordings.formats import formats, open_recording
from lmmap.settings import OURS
from lmmap_lab.bench.labels import label_masks
from lmmap_lab.pages import model_cards
from lmmap_lab.provenance import DATA
from lmmap_lab.training.mask_quality import filter_quality, iou


@pytest.mark.parametrize("networks", SETS)
def test_each_network_is_named_by_the_hash_of_its_file(networks):
    table = model_cards.training(networks)
    paths = [weight_path(name, modality, networks) for name in FILTERS for modality in ("rgb", "event")]
    assert table.sha256.tolist() == [hashlib.sha256(p.read_bytes()).hexdigest()[:12] for p in paths]
    assert table["validation overlap"].between(0, 1).all()


@pytest.mark.parametrize("networks", ["low", "robust", "slim"])
def test_every_tested_image_is_right_wrong_or_has_no_pose(networks):
    table = model_cards.tests(networks)
    assert len(table) >= 6
    assert table[["right (%)", "wrong (%)", "no pose (%)"]].sum(axis=1).to_numpy() == pytest.approx(
        100, abs=1e-3
    )


def test_the_distance_range_shrinks_with_the_focal_length():
    near, far = model_cards.ranges()["distance of the port (m)"].iloc[[0, -1]]
    assert [float(x) for x in near.split(" to ")] == pytest.approx(
        [2 * float(x) for x in far.split(" to ")], abs=0.02
    )
    assert model_cards.ring_range_px() == OURS.trained_ring_px


def test_every_format_has_its_row():
    assert sorted(model_cards.formats()["format"]) == sorted(formats())


def test_the_trained_sensor_is_the_first_row():
    table = model_cards.sensors()
    assert table.index[0] == ("DAVIS 346", "frames", "known")
    compared = table["minus DAVIS 346"][lambda gain: gain != ""]
    assert len(compared) > 10 and all(s != "DAVIS 346" and ring == "known" for s, _, ring in compared.index)


def test_a_card_shows_of_each_camera_an_image_and_its_overlap(port):
    recording = open_recording(DATA / "mini" / "test-low.aedat4")
    pictures = model_cards.worst_masks("low", recording, filter_quality(recording, most=2))
    assert [modality for _, modality, *_ in pictures] == ["rgb", "event"]
    for title, modality, image, T_cam_port in pictures:
        mask = binarise(load_network(weight_path("ring", modality, "low"), modality)(image))
        overlap = iou(mask, label_masks(T_cam_port, port, recording.camera)[0])
        assert title.endswith(f"overlap {overlap:.2f}")


@pytest.mark.parametrize("networks", ["low", "robust", "slim"])
def test_no_cell_is_harder_than_the_hardest(networks):
    where, percent = model_cards.hardest(networks)
    table = model_cards.tests(networks)
    table = table[table.images >= model_cards.ENOUGH]
    (row,) = table[table["no pose (%)"] == percent].head(1).itertuples()
    assert (table["no pose (%)"] <= percent).all()
    assert row.camera in where and f"{row.light} light" in where


def test_beside_the_default_set_the_difference_is_that_of_both_shares():
    table = model_cards.beside_default()
    assert (
        table.index.tolist()[2:4] == [("frames", "high light"), ("frames", "all lights")] and len(table) == 8
    )
    shares = table["right (%)"].map(lambda text: float(text.split(" (")[0]))
    assert (shares.slim - shares[OURS.weights]).to_numpy() == pytest.approx(shares.difference, abs=0.11)
    images = table["images", ""].astype(int)
    assert images["frames"].iloc[:3].sum() == images["frames", "all lights"]
