"""Masks in crops are those of the whole image, and two can be made at once."""

import os
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

from lmmap.pipeline.crops import _kept_workers, at_once, mask_within, workers
from lmmap.pipeline.weights import load_network, weight_path


@pytest.fixture
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize("modality", ["rgb", "event"])
@pytest.mark.parametrize("corner, size", [((30, 25), (61, 50)), ((-4, 90), (40, 40)), ((100, 70), (90, 80))])
@pytest.mark.parametrize("name", ["ring", "reflector"])
def test_masks_on_crops_equal_those_of_the_whole_image_bit_by_bit(name, modality, corner, size, one_thread):
    network = load_network(weight_path(name, modality, "low"), modality, "float32")
    shape = (130, 170, 3) if modality == "rgb" else (130, 170)
    image = np.random.default_rng(2).integers(0, 256 if modality == "rgb" else 7, shape).astype(np.uint8)
    low, high = np.array(corner) + 0.5, np.array(corner) + size
    part, full = mask_within(network, image, low, high), network(image)
    box = np.zeros(full.shape, bool)
    box[max(corner[1], 0) : corner[1] + size[1] + 1, max(corner[0], 0) : corner[0] + size[0] + 1] = True
    np.testing.assert_array_equal(part[box], full[box])
    assert not part[~box].any() and full[~box].any()


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_two_functions_at_once_give_what_they_give_one_by_one(threads, one_thread):
    torch.set_num_threads(threads)
    _kept_workers.cache_clear()  # an idle old worker would take the number that was set last
    seen = at_once(torch.get_num_threads, lambda: "second")
    assert seen == [max(threads // 2, 1), "second"] and torch.get_num_threads() == threads
    with pytest.raises(ZeroDivisionError):
        at_once(lambda: 1 / 0, lambda: None)
    # or one may still begin, and set its number, in another test
    _kept_workers(threads, os.getpid()).shutdown()
    _kept_workers.cache_clear()


def test_the_callers_own_threads_keep_torchs_number(one_thread):
    """Two images are worked on at once, on one thread of torch's each; whoever else asks has what it had."""
    torch.set_num_threads(2)

    def asked() -> int:
        with ThreadPoolExecutor(1) as mine:
            return mine.submit(torch.get_num_threads).result()

    both = threading.Barrier(2)  # or one worker may take both tasks while the other one is still being made

    def met(_) -> int:
        both.wait(60)
        return torch.get_num_threads()

    with workers(2) as pool:
        assert list(pool.map(met, range(4))) == [1] * 4
        assert asked() == 2
    assert torch.get_num_threads() == asked() == 2
