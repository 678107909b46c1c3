"""``lmmap draw``: estimates from a file, drawn on the images that they were made from."""

from __future__ import annotations

from argparse import Namespace

from .. import plugins
from ..drawing.overlay import Overlay
from ..estimation.images import timed_images
from ..files import check_output
from ..recordings.pose_files import read_estimates
from ..types import InputError
from .inputs import find_port, find_settings, input_files, open_input
from .progress import Bar


def draw(a: Namespace) -> None:
    """Draw each estimate on the frame or histogram of its time, in a video or in a file for Rerun."""
    check_output(a.output, [*input_files(a), a.poses], overwrite=a.overwrite)
    estimates = {e.t_us: e for e in read_estimates(a.poses)}
    stream = open_input(a)
    shots = timed_images(stream, a.modality, find_settings(a, stream.camera), a.rate)
    view = plugins.needed("rerun", a.output) if a.output.suffix.lower() == ".rrd" else Overlay
    with view(a.output, find_port(a), stream.camera) as video, Bar(stream, a.modality) as bar:
        for timed in shots:
            images = dict([timed.wider] if timed.wider else []) | {timed.t_us: timed.image}
            for t_us in sorted(images.keys() & estimates.keys()):
                video.add(images[t_us], estimates[t_us])
                bar.add(estimates[t_us])
    if not bar.images:
        raise InputError(
            f"{a.poses}: none of its {len(estimates)} times matches an image of {a.recording}; give the "
            "--modality, --rate and --events that it was made with"
        )
    print(f"{a.output}: {bar.images} images, {bar.poses} with a pose")
