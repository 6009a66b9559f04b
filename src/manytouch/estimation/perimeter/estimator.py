"""The method `perimeter`: the paper's depth on tracked markers, contacts from how the sheet is loaded.

What its deviations say: `depth_std` is the noise of the centres propagated through the perimeters, and in
addition how far the law itself is off. For a purely vertical motion w the law reads w + (R . grad w)/2, R
from the optical axis, and every stretch e of the sheet reads as d e. The first part is taken from the
slope of the depth that was found, the second from its curvature, since bending stretches the
camera-side face by half the thickness times the curvature. The map holds the error that it is taken from, so
no more than what it shows is called error. On simulated presses about half of the
markers lie within one such deviation, and five of six within two.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from manytouch.errors import LayoutError, SensorError
from manytouch.estimation.contact_tracker import ContactTracker, ContactTrackerState
from manytouch.estimation.perimeter.contacts import ContactFinder, LoadPeaks
from manytouch.estimation.perimeter.interpolation import FillUnseen
from manytouch.estimation.perimeter.law import PerimeterLaw, perimeter_law
from manytouch.estimation.perimeter.load_map import LoadMap
from manytouch.estimation.perimeter.load_model import LoadModel, assumes_view
from manytouch.estimation.perimeter.view_motion import MotionHypotheses, RigidMotionEstimator
from manytouch.estimation.uncalibrated.dot_area import DotGrowth
from manytouch.estimation.uncalibrated.spacing import Spacing, spacing
from manytouch.estimation.uncalibrated.swelling import SwellingMap, SwellingModel
from manytouch.geometry.camera import cam_from_sheet, onto_plane, project
from manytouch.geometry.neighbours import Neighbours, lattice_cells, nearest_neighbours, triangle_cells
from manytouch.geometry.plane_table import PlaneTable, plane_from_px, plane_table
from manytouch.geometry.sampling import GridSampling, sampling_on
from manytouch.values import (
    ESTIMATES,
    Camera,
    Contact,
    Contacts,
    Layout,
    Phase,
    Sensor,
    Surface,
    TrackedGrid,
)
from manytouch.values.arrays import Covariances2, Points2, Scalars, read_only

_LEAST_MARKERS = 4
_DEPTH = ESTIMATES.index("depth")
_SPILL = 4.0  # what a deep press does to the depth around it, in mean squares of the map
_FEIGNED = 1.5  # as if the errors of a neighbourhood conspired, since cells share their markers


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PerimeterState:
    """What stays the same between frames, and what is remembered.

    Attributes:
        camera, layout: of the sensor.
        law: the paper's depth.
        neighbours: of each marker.
        chart: from displacements to the load.
        pads: where pads are likely, when view or sheet were assumed; else None.
        spacing: from displacements to the changes of spacings.
        sampling: from markers to the points of the charts.
        plane: from pixels to the plane of the sheet.
        plane_from_px: (m, 2, 2) its derivative at the markers.
        around: (k, m) neighbours, and what their depths add to the two errors of the law.
        judges: of the motion of the view.
        pitch_mm: geometric mean pitch.
        scale_std, centre_std_mm: relative deviation of depths, and deviation of centres, for what had to be
            assumed.
        settled_mm: (m, 2) where the untouched sheet has crept to, from its rest.
        rest_area: (m,) logarithm of the areas of the dots at rest, NaN where not known.
        rest_frames: frames at rest so far.
        recent_load: strongest load of the frames before, fading.
        lives: contacts that last.
    """

    camera: Camera
    layout: Layout
    law: PerimeterLaw
    neighbours: Neighbours
    chart: LoadMap
    pads: SwellingMap | None
    spacing: Spacing
    sampling: GridSampling
    plane: PlaneTable
    plane_from_px: Covariances2
    around: tuple[np.ndarray, np.ndarray, np.ndarray]
    judges: MotionHypotheses
    pitch_mm: float
    scale_std: float
    centre_std_mm: float
    settled_mm: Points2
    rest_area: Scalars
    rest_frames: int
    recent_load: float
    lives: ContactTrackerState


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PerimeterEstimator:
    """Depth by equation 11 of the paper, motion of the view taken off, and contacts that last.

    Attributes:
        view: finds the motion of the view.
        fill: fills in markers that are not seen.
        grow: how much the dots have grown.
        model: of sheet, fingers and view.
        pad_model: of fingers where view or sheet were assumed.
        find: contacts of a frame.
        find_pads: the same where view or sheet were assumed.
        identity: which contact is which of the frame before.
        settle: part of what remains while nothing touches that is taken for rest, per frame; a sheet creeps.
        assumed_scale_std: relative deviation of the depth when the field of view was assumed.
        assumed_centre_std_pitch: deviation of a contact's centre, along each axis, when view or sheet were.
    """

    view: RigidMotionEstimator = field(default_factory=RigidMotionEstimator)
    fill: FillUnseen = field(default_factory=FillUnseen)
    grow: DotGrowth = field(default_factory=DotGrowth)
    model: LoadModel = field(default_factory=LoadModel)
    pad_model: SwellingModel = field(default_factory=SwellingModel)
    find: ContactFinder = field(default_factory=ContactFinder)
    find_pads: ContactFinder = field(
        default_factory=lambda: ContactFinder(
            start_load=0.0125, stay_load=0.01, start_share=0.4, stay_share=0.35
        )
    )
    identity: ContactTracker = field(default_factory=ContactTracker)
    settle: float = 0.01
    assumed_scale_std: float = 0.35
    assumed_centre_std_pitch: float = 0.5

    def start(self, sensor: Sensor) -> PerimeterState:
        """Works out everything that only the sensor decides.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: it has fewer than four markers.
        """
        layout, camera = sensor.layout, sensor.camera
        if layout is None:
            raise SensorError(
                f"sensor {sensor.name!r} has no [markers]: depth needs to know how they lie; "
                "run `manytouch calibrate rest` first"
            )
        if len(layout.rest_mm) < _LEAST_MARKERS:
            raise LayoutError(
                f"the layout of sensor {sensor.name!r} has {len(layout.rest_mm)} markers, but depth needs at "
                f"least {_LEAST_MARKERS}: give a region with more of them"
            )
        rest_px = project(camera, layout.rest_mm) if layout.rest_px is None else layout.rest_px
        plane_mm = onto_plane(camera, rest_px)[:, :2]
        rotation, translation = cam_from_sheet(camera)
        eye_mm = -translation @ rotation
        cells = triangle_cells(plane_mm) if layout.row_column is None else lattice_cells(layout.row_column)
        chart = self.model(sensor, plane_mm)
        pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
        is_assumed = assumes_view(sensor)
        has_pads = is_assumed or sensor.sheet is None or sensor.sheet.is_assumed
        law = perimeter_law(cells, plane_mm, eye_mm[:2], -float(eye_mm[2]))
        neighbours = nearest_neighbours(plane_mm)
        lever_mm = 0.5 * (pitch_mm if sensor.sheet is None else sensor.sheet.thickness_mm)
        return PerimeterState(
            camera=camera,
            layout=layout,
            law=law,
            neighbours=neighbours,
            chart=chart,
            pads=self.pad_model(layout, plane_mm, self.model.points_per_pitch) if has_pads else None,
            spacing=spacing(plane_mm, eye_mm[:2], neighbours),
            sampling=sampling_on(layout, chart.x_mm, chart.y_mm),
            plane=plane_table(camera),
            plane_from_px=read_only(plane_from_px(camera, rest_px)),
            around=_error_weights(law, neighbours, lever_mm),
            judges=self.view.judges(plane_mm),
            pitch_mm=pitch_mm,
            scale_std=self.assumed_scale_std if is_assumed else 0.0,
            centre_std_mm=self.assumed_centre_std_pitch * pitch_mm if has_pads else 0.0,
            settled_mm=read_only(np.zeros_like(plane_mm)),
            rest_area=read_only(np.full(len(plane_mm), np.nan)),
            rest_frames=0,
            recent_load=0.0,
            lives=self.identity.start(sensor),
        )

    def step(self, state: PerimeterState, grid: TrackedGrid) -> tuple[PerimeterState, Surface, Contacts]:
        """Surface and contacts of the next frame. It never raises: a bad frame has a status."""
        if grid.is_seen.sum() < _LEAST_MARKERS:
            return self._blind(state, grid)
        surface, moved_mm, std_mm = self.shape(state, grid)
        if state.rest_frames == 0:
            state = replace(state, rest_area=self.grow.at_rest(grid, state.rest_area, 0))
        chart, modes, variance, swelling = self._load(state, grid, moved_mm - state.settled_mm, std_mm)
        find = self.find if state.pads is None else self.find_pads
        found = find(chart, modes, variance, state.recent_load)
        if state.pads is not None and len(found.load):
            found = replace(found, centre_mm=self.pad_model.fitted(state.pads, found.centre_mm, swelling))
        lives, contacts = self.identity.step(
            state.lives,
            self._contacts(state, found, surface, moved_mm),
            is_firm=found.is_firm.tolist(),
            is_there=lambda point_mm: chart.load_at(point_mm, modes) > found.floor,
            status=grid.status,
        )
        state = replace(state, lives=lives, recent_load=find.remembered(found, state.recent_load))
        if grid.status == "ok" and not lives.lives and len(found.load) == 0:
            state = self._settled(state, grid, moved_mm)
        return state, surface, contacts

    def _load(
        self, state: PerimeterState, grid: TrackedGrid, shift_mm: Points2, std_mm: float
    ) -> tuple[LoadMap, Float64[np.ndarray, "k l"], float, Float64[np.ndarray, " swelling"]]:
        """The chart to read contacts from, its coefficients, the variance of their noise, and the swelling.

        Where view or sheet were assumed, the swelling says how the load is shared out, and displacements how
        much there is: light changes dots, it does not move them.
        """
        chart, std = state.chart, std_mm / state.pitch_mm
        modes = chart.modes(shift_mm.T.ravel() / state.pitch_mm)
        if state.pads is None:
            return chart, modes, std**2, np.zeros(0)
        growth = self.grow(grid, state.rest_area, state.neighbours)
        swelling = self.pad_model.swelling(growth, *state.spacing(shift_mm))
        there, chart = float(chart.load(modes).max()), state.pads.chart
        modes = chart.modes(swelling)
        scale = max(there, 0.0) / max(float(chart.load(modes).max()), 1e-12)
        variance = state.spacing.noise * std_mm**2 + (self.grow.std(grid) or 0.0) ** 2
        return chart, scale * modes, scale**2 * variance, swelling

    def shape(self, state: PerimeterState, grid: TrackedGrid) -> tuple[Surface, Points2, float]:
        """The surface alone, without contacts, of a frame that shows at least four markers.

        Returns:
            The surface; the displacements (m, 2) in the plane at rest, with the motion of the view; and the
            usual standard deviation of these.
        """
        from manytouch.estimation.perimeter.law_kernels import sheet
        from manytouch.estimation.perimeter.view_kernels import usual_std
        from manytouch.geometry.plane_kernels import in_plane

        law, plane, is_seen = state.law, state.plane, grid.is_seen
        place = (grid.position_px, grid.covariance_px2, plane.node_mm, plane.step_px, plane.low_px)
        moved_mm, covariance_mm2 = in_plane(*place, law.rest_mm, state.plane_from_px)
        moved_mm, covariance_mm2 = self.fill(
            moved_mm, covariance_mm2, is_seen, state.neighbours, state.pitch_mm
        )
        std_mm = usual_std(covariance_mm2, is_seen)
        view = self.view(law.rest_mm, moved_mm, is_seen, std_mm, state.judges)
        position_mm, displacement_mm, spread_mm2 = sheet(
            moved_mm,
            (view.shift_mm[0], view.shift_mm[1], view.angle_rad),
            *(law.rest_mm, law.eye_mm, law.distance_mm, law.lists, covariance_mm2),
            state.around,
            state.layout.rest_mm,
            *(_FEIGNED, _SPILL, state.scale_std),
        )
        surface = Surface(
            position_mm=read_only(position_mm),
            displacement_mm=read_only(displacement_mm),
            covariance_mm2=read_only(spread_mm2),
            layout=state.layout,
            status=grid.status,
        )
        return surface, moved_mm, std_mm

    def _settled(self, state: PerimeterState, grid: TrackedGrid, moved_mm: Points2) -> PerimeterState:
        """A frame that nothing touches tells a little of where rest is now."""
        settled_mm = state.settled_mm + self.settle * (moved_mm - state.settled_mm)
        return replace(
            state,
            settled_mm=read_only(settled_mm),
            rest_area=self.grow.at_rest(grid, state.rest_area, state.rest_frames),
            rest_frames=state.rest_frames + 1,
        )

    def _blind(self, state: PerimeterState, grid: TrackedGrid) -> tuple[PerimeterState, Surface, Contacts]:
        """A frame that shows nothing."""
        status = "few_markers" if grid.status == "ok" else grid.status
        count = len(state.law.rest_mm)
        surface = Surface(
            position_mm=read_only(np.full((count, 3), np.nan)),
            displacement_mm=read_only(np.full((count, 3), np.nan)),
            covariance_mm2=read_only(np.full((count, 3, 3), np.nan)),
            layout=state.layout,
            status=status,
        )
        lives, contacts = self.identity.step(state.lives, (), status=status)
        return replace(state, lives=lives), surface, contacts

    def _contacts(
        self, state: PerimeterState, found: LoadPeaks, surface: Surface, moved_mm: Points2
    ) -> list[Contact]:
        """The hills as contacts without identity; depth is the largest of the paper's within the area."""
        if len(found.load) == 0:
            return []
        row, column = np.nonzero(found.member >= 0)
        hill_at = found.member[row, column]
        depth_at = state.sampling.at(-surface.displacement_mm[:, 2], row, column)
        height = np.where(np.isfinite(depth_at), depth_at, -np.inf)
        places = [np.flatnonzero(hill_at == hill) for hill in range(len(found.load))]
        deepest = [int(place[np.argmax(height[place])]) for place in places]
        depth_std = state.sampling.at(np.sqrt(surface.covariance_mm2[:, 2, 2]), row[deepest], column[deepest])
        here_mm = found.centre_mm + _moved_at(state, moved_mm, found.centre_mm)
        centre_px = project(state.camera, np.column_stack([here_mm, np.zeros(len(here_mm))]))
        contacts = []
        for hill in range(len(found.load)):
            covariance = np.full((len(ESTIMATES), len(ESTIMATES)), np.nan)
            covariance[:2, :2] = found.covariance_mm2[hill] + state.centre_std_mm**2 * np.eye(2)
            covariance[_DEPTH, _DEPTH] = depth_std[hill] ** 2
            contacts.append(
                Contact(
                    id=-1,
                    phase=Phase.MOVE,
                    centre_mm=read_only(found.centre_mm[hill].copy()),
                    centre_px=read_only(centre_px[hill].copy()),
                    depth_mm=float(depth_at[deepest[hill]]),
                    force_N=read_only(np.full(3, np.nan)),
                    torque_Nmm=float("nan"),
                    area_mm2=float(found.area_mm2[hill]),
                    covariance=read_only(covariance),
                )
            )
        return contacts


def _moved_at(state: PerimeterState, moved_mm: Float64[np.ndarray, "m 2"], point_mm: Points2) -> Points2:
    """Displacements (n, 2) at the points of the chart nearest to the given ones."""
    x_mm, y_mm = state.chart.x_mm, state.chart.y_mm
    column = np.rint((point_mm[:, 0] - x_mm[0]) / (x_mm[1] - x_mm[0])).astype(int)
    row = np.rint((point_mm[:, 1] - y_mm[0]) / (y_mm[1] - y_mm[0])).astype(int)
    row, column = np.clip(row, 0, len(y_mm) - 1), np.clip(column, 0, len(x_mm) - 1)
    at = np.column_stack([state.sampling.at(moved_mm[:, axis], row, column) for axis in range(2)])
    return np.where(np.isfinite(at), at, 0.0)


def _error_weights(
    law: PerimeterLaw, neighbours: Neighbours, lever_mm: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(k, m) neighbours, and by what their depth above the marker's own adds to R . grad w / 2 and to d e."""
    place_mm, index = law.rest_mm, neighbours.index.T
    each = 1.0 / (neighbours.distance.T**2 * len(index))
    along = ((place_mm[index] - place_mm) * (place_mm - law.eye_mm)).sum(axis=2)
    bend = 2.0 * law.distance_mm * lever_mm * each
    return (
        read_only(np.ascontiguousarray(index.astype(np.int32))),
        read_only(np.ascontiguousarray(along * each)),
        read_only(np.ascontiguousarray(bend)),
    )
