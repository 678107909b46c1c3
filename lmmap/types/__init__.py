"""The types that every wing uses: cameras, ports, poses, ellipses, events, recordings, estimates.

Frames: ``cam`` has x right, y down, z forward.  ``port`` has its origin at the ring's centre in the ring's
plane, z out of the port toward the visitor and x through marker 0.  ``T_a_b`` maps b-coordinates to a.  Units
are metres, pixels, radians and microseconds unless a name says otherwise; integer pixel coordinates are pixel
centres.
"""

from ..errors import InputError
from .arrays import frozen_array, frozen_numbers
from .camera import Camera
from .checks import check_number, check_time, checked
from .ellipse import Ellipse
from .estimate import Estimate, Status
from .events import EVENT, check_events, concatenate_events, event_array, on_sensor
from .port import Port
from .pose import Pose, Trajectory
from .recording import AnyRecording, Recording

__all__ = [
    "EVENT", "AnyRecording", "Camera", "Ellipse", "Estimate", "InputError", "Port", "Pose", "Recording",
    "Status", "Trajectory", "check_events", "check_number", "check_time", "checked", "concatenate_events",
    "event_array", "frozen_array", "frozen_numbers", "on_sensor",
]  # fmt: skip
