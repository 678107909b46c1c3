"""What is estimated on kept masks is what the pipeline estimates with its networks."""

import judged_images
import numpy as np
import pytest
import wrong_poses
from strategies import CAMERA, PORT, pose

from lmmap.estimation.estimates import estimate_image
from lmmap.estimation.images import TimedImage
from lmmap.geometry.port import ideal_masks
from lmmap.pipeline.estimator import Estimator
from lmmap.settings import OURS
from lmmap_lab.studies.sequence_files import looks_of

T0 = pose((180, 120), 0.6, 0.5, 0.8)
MASKS = ideal_masks(T0, PORT, CAMERA).astype(np.float32)


class Network:
    """Of each image, told by its first pixel, one mask as it is and one of its turned copy, turned back."""

    def __init__(self, plain, turned):
        self.plain, self.turned = plain, turned

    def __call__(self, image):
        if k := image[0, 0]:
            return self.plain[k]
        return self.turned[image[-1, -1]][::-1, ::-1]


def image(k):
    counts = np.zeros((CAMERA.height_px, CAMERA.width_px), np.uint32)
    counts[0, 0] = k
    return counts


def case(shown):
    """Two images; ``shown`` has the shares of the ideal masks in (N events, more events), (plain, turned)."""
    looks = []
    for k, (plain, turned) in enumerate(shown, 1):
        looks.append(judged_images.Look(image(k), plain * MASKS, (plain + turned) / 2 * MASKS, T0))
    return judged_images.Case("", "", "", "event", OURS.weights, looks)


@pytest.mark.parametrize("weights", ["low", OURS.weights])
@pytest.mark.parametrize("shown", [((0, 0), (0, 0)), ((0.6, 1), (0, 1)), ((0, 0), (1, 1)), ((1, 1), (1, 1))])
def test_kept_masks_give_the_pipeline_s_answer(shown, weights):
    settings = looks_of(weights, OURS)
    networks = [
        Network({k: p * MASKS[f] for k, (p, _) in enumerate(shown, 1)},
                {k: t * MASKS[f] for k, (_, t) in enumerate(shown, 1)}) for f in (0, 1)
    ]  # fmt: skip
    estimator = Estimator(CAMERA, PORT, "event", tuple(networks), settings)
    _, expected = estimate_image(estimator, TimedImage(0, image(1), (1, image(2))))
    told, look = wrong_poses.OnMasks("event", settings).answer(case(shown))
    assert (told.status, told.t_us) == (expected.status, expected.t_us) and look.truth is T0
    assert told.confidence == pytest.approx(expected.confidence, abs=1e-6)
