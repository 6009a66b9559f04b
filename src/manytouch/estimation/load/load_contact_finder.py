"""Contacts at the peaks of a load, followed from frame to frame."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.estimation.contact_finder import MarkerMotion
from manytouch.estimation.contact_tracker import ContactTracker, ContactTrackerState, nowhere
from manytouch.estimation.frame_interval import interval_s, remaining
from manytouch.estimation.load.displacement_load import DisplacementLoad
from manytouch.estimation.load.load_estimator import LoadEstimate, LoadEstimator
from manytouch.estimation.load.load_map import LoadMap
from manytouch.estimation.load.load_peaks import LoadPeakFinder, LoadPeaks, chosen_peaks
from manytouch.estimation.local_motion import LocalMotion, MarkerGroups, TouchMemory, marker_groups
from manytouch.geometry.camera import into_image, is_in_image, onto_plane, project
from manytouch.geometry.refraction import rest_px
from manytouch.geometry.sampling import GridSampling, sampling_on
from manytouch.values import ESTIMATES, Camera, Contact, Contacts, Phase, Sensor, Sheet, Status, TrackedGrid
from manytouch.values.arrays import Mask, Points2, Scalars, read_only

_DEPTH = ESTIMATES.index("depth")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadContactState:
    """What a `LoadContactFinder` keeps between frames.

    Attributes:
        camera: of the sensor.
        sampling: from markers to the points of the load map.
        bounds_mm: (2, 2) lowest and highest x and y of a contact, by the map and the outline of the sheet.
        centre_std_mm: standard deviation of centres, along each axis, that is added for the assumptions.
        load: state of the `LoadEstimator`.
        rest_mm: (m, 2) mean displacement of the untouched sheet from the layout (creep).
        rest_frames: frames at rest so far.
        recent_load: strongest load of the frames before, fading.
        tracks: of the contacts.
        groups: of neighbouring markers; None where the load alone decides.
        touch: local motions of the frames before.
        timestamp_ns: time of the last frame; None: not known, or there was none.
    """

    camera: Camera
    sampling: GridSampling
    bounds_mm: Float64[np.ndarray, "2 2"]
    centre_std_mm: float
    load: Any
    rest_mm: Points2
    rest_frames: int
    recent_load: float
    tracks: ContactTrackerState
    groups: MarkerGroups | None = None
    touch: TouchMemory = field(default_factory=TouchMemory)
    timestamp_ns: int | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Evidence:
    """What the local motion of a frame shows in addition to the peaks of its load.

    Attributes:
        has_moved: of points (k, 2), whether markers near them have moved as under a touch.
        may_drift: whether the frame may change the rest: not if it shows a touch, or nearly.
    """

    has_moved: Callable[[Points2], Mask] = nowhere
    may_drift: bool = True


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadContactFinder:
    """Finds contacts at the peaks of a load and follows them: a `ContactFinder`.

    Attributes:
        load: source of the load.
        peaks: which peaks of the load are contacts.
        tracker: assigns contacts to those of the previous frame.
        drift_s: time constant with which `rest_mm` follows the displacements in frames without contacts.
        assumed_centre_std_pitch: standard deviation of a centre along each axis added because view
            or sheet are assumed, in pitches.
        most_depth_std_pitch: largest standard deviation of a depth that is not two of them away from zero, in
            pitches: a touch of unknown depth reaches about one. None: any.
        local_motion: decides whether the sheet is touched at all; None: the load alone decides.
    """

    load: LoadEstimator = field(default_factory=DisplacementLoad)
    peaks: LoadPeakFinder = field(default_factory=LoadPeakFinder)
    tracker: ContactTracker = field(default_factory=ContactTracker)
    drift_s: float = 3.3
    assumed_centre_std_pitch: float = 0.0
    most_depth_std_pitch: float | None = None
    local_motion: LocalMotion | None = None

    def start(self, sensor: Sensor) -> LoadContactState:
        """Everything that depends on the sensor only.

        Raises:
            SensorError: the sensor has no layout.
        """
        tracks = self.tracker.start(sensor)
        layout, camera = sensor.layout, sensor.camera
        assert layout is not None  # the tracker has raised otherwise
        at_rest_px = rest_px(sensor, layout)
        plane_mm = onto_plane(camera, at_rest_px)[:, :2]
        load = self.load.start(sensor, plane_mm)
        load_map = self.load.load_map(load)
        return LoadContactState(
            camera=camera,
            sampling=sampling_on(layout, load_map.x_mm, load_map.y_mm),
            bounds_mm=_bounds(load_map, sensor.sheet),
            centre_std_mm=self.assumed_centre_std_pitch * load_map.pitch_mm,
            load=load,
            rest_mm=read_only(np.zeros_like(plane_mm)),
            rest_frames=0,
            recent_load=0.0,
            tracks=tracks,
            groups=None if self.local_motion is None else marker_groups(plane_mm, load_map.pitch_mm),
        )

    def step(
        self, state: LoadContactState, grid: TrackedGrid, motion: MarkerMotion | None
    ) -> tuple[LoadContactState, Contacts]:
        """Contacts of the next frame; `motion` is None where too few markers are seen."""
        if motion is None:
            status = Status.FEW_MARKERS if grid.status is Status.OK else grid.status
            tracks, contacts = self.tracker.step(state.tracks, (), status=status)
            return replace(state, tracks=tracks), contacts
        if state.rest_frames == 0:
            state = replace(state, load=self.load.update_rest(state.load, grid, 0))
        displacement_mm = motion.displacement_mm - state.rest_mm
        load = self.load.estimate_load(state.load, grid, displacement_mm, motion.std_mm)
        elapsed_s = interval_s(state.timestamp_ns, grid.timestamp_ns)
        state = replace(state, timestamp_ns=grid.timestamp_ns)
        state, peaks, evidence = self._peaks(
            state, grid, load, displacement_mm, motion.std_mm, elapsed_s=elapsed_s
        )
        if len(peaks.load):
            centre_mm = self.load.refine(state.load, load, peaks.centre_mm)
            peaks = replace(peaks, centre_mm=_within(state.camera, state.bounds_mm, centre_mm))
        # Where the strongest place jumps, the contact lasts until the new place is confirmed.
        has_moved = evidence.has_moved if _has_jumped(state.tracks, peaks) else nowhere

        def is_loaded(contact: Contact) -> bool:
            point_mm = contact.centre_mm[None]
            return bool(load.at(point_mm)[0] > peaks.floor or has_moved(point_mm)[0])

        tracks, contacts = self.tracker.step(
            state.tracks,
            self._contacts(state, peaks, motion),
            may_start=peaks.may_start.tolist(),
            is_loaded=is_loaded,
            status=grid.status,
        )
        recent_load = self.peaks.fade(peaks, state.recent_load, elapsed_s=elapsed_s)
        state = replace(state, tracks=tracks, recent_load=recent_load)
        if evidence.may_drift and grid.status is Status.OK and not tracks.tracks and len(peaks.load) == 0:
            state = replace(
                state,
                rest_mm=read_only(
                    state.rest_mm + (1.0 - remaining(elapsed_s, self.drift_s)) * displacement_mm
                ),
                load=self.load.update_rest(state.load, grid, state.rest_frames),
                rest_frames=state.rest_frames + 1,
            )
        return state, contacts

    def is_touched(self, state: LoadContactState) -> bool:
        """Whether a contact was found in the last frame, or one that is not confirmed yet."""
        return bool(state.tracks.tracks)

    def _peaks(
        self,
        state: LoadContactState,
        grid: TrackedGrid,
        load: LoadEstimate,
        displacement_mm: Points2,
        std_mm: float,
        *,
        elapsed_s: float,
    ) -> tuple[LoadContactState, LoadPeaks, _Evidence]:
        """The peaks that are contacts, and the state that remembers the local motion of the frame."""
        motion, groups = self.local_motion, state.groups
        if motion is None or groups is None:
            return state, self.peaks(load, state.recent_load), _Evidence()
        local = motion(groups, displacement_mm, grid.is_seen, std_mm * _relative_std(grid))
        was_touched = bool(state.tracks.touching)
        least, touch = motion.limits(state.touch, std_mm / groups.pitch_mm, was_touched=was_touched)
        largest = float(local.max())
        if grid.status is Status.OK:
            state = replace(state, touch=motion.remember(state.touch, largest, elapsed_s=elapsed_s))
        if largest <= least:
            return state, self.peaks.none(load), _Evidence(may_drift=largest <= 0.5 * least)
        if largest <= touch:
            return state, self.peaks(load, state.recent_load), _Evidence()
        evidence = _Evidence(
            has_moved=lambda point_mm: groups.near(local, point_mm, motion.contact_reach) > touch,
            may_drift=False,
        )
        peaks = self.peaks(load, state.recent_load, is_touched=True)
        near = groups.near(local, peaks.centre_mm, motion.contact_reach)
        is_contact = near > np.where(np.arange(len(near)) == 0, least, touch)
        if is_contact.any():
            return state, chosen_peaks(peaks, is_contact), evidence
        at_mm = np.stack(np.meshgrid(load.load_map.x_mm, load.load_map.y_mm), axis=-1)
        moved = groups.at(np.where(local > touch, local, 0.0), at_mm)
        return state, self.peaks(load, state.recent_load, is_touched=True, moved=moved), evidence

    def _contacts(self, state: LoadContactState, peaks: LoadPeaks, motion: MarkerMotion) -> list[Contact]:
        """Contacts without identity; the depth is the largest one of the surface within the region.

        It is NaN where the whole region is not below its rest, since an object cannot lift the sheet: the
        load is the evidence of the contact, and the surface does not resolve its depth. It is also NaN where
        its deviation exceeds half of it and `most_depth_std_pitch`.
        """
        if len(peaks.load) == 0:
            return []
        from manytouch.estimation.load.peak_kernels import deepest_points

        surface, sampling, count = motion.surface, state.sampling, len(peaks.load)
        depth_map_mm = sampling(-surface.displacement_mm[:, 2])
        deepest = deepest_points(depth_map_mm, peaks.region, count)
        depth_mm = depth_map_mm[deepest[:, 0], deepest[:, 1]]
        place = np.concatenate([deepest, _nearest_place(sampling, peaks.centre_mm)])
        each = np.empty((3, len(motion.displacement_mm)))
        each[:2] = motion.displacement_mm.T
        np.sqrt(surface.covariance_mm2[:, 2, 2], out=each[2])
        found = sampling.at(each, place)
        depth_std, shift_mm = found[2, :count], found[:2, count:].T
        now_mm = np.zeros((count, 3))
        now_mm[:, :2] = peaks.centre_mm + np.where(np.isfinite(shift_mm), shift_mm, 0.0)
        centre_px = into_image(state.camera, project(state.camera, now_mm))
        most_mm = (self.most_depth_std_pitch or np.inf) * self.load.load_map(state.load).pitch_mm
        is_unknown = (depth_std > most_mm) & (np.abs(depth_mm) < 2.0 * depth_std)
        is_unknown |= depth_mm <= 0.0
        depth_mm, depth_std = (np.where(is_unknown, np.nan, one) for one in (depth_mm, depth_std))
        contacts = []
        for peak in range(len(peaks.load)):
            covariance = np.full((len(ESTIMATES), len(ESTIMATES)), np.nan)
            covariance[:2, :2] = peaks.covariance_mm2[peak] + state.centre_std_mm**2 * np.eye(2)
            covariance[_DEPTH, _DEPTH] = depth_std[peak] ** 2
            contacts.append(
                Contact(
                    id=-1,
                    phase=Phase.MOVE,
                    centre_mm=read_only(peaks.centre_mm[peak].copy()),
                    centre_px=read_only(centre_px[peak].copy()),
                    depth_mm=float(depth_mm[peak]),
                    force_N=read_only(np.full(3, np.nan)),
                    torque_Nmm=float("nan"),
                    area_mm2=float(peaks.area_mm2[peak]),
                    covariance=read_only(covariance),
                )
            )
        return contacts


def _bounds(load_map: LoadMap, sheet: Sheet | None) -> Points2:
    """(2, 2) lowest and highest x and y at which a contact can be."""
    axes = load_map.x_mm, load_map.y_mm
    low, high = (np.array([axis[end] for axis in axes]) for end in (0, -1))
    if sheet is not None:
        low, high = np.maximum(low, -0.5 * sheet.size_mm), np.minimum(high, 0.5 * sheet.size_mm)
    return read_only(np.stack([low, high]))


def _within(camera: Camera, bounds_mm: Float64[np.ndarray, "2 2"], centre_mm: Points2) -> Points2:
    """The centres (c, 2), moved to the nearest place within the bounds that the image shows.

    The model of the load extends beyond the outer markers, where nothing is measured.
    """
    within_mm: Points2 = np.minimum(np.maximum(centre_mm, bounds_mm[0]), bounds_mm[1])
    pixel = project(camera, np.column_stack([within_mm, np.zeros(len(within_mm))]))
    is_shown = is_in_image(camera, pixel)
    if is_shown.all():
        return within_mm
    within_mm[~is_shown] = onto_plane(camera, into_image(camera, pixel[~is_shown]))[:, :2]
    return within_mm


def _has_jumped(tracks: ContactTrackerState, peaks: LoadPeaks) -> bool:
    """Whether no peak is near enough to a contact of the last frame to continue it."""
    if not tracks.touching or not len(peaks.load):
        return False
    before_mm = np.array([contact.centre_mm for contact in tracks.touching])
    distance_mm = np.linalg.norm(peaks.centre_mm[:, None] - before_mm, axis=2)
    return bool(distance_mm.min() > tracks.gate_mm)


def _relative_std(grid: TrackedGrid) -> Scalars:
    """(m,) standard deviation of each position over the median of those that are seen; 1 where not seen."""
    std_px = np.sqrt(np.where(grid.is_seen, 0.5 * np.trace(grid.covariance_px2, axis1=1, axis2=2), 0.0))
    middle = float(np.median(std_px[grid.is_seen]))
    return np.asarray(np.where(grid.is_seen & (middle > 0.0), std_px / max(middle, 1e-12), 1.0))


def _nearest_place(sampling: GridSampling, point_mm: Points2) -> Int64[np.ndarray, "n 2"]:
    """(n, 2) row and column of the points of the grid that are nearest to the given ones."""
    axes = sampling.y_mm, sampling.x_mm
    low_mm = np.array([axis[0] for axis in axes])
    step_mm = np.array([axis[1] - axis[0] for axis in axes])
    place = np.rint((point_mm[:, ::-1] - low_mm) / step_mm).astype(np.int64)
    return np.asarray(np.minimum(np.maximum(place, 0), [len(axis) - 1 for axis in axes]))
