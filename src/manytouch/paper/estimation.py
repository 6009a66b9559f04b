"""The paper's depth and surface: perimeters of marker quads, inverse distance weighting, peaks.

Equations 11 to 13, Figures 9 to 11 and Table 2 of Senarath, Fernando and Rajakaruna. It is the reference for
the other methods; how far its depth differs from that of the sheet is derived in docs/paper.md.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.errors import LayoutError, SensorError
from manytouch.estimation.contact_tracker import ContactTracker, ContactTrackerState
from manytouch.geometry.camera import onto_plane, project
from manytouch.geometry.refraction import rest_px
from manytouch.geometry.surface_sampling import SurfaceSampler, sampler_on
from manytouch.paper.aligned_view import optical_centre_mm
from manytouch.paper.quads import (
    Formula,
    MarkerQuads,
    Padding,
    at_markers,
    corner_values,
    marker_quads,
    measure,
    pad_edge,
    quad_depth,
)
from manytouch.paper.surface import disc_footprint, peaks
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
from manytouch.values.arrays import Covariances2, Points2, Scalars, read_only
from manytouch.values.surface import INVERSE_DISTANCE, Interpolation

CONFIRMED_AT_ONCE = ContactTracker(confirm_frames=1)
"""The paper evaluates single frames: a contact needs no confirmation by a second one. Frames that do not show
it are bridged as in the other methods (`ContactTracker.bridge_frames`), which is not in the paper."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperEstimationState:
    """What stays the same between frames, and the contacts so far.

    Attributes:
        camera, layout: of the sensor.
        distance_mm: from the camera to the plane of the markers at rest, d of equation 11.
        quads: markers around each marker.
        rest_px: (m, 2) initial coordinates in the camera's image.
        rest_plane_mm: (m, 2) initial coordinates on the markers' plane.
        plane_from_px: (m, 2, 2) derivative of plane coordinates with respect to pixels.
        initial_mm: (q,) AP of equation 12 of each quad, or what else `formula` measures.
        formula, padding: see `PaperEstimation`.
        x_mm, y_mm: columns and rows of the plane on which contacts are read off the surface.
        plane: evaluates surfaces there, (rows, columns).
        reach: footprint of the search radius on the grid.
        tracks: of the contacts.
    """

    camera: Camera
    layout: Layout
    distance_mm: float
    quads: MarkerQuads
    rest_px: Points2
    rest_plane_mm: Points2
    plane_from_px: Covariances2
    initial_mm: Float64[np.ndarray, " q"]
    formula: Formula
    padding: Padding
    x_mm: Float64[np.ndarray, " columns"]
    y_mm: Float64[np.ndarray, " rows"]
    plane: SurfaceSampler
    reach: np.ndarray
    tracks: ContactTrackerState


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperEstimation:
    """Depth of every marker by equation 11, the surface between them, and its peaks as contacts.

    Attributes:
        formula: what of the markers' quads is compared (`paper.quads.Formula`).
        padding: depth of the markers at the edge (`paper.quads.Padding`).
        interpolation: of the surface; contacts are its peaks on a plane of iterations x iterations points,
            and only the deepest point within the search radius is a contact.
        contact_depth_pitch: a peak of the surface is a contact if it is deeper than this.
        tracker: identities of contacts over frames; not in the paper.
    """

    formula: Formula = "corrected"
    padding: Padding = "repeat"
    interpolation: Interpolation = INVERSE_DISTANCE
    contact_depth_pitch: float = 0.25
    tracker: ContactTracker = CONFIRMED_AT_ONCE

    def start(self, sensor: Sensor) -> PaperEstimationState:
        """Initial perimeters and the weights of the interpolation.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: the layout is not a rectangle of at least 3 x 3 markers.
        """
        layout, camera = sensor.layout, sensor.camera
        if layout is None:
            raise SensorError(
                f"sensor {sensor.name!r} has no [markers]: the depth of the paper needs their rest "
                "positions: run `manytouch calibrate rest` first"
            )
        shape = layout.shape
        if layout.row_column is None or shape is None or min(shape) < 3:
            found = "not a rectangle" if shape is None else f"{shape[0]} x {shape[1]} markers"
            raise LayoutError(
                f"the layout of sensor {sensor.name!r} is {found}, but the paper's perimeters need rows and "
                "columns, 3 x 3 at least: use `--method perimeter`"
            )
        at_rest_px = rest_px(sensor, layout)
        rest_plane_mm = onto_plane(camera, at_rest_px)[:, :2]
        quads = marker_quads(layout.row_column, self.formula, self.padding)
        pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
        low_mm, high_mm = layout.rest_mm[:, :2].min(axis=0), layout.rest_mm[:, :2].max(axis=0)
        x_mm, y_mm = np.linspace(low_mm, high_mm, self.interpolation.iterations).T
        plane = sampler_on(layout, np.ascontiguousarray(x_mm), np.ascontiguousarray(y_mm))
        return PaperEstimationState(
            camera=camera,
            layout=layout,
            distance_mm=-float(optical_centre_mm(camera)[2]),
            quads=quads,
            rest_px=at_rest_px,
            rest_plane_mm=rest_plane_mm,
            plane_from_px=_plane_from_px(camera, at_rest_px),
            initial_mm=measure(corner_values(rest_plane_mm, quads), self.formula)[0],
            formula=self.formula,
            padding=self.padding,
            x_mm=x_mm,
            y_mm=y_mm,
            plane=plane,
            reach=disc_footprint(x_mm, y_mm, self.interpolation.search_radius_pitch * pitch_mm),
            tracks=self.tracker.start(sensor),
        )

    def step(
        self, state: PaperEstimationState, grid: TrackedGrid
    ) -> tuple[PaperEstimationState, Surface, Contacts]:
        """Depth, surface and contacts of one frame.

        Standard deviations contain only the noise of the centres (docs/paper.md), not the error relative to
        the depth of the sheet, which is much larger.
        """
        plane_mm = onto_plane(state.camera, grid.position_px)[:, :2]
        depth_mm, variance_mm2 = perimeter_depth(state, plane_mm, grid.covariance_px2)
        surface = replace(
            _surface(state, plane_mm, depth_mm, grid.covariance_px2, variance_mm2),
            interpolation=self.interpolation,
        )
        plane = state.plane.depth(surface)
        least_mm = self.contact_depth_pitch * float(np.sqrt(np.prod(state.layout.pitch_mm)))
        found = _contacts(state, surface, plane, peaks(plane, least_mm, state.reach))

        def is_loaded(contact: Contact) -> bool:
            x_mm, y_mm = contact.centre_mm
            row, column = np.abs(state.y_mm - y_mm).argmin(), np.abs(state.x_mm - x_mm).argmin()
            return bool(plane[row, column] > least_mm)

        tracks, contacts = self.tracker.step(state.tracks, found, is_loaded=is_loaded, status=surface.status)
        return replace(state, tracks=tracks), surface, contacts


def perimeter_depth(
    state: PaperEstimationState, plane_mm: Points2, covariance_px2: Covariances2
) -> tuple[Scalars, Scalars]:
    """m = d (1 - AP / BP) of equation 11 and its variance, (m,); NaN where it is not known."""
    corner_mm = corner_values(plane_mm, state.quads)
    quad_mm, derivative = quad_depth(state.distance_mm, state.initial_mm, corner_mm, state.formula)
    covariance_mm2 = state.plane_from_px @ covariance_px2 @ state.plane_from_px.transpose(0, 2, 1)
    depth_mm, variance_mm2 = at_markers(state.quads, quad_mm, derivative, covariance_mm2)
    return (
        pad_edge(depth_mm, state.quads, state.padding),
        pad_edge(variance_mm2, state.quads, state.padding),
    )


def _surface(
    state: PaperEstimationState,
    plane_mm: Points2,
    depth_mm: Scalars,
    covariance_px2: Covariances2,
    depth_variance_mm2: Scalars,
) -> Surface:
    """The surface with x and y in the plane at rest and the depth by perimeters."""
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


def _contacts(
    state: PaperEstimationState,
    surface: Surface,
    depth_mm: Float64[np.ndarray, "n n"],
    peak: tuple[Int64[np.ndarray, " c"], Int64[np.ndarray, " c"]],
) -> list[Contact]:
    """Contacts at points of the plane (rows, columns), without identity.

    Their standard deviations are not known: the noise of the centres is small against the error of the
    perimeters, which nobody has modelled.
    """
    if len(peak[0]) == 0:
        return []
    moved_mm = state.plane.displacement(surface)
    found = []
    for row, column in zip(*peak, strict=True):
        centre_mm = np.array([state.x_mm[column], state.y_mm[row]])
        present_mm = np.array([[*(centre_mm + moved_mm[row, column, :2]), 0.0]])
        found.append(
            Contact(
                id=-1,
                phase=Phase.MOVE,
                centre_mm=read_only(centre_mm),
                centre_px=read_only(project(state.camera, present_mm)[0]),
                depth_mm=float(depth_mm[row, column]),
                force_N=read_only(np.full(3, np.nan)),
                torque_Nmm=float("nan"),
                area_mm2=float("nan"),
                covariance=read_only(np.full((len(ESTIMATES), len(ESTIMATES)), np.nan)),
            )
        )
    return found


def _plane_from_px(camera: Camera, pixel: Points2) -> Covariances2:
    step = 0.5 * np.eye(2)
    columns = [onto_plane(camera, pixel + h)[:, :2] - onto_plane(camera, pixel - h)[:, :2] for h in step]
    return np.stack(columns, axis=-1)
