"""The paper's depth and surface: perimeters of marker quads, inverse distance weighting, peaks.

Equations 11 to 13, Figures 9 to 11 and Table 2 of Senarath, Fernando and Rajakaruna. It is the
reference that everything else is compared with; what it really measures, and how far that is from
the depth of the sheet, is derived in docs/paper.md.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from manytouch.errors import LayoutError, SensorError
from manytouch.estimation.contact_tracker import ContactTracker, ContactTrackerState
from manytouch.geometry.camera import cam_from_sheet, onto_plane, project
from manytouch.values import (
    ESTIMATES,
    Camera,
    Contact,
    Contacts,
    Layout,
    Phase,
    Sensor,
    Status,
    Surface,
    TrackedGrid,
)
from manytouch.values.arrays import Counts, Covariances2, Mask, Points2, Scalars, read_only

CORNERS = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]])
"""Steps in row and column from a marker to the corners 1, 2, 3, 4 of its quad in equations 12 and 13."""

SIGNS = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
"""Signs of x and y of the corners 1, 2, 3, 4 in the sum of equations 12 and 13."""

AT_ONCE = ContactTracker(confirm_frames=1)
"""The paper's plot shows one moment: a contact needs no second frame to be one."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerQuads:
    """The quad of markers around each marker.

    Attributes:
        corner: (m, 4) markers at the corners 1 to 4; -1 where the layout has none.
        source: (m,) whose depth a marker takes: its own inside, its neighbour's at the edge (Figure 10).
    """

    corner: Int64[np.ndarray, "m 4"]
    source: Int64[np.ndarray, " m"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InverseDistance:
    """Inverse distance weighting (D. Shepard 1968, doi:10.1145/800186.810616): markers to a plane of points.

    Attributes:
        x_mm, y_mm: (n,) coordinates of the plane's columns and rows.
        weights: (n * n, m) one over the distance to the power; 0 beyond the search radius.
    """

    x_mm: Float64[np.ndarray, " n"]
    y_mm: Float64[np.ndarray, " n"]
    weights: csr_array

    def __call__(self, value: Float64[np.ndarray, " m"]) -> Float64[np.ndarray, "n n"]:
        """Surface (row, column) through the values that are known; NaN where none lies within the radius."""
        is_known = np.isfinite(value)
        total = self.weights @ is_known.astype(np.float64)
        share = self.weights @ np.where(is_known, value, 0.0)
        plane = share / np.where(total > 0.0, total, np.nan)
        return np.asarray(plane.reshape(len(self.y_mm), len(self.x_mm)))

    def at(self, row: int, column: int, is_known: Bool[np.ndarray, " m"]) -> tuple[Counts, Scalars]:
        """The known markers that make a point of the plane, and their weights, which sum to 1."""
        place = row * len(self.x_mm) + column
        part = slice(*self.weights.indptr[place : place + 2])
        marker, weight = self.weights.indices[part].astype(np.int64), self.weights.data[part]
        use = is_known[marker]
        return marker[use], weight[use] / weight[use].sum()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperEstimationState:
    """What stays the same between frames, and which contact is which.

    Attributes:
        camera, layout: of the sensor.
        distance_mm: from the camera to the plane of the markers at rest, d of equation 11.
        quads: which markers bound which.
        rest_px: (m, 2) initial coordinates in the camera's image.
        rest_plane_mm: (m, 2) initial coordinates on the markers' plane.
        plane_from_px: (m, 2, 2) derivative of plane coordinates with respect to pixels.
        initial_perimeter_mm: (m,) AP of equation 12.
        surface: weights of the interpolation.
        reach: footprint of the search radius on the plane's points.
        identity: the contacts so far.
    """

    camera: Camera
    layout: Layout
    distance_mm: float
    quads: MarkerQuads
    rest_px: Points2
    rest_plane_mm: Points2
    plane_from_px: Covariances2
    initial_perimeter_mm: Scalars
    surface: InverseDistance
    reach: np.ndarray
    identity: ContactTrackerState


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperEstimation:
    """Depth of every marker by equation 11, the surface between them, and its peaks as contacts.

    Attributes:
        iterations: points of the interpolated plane along each of its sides ("number of iterations").
        search_radius_pitch: of the interpolation, and within it only the deepest point is a contact.
        power: of the distance in the weights (Table 2: 2).
        contact_depth_pitch: a person sees a contact where the surface is deeper than this.
        identity: tells which contact of this frame is which of the last; not in the paper.
    """

    iterations: int = 100
    search_radius_pitch: float = 1.5
    power: float = 2.0
    contact_depth_pitch: float = 0.25
    identity: ContactTracker = AT_ONCE

    def start(self, sensor: Sensor) -> PaperEstimationState:
        """Initial perimeters and the weights of the interpolation.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: the layout is no rectangle of at least 3 x 3 markers.
        """
        layout, camera = sensor.layout, sensor.camera
        if layout is None:
            raise SensorError(
                f"sensor {sensor.name!r} has no [markers]: the paper's depth needs to know how they lie; "
                "run `manytouch calibrate rest` first"
            )
        shape = layout.shape
        if layout.row_column is None or shape is None or min(shape) < 3:
            found = "no rectangle" if shape is None else f"{shape[0]} x {shape[1]} markers"
            raise LayoutError(
                f"the layout of sensor {sensor.name!r} is {found}, but the paper's perimeters need rows and "
                "columns, 3 x 3 at least: use `--method perimeter`"
            )
        rest_px = project(camera, layout.rest_mm) if layout.rest_px is None else layout.rest_px
        rest_plane_mm = onto_plane(camera, rest_px)[:, :2]
        quads = marker_quads(layout.row_column)
        pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
        surface = inverse_distance(
            layout.rest_mm[:, :2], self.iterations, self.search_radius_pitch * pitch_mm, self.power
        )
        return PaperEstimationState(
            camera=camera,
            layout=layout,
            distance_mm=-float(_eye_mm(camera)[2]),
            quads=quads,
            rest_px=rest_px,
            rest_plane_mm=rest_plane_mm,
            plane_from_px=_plane_from_px(camera, rest_px),
            initial_perimeter_mm=signed_perimeter(_corners(rest_plane_mm, quads)),
            surface=surface,
            reach=_disc(surface, self.search_radius_pitch * pitch_mm),
            identity=self.identity.start(sensor),
        )

    def step(
        self, state: PaperEstimationState, grid: TrackedGrid
    ) -> tuple[PaperEstimationState, Surface, Contacts]:
        """Depth, surface and contacts of one frame.

        Standard deviations carry the noise of the centres only (docs/paper.md): the depth of a marker has
        a repeatability, not the error against the depth of the sheet, which is much larger.
        """
        plane_mm = onto_plane(state.camera, grid.position_px)[:, :2]
        depth_mm, variance_mm2 = perimeter_depth(state, plane_mm, grid.covariance_px2)
        surface = _surface(state, plane_mm, depth_mm, grid.covariance_px2, variance_mm2)
        plane = state.surface(depth_mm)
        least_mm = self.contact_depth_pitch * float(np.sqrt(np.prod(state.layout.pitch_mm)))
        found = [
            _contact(state, (int(row), int(column)), float(plane[row, column]), variance_mm2, grid)
            for row, column in zip(*peaks(plane, least_mm, state.reach), strict=True)
        ]

        def is_loaded(centre_mm: Points2) -> Mask:
            column = np.abs(centre_mm[:, :1] - state.surface.x_mm).argmin(axis=1)
            row = np.abs(centre_mm[:, 1:] - state.surface.y_mm).argmin(axis=1)
            return np.asarray(plane[row, column] > least_mm)

        identity, contacts = self.identity.step(
            state.identity, found, is_loaded=is_loaded, status=surface.status
        )
        return replace(state, identity=identity), surface, contacts


def signed_perimeter(corner: Float64[np.ndarray, "... 4 2"]) -> Float64[np.ndarray, "..."]:
    """Perimeter (...) of quads with corners 1 to 4, as the signed sum of equations 12 and 13.

    (y1 - y4) + (x2 - x1) + (y2 - y3) + (x3 - x4), with the third term mended (printed: y2 - y1). It is
    twice the mean width and height, the perimeter of the quad if its sides are parallel to the axes.
    """
    return np.asarray(np.einsum("...kd,kd->...", corner, SIGNS))


def marker_quads(row_column: Int64[np.ndarray, "m 2"]) -> MarkerQuads:
    """The four diagonal neighbours of each marker, and the padding of the layout's edge."""
    rows, columns = row_column.max(axis=0) + 1
    marker = np.full((rows + 2, columns + 2), -1, dtype=np.int64)
    row, column = row_column.T
    marker[row + 1, column + 1] = np.arange(len(row_column))
    corner = marker[row[:, None] + 1 + CORNERS[:, 0], column[:, None] + 1 + CORNERS[:, 1]]
    source = marker[np.clip(row, 1, rows - 2) + 1, np.clip(column, 1, columns - 2) + 1]
    return MarkerQuads(corner=corner, source=source)


def perimeter_depth(
    state: PaperEstimationState, plane_mm: Points2, covariance_px2: Covariances2
) -> tuple[Scalars, Scalars]:
    """m = d (1 - AP / BP) of equation 11 and its variance, (m,); NaN where a corner is not seen."""
    perimeter_mm = signed_perimeter(_corners(plane_mm, state.quads))
    perimeter_mm = np.where(perimeter_mm > 0.0, perimeter_mm, np.nan)
    ratio = state.initial_perimeter_mm / perimeter_mm
    covariance_mm2 = state.plane_from_px @ covariance_px2 @ state.plane_from_px.transpose(0, 2, 1)
    variance_mm2 = np.einsum("kd,mkde,ke->m", SIGNS, _corners(covariance_mm2, state.quads), SIGNS)
    depth_variance_mm2 = (state.distance_mm * ratio / perimeter_mm) ** 2 * variance_mm2
    return _padded(state.distance_mm * (1.0 - ratio), state.quads), _padded(depth_variance_mm2, state.quads)


def inverse_distance(rest_mm: Points2, iterations: int, radius_mm: float, power: float) -> InverseDistance:
    """Weights from markers at `rest_mm` to iterations x iterations points over their bounding box."""
    low, high = rest_mm.min(axis=0), rest_mm.max(axis=0)
    x_mm = np.linspace(low[0], high[0], iterations)
    y_mm = np.linspace(low[1], high[1], iterations)
    point_mm = np.stack(np.meshgrid(x_mm, y_mm), axis=-1).reshape(-1, 2)
    near = cKDTree(point_mm).sparse_distance_matrix(cKDTree(rest_mm), radius_mm, output_type="ndarray")
    distance = np.maximum(near["v"] / radius_mm, 1e-6)  # a point on a marker takes its value
    weights = csr_array((distance**-power, (near["i"], near["j"])), shape=(len(point_mm), len(rest_mm)))
    return InverseDistance(x_mm=x_mm, y_mm=y_mm, weights=weights)


def peaks(
    depth_mm: Float64[np.ndarray, "rows columns"], least_mm: float, reach: np.ndarray
) -> tuple[Int64[np.ndarray, " c"], Int64[np.ndarray, " c"]]:
    """Rows and columns of the points deeper than `least_mm` that nothing within `reach` exceeds.

    Deepest first; of equal ones within reach the first in reading order.
    """
    height = np.where(np.isfinite(depth_mm), depth_mm, -np.inf)
    highest = cv2.dilate(height, reach, borderType=cv2.BORDER_CONSTANT, borderValue=(-np.inf,) * 4)
    row, column = np.nonzero((height == highest) & (height > least_mm))
    order = np.argsort(-height[row, column], kind="stable")
    row, column = row[order], column[order]
    middle = np.array(reach.shape) // 2
    step = np.stack([row[:, None] - row, column[:, None] - column], axis=-1) + middle
    is_inside = ((step >= 0) & (step < reach.shape)).all(axis=-1)
    step = np.where(is_inside[..., None], step, 0)
    is_near = is_inside & (reach[step[..., 0], step[..., 1]] > 0)
    is_kept = np.zeros(len(row), dtype=np.bool_)
    for place in range(len(row)):
        is_kept[place] = not (is_near[place] & is_kept).any()
    return row[is_kept].astype(np.int64), column[is_kept].astype(np.int64)


def _surface(
    state: PaperEstimationState,
    plane_mm: Points2,
    depth_mm: Scalars,
    covariance_px2: Covariances2,
    depth_variance_mm2: Scalars,
) -> Surface:
    """x and y as the fixed scale of the plane at rest gives them, depth by the perimeters."""
    displacement_mm = np.column_stack([plane_mm - state.rest_plane_mm, -depth_mm])
    covariance_mm2 = np.zeros((len(depth_mm), 3, 3))
    covariance_mm2[:, :2, :2] = state.plane_from_px @ covariance_px2 @ state.plane_from_px.transpose(0, 2, 1)
    covariance_mm2[:, 2, 2] = depth_variance_mm2
    return Surface(
        position_mm=read_only(state.layout.rest_mm + displacement_mm),
        displacement_mm=read_only(displacement_mm),
        covariance_mm2=read_only(covariance_mm2),
        layout=state.layout,
        status=Status.OK if np.isfinite(depth_mm).any() else Status.FEW_MARKERS,
    )


def _contact(
    state: PaperEstimationState,
    point: tuple[int, int],
    depth_mm: float,
    depth_variance_mm2: Scalars,
    grid: TrackedGrid,
) -> Contact:
    """What the surface tells of a contact at one of its points; the identity is given later.

    A peak of inverse distance weighting sits on a marker, so its place is known to a pitch: the
    deviation of a uniform distribution, pitch / sqrt(12).
    """
    row, column = point
    centre_mm = np.array([state.surface.x_mm[column], state.surface.y_mm[row]])
    marker, weight = state.surface.at(row, column, np.isfinite(depth_variance_mm2))
    covariance = np.full((len(ESTIMATES), len(ESTIMATES)), np.nan)
    place = [ESTIMATES.index(name) for name in ("x", "y", "depth")]
    variance_mm2 = [*state.layout.pitch_mm**2 / 12.0, weight**2 @ depth_variance_mm2[marker]]
    covariance[np.ix_(place, place)] = np.diag(variance_mm2)
    marker, weight = state.surface.at(row, column, grid.is_seen)
    shift_px = weight @ (grid.position_px - state.rest_px)[marker] if len(marker) else np.full(2, np.nan)
    return Contact(
        id=-1,
        phase=Phase.MOVE,
        centre_mm=read_only(centre_mm),
        centre_px=read_only(project(state.camera, np.array([[*centre_mm, 0.0]]))[0] + shift_px),
        depth_mm=depth_mm,
        force_N=read_only(np.full(3, np.nan)),
        torque_Nmm=float("nan"),
        area_mm2=float("nan"),
        covariance=read_only(covariance),
    )


def _corners(value: np.ndarray, quads: MarkerQuads) -> np.ndarray:
    """Values (m, 4, ...) at the corners of each marker's quad; NaN where there is none."""
    missing = np.full((1, *value.shape[1:]), np.nan)
    return np.asarray(np.concatenate([value, missing])[quads.corner])


def _padded(value: Scalars, quads: MarkerQuads) -> Scalars:
    """A template that is larger than the frame: the edge takes the value of its inner neighbour."""
    return np.where(quads.source >= 0, value[quads.source], np.nan)


def _plane_from_px(camera: Camera, pixel: Points2) -> Covariances2:
    step = 0.5 * np.eye(2)
    columns = [onto_plane(camera, pixel + h)[:, :2] - onto_plane(camera, pixel - h)[:, :2] for h in step]
    return np.stack(columns, axis=-1)


def _disc(surface: InverseDistance, radius_mm: float) -> np.ndarray:
    """Points of the plane within a radius of the middle one, as a footprint of 0 and 1."""
    step_mm = np.array([np.diff(surface.y_mm[:2])[0], np.diff(surface.x_mm[:2])[0]])
    reach = np.maximum(np.floor(radius_mm / step_mm).astype(int), 1)
    row, column = np.mgrid[-reach[0] : reach[0] + 1, -reach[1] : reach[1] + 1]
    inside = (row * step_mm[0]) ** 2 + (column * step_mm[1]) ** 2 <= radius_mm**2
    inside[reach[0], reach[1]] = True
    return np.asarray(inside.astype(np.uint8))


def _eye_mm(camera: Camera) -> np.ndarray:
    """(3,) the camera's optical centre in the sheet frame."""
    rotation, translation = cam_from_sheet(camera)
    return np.asarray(-rotation.T @ translation)
