"""Every free parameter of the pipeline: `PAPER` holds those that the paper states, `OURS` all of them.

Settings are passed as arguments.  Vary them with `dataclasses.replace`; no code modifies a module's values.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

MODALITIES = ("rgb", "event")


@dataclass(frozen=True)
class PerCamera:
    """A setting that differs between the two cameras; read it as ``setting[modality]``."""

    rgb: float | tuple[float, ...]
    event: float | tuple[float, ...]

    def __getitem__(self, modality: str):
        return {"rgb": self.rgb, "event": self.event}[modality]


@dataclass(frozen=True)
class PaperSettings:
    """The numbers that the paper states."""

    events_per_window: int = 35_000  # N, section II.B
    yaw_step_rad: float = float(np.deg2rad(1.0))  # grid of the yaw search, section II.D
    outlier_angle_rad: float = float(np.deg2rad(15.0))  # outlier filter, section IV
    outlier_poses: int = 3  # outlier filter, section IV
    rate_hz: float = 10.0  # of all experiments, section IV


@dataclass(frozen=True)
class Assumptions:
    """Parameters that the paper's procedure needs but its text leaves open."""

    mask_threshold: float = 0.5  # of the binarisation: the middle of the sigmoid's range
    min_ring_pixels: int = 60  # gamma_S: as in our pipeline
    ransac_hypotheses: int = 500  # H: as in our pipeline
    min_axis_ratio: float = 0.25  # of the check on the axes: as in our pipeline, 75 deg of tilt
    ransac_tolerance_px: float = 1.5  # of an inlier, by its Sampson distance: as in our pipeline


@dataclass(frozen=True)
class MotionSettings:
    """Assumptions of the Kalman filter; ``tuning/tune_fusion.py`` chose all but the gate."""

    acceleration_m: float = 0.02  # square root of the acceleration's density, m / s^1.5
    acceleration_rad: float = 0.2  # rad / s^1.5
    correlation_s: float = 0.0  # time over which a camera's errors stay alike
    speed_m_s: float = 0.05  # standard deviation along each axis when nothing is known yet
    rate_rad_s: float = 0.18  # the same of the angular rate
    gate: float = 22.46  # squared Mahalanobis distance that 99.9 % of estimates keep (chi-square, 6)
    lost_s: float = 0.2  # a track ends after so long without an accepted estimate


@dataclass(frozen=True)
class BetweenSettings:
    """How events correct a track between images.

    ``tuning/tune_between.py`` chose ``late_us`` and, in an earlier grid, the correlation, and measured the
    residuals that give offset and deviations; motion, gate and ``sure_sigmas`` were set by hand on its
    sequences.
    """

    period_us: int = 2000  # of updates: 500 Hz
    gate_px: float = 2.5  # from an edge: events farther away are not the edge's
    sigma_px: float = 0.75  # standard deviation of an event about its edge
    common_px: float = 0.2  # of the error that events at one piece of edge share
    correlation_s: float = 0.02  # time over which that error stays alike
    late_us: int = 3500  # of events behind what they show: a pixel in little light is slow
    late_sigma_us: float = 2000.0  # standard deviation of the same, which all events of a recording share
    outward_px: float = 0.5  # of events from their edge: a logarithm changes most where it is dark
    sure_sigmas: float = 1.0  # of an edge's velocity: below, it may stand still, and its events say nothing
    motion: MotionSettings = field(
        default_factory=lambda: MotionSettings(
            acceleration_m=0.05, acceleration_rad=0.3, speed_m_s=0.15, rate_rad_s=0.6, lost_s=1.0
        )
    )


@dataclass(frozen=True)
class Settings(PaperSettings):
    """The paper's numbers, and every other free parameter of our pipeline."""

    weights: str = "robust"  # default set of networks; tuning/wrong_poses.py compares it with `low`

    # images of other lenses
    trained_focal_px: float = 324.0  # of the bench's camera, on which the networks were trained
    trained_ring_px: tuple[float, float] = (21.0, 80.0)  # semi-major axis, at the bench's 1.2 to 0.33 m
    focal_slack: float = 1.15  # within this ratio of it an image is taken as it is
    enlargement: PerCamera = PerCamera(rgb=2.0, event=1.0)  # at most; counts between pixels are no sensor's
    enlarged_looks: tuple[float, ...] = (1.2, 1.44)  # at a small sensor's histogram without a pose as it is

    # windows of events
    second_look_factor: float = 2.0  # times N, where N events show no sure pose; tuning/choose_look.py

    # images whose ring is seen without a sure pose are looked at again; tuning/wrong_poses.py
    turned_look: bool = True  # by the mean mask of the image as it is and after half a turn
    sure_confidence: float = 0.95  # from here on one look is enough
    look_independence: float = 0.0  # of two looks that agree; tuning/calibrate_confidence.py

    # ring mask to pixels
    mask_threshold: float = 0.5  # tuning/choose_thresholds.py
    peak_share: float = 0.9  # of the mask's maximum, which a blob must reach; tuning/choose_thresholds.py
    min_ring_pixels: int = 60  # gamma_S of the paper, which does not state it

    # ellipse
    ransac_hypotheses: int = 500  # H of the paper, which does not state it
    ransac_tolerance_px: float = 1.5  # Sampson distance of an inlier
    ransac_refits: int = 10  # of 500 hypotheses about as many have five inliers at 55 % outliers
    min_axis_ratio: float = 0.25  # 75 deg of tilt: beyond, plate and petals hide the far half of the ring
    min_semi_major_px: float = 12.0  # at most 2.2 m: beyond, the ring's stroke is a pixel or two wide
    local_search: bool = True  # try `local_search` where points from anywhere give no ellipse
    min_contrast: float = 0.3  # of the mask along an ellipse to that beside it; rings have 0.45 to 1
    min_arc_coverage: float = 0.5  # with less, the ellipse's size and tilt are guesses (book: ellipses)

    # contour below a pixel
    contour_half_width: float = 1.5  # of the strip searched, in widths of the ring's stroke
    contour_floor: float = 0.1  # an edge lies at half the mask's height, or nowhere if that is below
    contour_widths: tuple[float, float] = (0.6, 1.6)  # of a good ray, in units of the median ray's
    widest_stroke: float = 1.5  # in units of the port's ring: of 459 right rings the widest had 1.24
    contour_min_rays: float = 0.4  # share of good rays, below which there is no stroke

    # yaw
    min_marker_score: float = 0.15  # tuning/choose_thresholds.py
    min_yaw_margin: float = 0.15  # below, another yaw is as good; tuning/calibrate_uncertainty.py
    # logarithm of a yaw's probability for each unit of the mask's mean inside the markers and of
    # `outline.support`; tuning/fit_yaw.py
    yaw_weights: PerCamera = PerCamera(rgb=(27.94, 26.11, 10.36, 4.92), event=(55.06, 25.84, 0.33, 2.21))
    other_yaw_share: float = 0.25  # of a period: a yaw that far from the best one is another one
    marker_border_px: float = 4  # beside the markers, for what measures their edges

    # ring and markers together
    refine_jointly: bool = True  # after the two circles' poses
    joint_rounds: int = 4  # Gauss-Newton steps at most
    joint_settled: float = 0.1  # standard deviations: a smaller step is the last
    edge_half_px: float = 3.0  # of the profile across a marker's side
    edge_contrast: float = 0.5  # of the mask between inside and outside, for an edge to be seen
    min_edges: int = 20  # fewer edge points add nothing

    # refinement on the image's edges; tuning/refine_on_edges.py
    edge_rounds: int = 2  # Gauss-Newton steps; 0: none
    edge_reach_px: float = 4.0  # to each side of the outline
    edge_least: float = 1.3  # strength of an edge, in units of those around it
    edge_outlier_sigmas: float = 1.5  # where an edge's influence falls
    edge_sigma_px: float = 1.0  # of a point of the outline
    edge_offset_px: float = 0.5  # standard deviation of how far all edges of a part are off alike

    # covariances: neighbouring samples of a mask err alike, so independent ones would promise too much.
    # By tuning/calibrate_uncertainty.py on sequences that neither train nor test, with networks on the bench
    # that trained them: other networks ask for a new measurement.
    ring_inflation: PerCamera = PerCamera(rgb=13.8, event=13.9)  # variance of a contour point of score 1
    marker_sigma_px: PerCamera = PerCamera(rgb=1.7, event=2.0)  # of a marker's edge point
    joint_inflation: PerCamera = PerCamera(rgb=0.42, event=0.66)  # of the refined pose's covariance
    edge_inflation: PerCamera = PerCamera(rgb=1.05, event=1.26)  # of a pose's refined on the image's edges
    edge_fading: PerCamera = PerCamera(rgb=1.77, event=1.1)  # power of the markers' score that divides it
    yaw_inflation: float = 0.92  # of the yaw's standard deviation
    min_sigma_px: float = 0.02  # no contour is known better, whatever its scatter
    min_ring_score: float = 0.1  # no contour is known worse by its mask
    merged_sigmas: float = 3.0  # of tilt: below, head-on is not excluded (99 %) and both normals are possible

    # probability that a pose is right: constant and slopes on `verify.evidence`, by
    # tuning/calibrate_confidence.py
    # of position and normal; the slope of `markers_off_px` is set by hand
    confidence_ring: tuple[float, ...] = (-3.092, -0.681, -10.092, 1.895, -1.0, 0.593)
    confidence_yaw: tuple[float, ...] = (-7.482, 0.279, 14.465)  # that the yaw is right, if they are
    min_confidence: PerCamera = PerCamera(rgb=0.5, event=0.7)  # below, the status is `UNSURE`: no pose
    min_fused_confidence: float = 0.85  # of a track of both cameras
    port_off_px: float = 0.5  # by which markers lie off in half of a recording's poses, to doubt the port: it
    # was 0.1 to 0.25 on the bench and elsewhere, and 0.8 to 1.2 where the plate was 20 % higher
    port_off_poses: int = 10  # with fewer, no warning about the port

    # tracking, image by image
    crop_sigmas: float = 3.0  # of the predicted ring, beside which the ring filter does not look
    full_frame_every: int = 20  # images: one a second of the bench's frames

    # errors of a pose that one may dock on
    right_position_m: float = 0.020
    right_normal_rad: float = float(np.deg2rad(5.0))
    right_rotation_rad: float = float(np.deg2rad(10.0))
    certain_sigmas: float = 1.96  # standard deviations within those errors: 95 %

    motion: MotionSettings = field(default_factory=MotionSettings)
    between: BetweenSettings = field(default_factory=BetweenSettings)


PAPER = PaperSettings()
OURS = Settings()


def scaled_count(size_px: tuple[int, int]) -> int:
    """Events in a window, at the paper's number per pixel: 35 000 at 346 x 260 px, or 0.39 per pixel."""
    return max(1, round(PAPER.events_per_window * size_px[0] * size_px[1] / (346 * 260)))
