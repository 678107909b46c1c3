"""EVO's numbers, each with where it comes from.

``EVO``: Rebecq, Horstschaefer, Gallego, Scaramuzza, "EVO: A Geometric Approach to Event-based 6-DOF
Parallel Tracking and Mapping in Real-time", RA-L 2017.  ``EMVS``: Rebecq, Gallego, Mueggler, Scaramuzza,
"EMVS: Event-based Multi-View Stereo", IJCV 2018.

The print itself was not at hand.  What is marked ``EVO`` was compared with published summaries of the paper
that quote its numbers, and agrees.  ``EMVS, unchecked``: written down from memory, and no source was found
to compare it with.  ``open``: chosen here on the scenes of `scenes`, where the papers leave the step to the
implementer, or where their number does not carry over; theirs then stands behind.  ``released``: a number in
the settings published with EVO (``live.launch``; ``desk.launch`` where it differs) or with EMVS
(``cfg/*.conf``), where they name the same quantity.

The released settings also name steps that the papers' summaries do not, and that are not here: two levels of
an image pyramid, the mean of five poses, and a share of the events beyond 4 million a second.  Their
programs were not used.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Constants:
    """Every number that the method is free to choose.  Lengths in the map are in units of its own scale."""

    # event frames
    events_per_frame: int = 4000  # EVO: about 2000 on 240 x 180 px; here the same density (released: 5000)
    events_per_step: int = 4000  # open: new events a pose (EVO: a sliding window; released: 15 000)
    count_limit: int = 2  # open: events of one pixel that count (EVO: a binary image)
    frame_blur_px: float = 1.0  # open

    # space sweep
    planes: int = 100  # released, EVO and EMVS (EVO's paper: 50)
    packet_events: int = 256  # EMVS, unchecked: events that share a camera pose
    nearest_plane: float = 0.35  # open: of the mean depth (released: 0.4 m); planes are uniform in
    farthest_plane: float = 4.0  # open: of the mean depth (released: 5 m); inverse depth (EVO)
    threshold_window_px: int = 5  # released: of the adaptive Gaussian threshold (EMVS)
    threshold_offset: float = 6.0  # EMVS, unchecked: C = -6, of 8 bits (released: 7; desk 10)
    peak_share: float = 0.5  # open, and not in the papers: see `mapping.extract`
    median_window_px: int = 15  # released: of the semi-dense depth map's median filter (EVO)
    cleaning_radius_px: int = 5  # EVO removes isolated points by a radius; open: the numbers
    cleaning_neighbours: int = 6  # open (released: 2 within 0.2 units of length; desk 3)
    cleaning_depth_ratio: float = 0.08  # open: relative difference of depth that still is a neighbour
    map_neighbours: int = 12  # open; released: the kept map has a second filter, 2 within 0.05 units
    map_depth_ratio: float = 0.025  # open
    map_events: int = 300_000  # open: the most events of one map (EVO: two million; released: one)
    map_packets: int = 20  # open: the fewest packets of a map
    map_points: int = 400  # open: the fewest points of a map that is used
    map_retry_frames: int = 10  # open: frames until a map is tried again that had too few points
    map_frames: int = 0  # open: frames tracked on until a map is due (EVO goes on); 5 and 25 lost rooms
    map_baseline: float = 0.20  # open: of the mean depth; events seen from farther away are not used

    # tracking
    reference_blur_px: float = 1.5  # open: of the projected map (EVO: 0.8; released: 3)
    reference_brightness: float = 0.05  # open: of the blurred map's pixels that are aligned, at least
    reference_points: int = 3000  # open: pixels that are aligned, at most (EVO: batches of 300 to 500)
    reference_fewest: int = 50  # open: pixels without which nothing is aligned
    reference_shift_px: float = 8.0  # open: mean motion after which the map is projected anew
    iterations: int = 15  # open (EVO: 5 times through all batches; released: 150 batches)
    smallest_step: float = 1e-4  # open: of pose increments (rad, and mean depths)
    damping: float = 1e-3  # open: of the normal equations' diagonal

    # keyframes and bootstrapping
    keyframe_distance: float = 0.15  # EVO: of the mean depth (released: 10 %)
    keyframe_overlap: float = 0.60  # open: share of the map within the image (released: 0.9)
    overlap_distance: float = 0.0375  # open: of the mean depth, before a map for lack of overlap
    local_keyframes: int = 2  # open: keyframes whose points make the map
    bootstrap_distance: float = 0.06  # open: of the plane's depth, before the first space sweep
    bootstrap_rounds: int = 14  # open: times that the first stretch is mapped and tracked again
    bootstrap_maps: int = 3  # open: maps until poses count as tracked
    bootstrap_events: int = 8000  # open: events of the first, planar map (released: 10 000)
    bootstrap_brightness: float = 0.5  # open: of the first frame's pixels that are mapped, at least
    bootstrap_plane: str = "fronto-parallel"  # EVO has both: this and "homography"
    homography_blur_px: float = 2.5  # open
    homography_iterations: int = 75  # released
    homography_tolerance: float = 1e-4  # released
    homography_correlation: float = 0.4  # open: below which two frames' alignment has failed
    homography_shift_px: float = 15.0  # open: mean motion of points after which the plane is read off
    homography_frames: int = 60  # open: at most, until they have moved that far
    lost_similarity: float = 0.25  # open: cosine of map and event frame below which a frame is lost
    lost_frames: int = 20  # open: lost frames in a row that end a track
    restart_s: float = 5.0  # open, EVO has no restart: time from one start to the next, after a loss
