"""``lmmap draw``: estimates from a file, drawn on the images that they were made of."""

from __future__ import annotations

from ..files import check_output
from ..pages.overlay import Overlay
from ..pages.rerun_log import RerunLog
from ..pipeline import run
from ..pipeline.image_estimator import settings_for
from ..recordings.pose_files import read_estimates
from ..types import InputError
from .inputs import find_port, input_files, open_input
from .progress import Bar


def draw(a) -> None:
    """A video of the estimates, or a file for Rerun, each on the frame or histogram of its time."""
    check_output(a.output, [*input_files(a), a.poses], overwrite=a.overwrite)
    estimates = {e.t_us: e for e in read_estimates(a.poses)}
    stream = open_input(a)
    timed_images = run.timed_images(stream, a.modality, settings_for(stream.camera, a.events), a.rate)
    drawn = poses = 0
    view = RerunLog if a.output.suffix.lower() == ".rrd" else Overlay
    with view(a.output, find_port(a), stream.camera) as video, Bar(stream, a.modality) as bar:
        for timed in timed_images:
            images = dict([timed.wider] if timed.wider else []) | {timed.t_us: timed.image}
            for t_us in sorted(images.keys() & estimates.keys()):
                video.add(images[t_us], estimates[t_us])
                drawn += 1
                poses += estimates[t_us].T_cam_port is not None
                bar.show(t_us, drawn, poses)
    if not drawn:
        raise InputError(
            f"{a.poses}: none of its {len(estimates)} times is that of an image of {a.recording}; give the "
            "--modality, --rate and --events that it was made with"
        )
    print(f"{a.output}: {drawn} images, {poses} with a pose")
