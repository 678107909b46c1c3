"""``lmmap draw``: estimates from a file, drawn on the images that they were made of."""

from __future__ import annotations

from argparse import Namespace

from .. import plugins
from ..drawing.overlay import Overlay
from ..estimation.images import timed_images
from ..files import check_output
from ..recordings.journal import recording_mark
from ..recordings.pose_files import read_estimates
from ..types import Camera, InputError
from .inputs import find_port, find_settings, input_files, made_of, open_input
from .progress import Bar


def draw(a: Namespace) -> None:
    """A video of the estimates, or a file for Rerun, each on the frame or histogram of its time."""
    check_output(a.output, [*input_files(a), a.poses], overwrite=a.overwrite)
    estimates = {e.t_us: e for e in read_estimates(a.poses)}
    stream = open_input(a)
    shots = timed_images(stream, a.modality, find_settings(a, stream.camera), a.rate)
    view = _view(a, stream.camera)
    try:
        with view as video, Bar(stream, a.modality) as bar:
            for timed in shots:
                images = dict([timed.wider] if timed.wider else []) | {timed.t_us: timed.image}
                for t_us in sorted(images.keys() & estimates.keys()):
                    video.add(images[t_us], estimates[t_us])
                    bar.add(estimates[t_us])
    except KeyboardInterrupt:
        if not isinstance(view, Overlay):
            raise
        raise KeyboardInterrupt(f"{view.video.folder} keeps what was drawn, --resume goes on") from None
    if not bar.images:
        raise InputError(
            f"{a.poses}: none of its {len(estimates)} times is that of an image of {a.recording}; give the "
            "--modality, --rate and --events that it was made with"
        )
    print(f"{a.output}: {bar.images} images, {bar.poses} with a pose")


def _view(a: Namespace, camera: Camera):
    """What the estimates are drawn on, by the name of the output."""
    port = find_port(a)
    if a.output.suffix.lower() == ".rrd":
        if a.resume:
            raise InputError(f"{a.output}: a file for Rerun cannot be resumed; leave --resume out")
        return plugins.needed("rerun", a.output)(a.output, port, camera)
    more = {"poses": recording_mark(a.poses), "modality": a.modality, "events": a.events}
    view = Overlay(a.output, port, camera, made_of(a, camera, port, **more), a.resume)
    if view.video.folder.exists() and not (a.resume or a.overwrite):
        raise InputError(f"{view.video.folder}: holds an interrupted video; give --resume, or --overwrite")
    return view
