"""The marker tracking of the paper: sorted numbers in the first frame, then a distance gate.

Section 3.3 and Figure 7 e to h of Senarath, Fernando and Rajakaruna. The interpretation is in docs/paper.md.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from manytouch.errors import SensorError
from manytouch.geometry.camera import onto_plane, project
from manytouch.values import Camera, Detections, Sensor, Status, TrackedGrid
from manytouch.values.arrays import Counts, Points2, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperTrackingState:
    """The list of markers between frames.

    Attributes:
        camera: to sort in the undistorted, aligned image, as the paper does.
        order: (k,) markers of the layout that are not missing, in sorted order.
        markers: m, number of markers of the layout, including missing ones.
        row_gap_mm: markers whose y differ by less belong to one row.
        gate_px: a marker that moves further between two frames gets a new ID.
        position_px: (t, 2) last coordinates of each entry of the list; empty until all markers were seen.
        id: (t,) ID of each entry; below m it is the layout's marker, from m on a new ID.
        frames_unseen: (m,) frames since each marker was last seen.
        new_ids: number of new IDs so far.
    """

    camera: Camera
    order: Int64[np.ndarray, " k"]
    markers: int
    row_gap_mm: float
    gate_px: float
    position_px: Float64[np.ndarray, "t 2"]
    id: Int64[np.ndarray, " t"]
    frames_unseen: Int64[np.ndarray, " m"]
    new_ids: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperTracking:
    """Identifies midpoints with markers, by sorting once and by distance afterwards.

    Attributes:
        gate_px: largest distance that a marker moves between two frames ("trial and error" in the paper);
            None: `gate_pitch` times the distance between neighbours in the image.
        gate_pitch: see `gate_px`; at 0.5 or more a marker can be mistaken for its neighbour even at rest.
        row_gap_pitch: largest difference of y within a row when sorting, in row pitches.
    """

    gate_px: float | None = None
    gate_pitch: float = 0.4
    row_gap_pitch: float = 0.4

    def start(self, sensor: Sensor) -> PaperTrackingState:
        """The sorted order of the layout's markers.

        Raises:
            SensorError: the sensor has no layout.
        """
        if sensor.layout is None:
            raise SensorError(
                f"sensor {sensor.name!r} has no [markers]: the tracking of the paper needs their number: "
                "run `manytouch calibrate rest` first"
            )
        camera, layout = sensor.camera, sensor.layout
        row_gap_mm = self.row_gap_pitch * float(layout.pitch_mm[1])
        present = np.flatnonzero(~layout.is_missing)
        order = present[sorted_by_rows(layout.rest_mm[present, :2], row_gap_mm)]
        gate_px = self.gate_px
        if gate_px is None:
            gate_px = self.gate_pitch * _neighbour_px(project(camera, layout.rest_mm[present]))
        return PaperTrackingState(
            camera=camera,
            order=order.astype(np.int64),
            markers=len(layout.rest_mm),
            row_gap_mm=row_gap_mm,
            gate_px=gate_px,
            position_px=np.zeros((0, 2)),
            id=np.zeros(0, dtype=np.int64),
            frames_unseen=np.zeros(len(layout.rest_mm), dtype=np.int64),
            new_ids=0,
        )

    def step(
        self, state: PaperTrackingState, detections: Detections
    ) -> tuple[PaperTrackingState, TrackedGrid]:
        """IDs of one frame's midpoints.

        No marker is identified until a frame shows exactly as many midpoints as the layout has markers (the
        check of the list's length in the paper): no marker is seen and the status is few_markers or
        many_markers. Afterwards the status is few_markers while any marker is not seen.
        """
        if len(state.id) == 0:
            id_of, position_px, id_in_list, new = _assign_initial_ids(state, detections.centre_px)
        else:
            id_of, position_px, id_in_list, new = _assign_by_distance(state, detections.centre_px)
        is_marker = (id_of >= 0) & (id_of < state.markers)
        marker = id_of[is_marker]
        grid_px = np.full((state.markers, 2), np.nan)
        covariance_px2 = np.full((state.markers, 2, 2), np.nan)
        grid_px[marker] = detections.centre_px[is_marker]
        covariance_px2[marker] = detections.covariance_px2[is_marker]
        is_seen = np.zeros(state.markers, dtype=np.bool_)
        is_seen[marker] = True
        frames_unseen = np.where(is_seen, 0, state.frames_unseen + 1)
        was_seen = (state.frames_unseen == 0) & (len(state.id) > 0)
        was_seen &= np.isin(np.arange(state.markers), state.order)
        status = detections.status
        if status is Status.OK and len(marker) < len(state.order):
            has_more = len(id_in_list) == 0 and len(id_of) > len(state.order)
            status = Status.MANY_MARKERS if has_more else Status.FEW_MARKERS
        after = PaperTrackingState(
            camera=state.camera,
            order=state.order,
            markers=state.markers,
            row_gap_mm=state.row_gap_mm,
            gate_px=state.gate_px,
            position_px=position_px,
            id=id_in_list,
            frames_unseen=read_only(frames_unseen),
            new_ids=state.new_ids + new,
        )
        return after, TrackedGrid(
            position_px=read_only(grid_px),
            covariance_px2=read_only(covariance_px2),
            is_seen=read_only(is_seen),
            frames_unseen=after.frames_unseen,
            lost_ids=int(np.count_nonzero(was_seen & ~is_seen)),
            new_ids=new,
            status=status,
        )

    def expected_px(self, state: PaperTrackingState) -> Points2 | None:
        """None: the paper searches the whole area of interest in every frame."""
        return None

    def needs_full_search(self, state: PaperTrackingState) -> bool:
        """False: the paper does not search a frame again."""
        return False

    def resume(self, started: PaperTrackingState, before: PaperTrackingState) -> PaperTrackingState:
        """The present parameters, with the list of markers so far."""
        return replace(
            started,
            position_px=before.position_px,
            id=before.id,
            frames_unseen=before.frames_unseen,
            new_ids=before.new_ids,
        )


def sorted_by_rows(point: Points2, row_gap: float) -> Counts:
    """Order of points (n, 2) by rows from small y to large y and by x within a row.

    A row ends where the next larger y lies more than `row_gap` above. (The paper compares pairs of points
    with a tolerance instead, which is not an order: a ~ b and b ~ c do not imply a ~ c.)
    """
    by_y = np.argsort(point[:, 1], kind="stable")
    row = np.empty(len(point), dtype=np.int64)
    row[by_y] = np.cumsum(np.diff(point[by_y, 1], prepend=point[by_y[:1], 1]) > row_gap)
    return np.lexsort((point[:, 0], row)).astype(np.int64)


Matched = tuple[Counts, Float64[np.ndarray, "t 2"], Int64[np.ndarray, " t"], int]
"""ID of each detection (-1: none), the list's coordinates and IDs after the frame, new IDs given."""


def _assign_initial_ids(state: PaperTrackingState, centre_px: Points2) -> Matched:
    """First IDs: the k-th sorted midpoint is the k-th sorted marker of the layout."""
    id_of = np.full(len(centre_px), -1, dtype=np.int64)
    if len(centre_px) != len(state.order):
        return id_of, state.position_px, state.id, 0
    aligned_mm = onto_plane(state.camera, centre_px)[:, :2]
    id_of[sorted_by_rows(aligned_mm, state.row_gap_mm)] = state.order
    return id_of, centre_px, id_of, 0


def _assign_by_distance(state: PaperTrackingState, centre_px: Points2) -> Matched:
    """The nearest entry of the list within the gate gives its ID to its nearest midpoint.

    An entry of the layout without a midpoint keeps its last coordinates; a new ID without one is removed.
    """
    id_of = np.full(len(centre_px), -1, dtype=np.int64)
    distance_px, entry = cKDTree(state.position_px).query(centre_px, distance_upper_bound=state.gate_px)
    near = np.flatnonzero(np.isfinite(distance_px))
    near = near[np.lexsort((distance_px[near], entry[near]))]
    _, first = np.unique(entry[near], return_index=True)
    nearest = near[first]
    id_of[nearest] = state.id[entry[nearest]]
    unmatched = np.flatnonzero(id_of < 0)
    id_of[unmatched] = state.markers + state.new_ids + np.arange(len(unmatched))
    is_kept = state.id < state.markers
    is_kept[entry[nearest]] = False
    position_px = np.concatenate([centre_px, state.position_px[is_kept]])
    return id_of, position_px, np.concatenate([id_of, state.id[is_kept]]), len(unmatched)


def _neighbour_px(point_px: Points2) -> float:
    """Median distance of nearest neighbours; infinite where there is only one point."""
    if len(point_px) < 2:
        return float("inf")
    return float(np.median(cKDTree(point_px).query(point_px, k=2)[0][:, 1]))
