"""The load from the swelling of dots, and the contact finder for sensors that were not calibrated."""

from dataclasses import dataclass, field, replace

import numpy as np

from manytouch.estimation.load.displacement_load import LoadModel
from manytouch.estimation.load.load_contact_finder import LoadContactFinder
from manytouch.estimation.load.load_estimator import LoadEstimate
from manytouch.estimation.load.load_map import LoadMap
from manytouch.estimation.load.load_peaks import LoadPeakFinder
from manytouch.estimation.local_motion import LocalMotion
from manytouch.estimation.uncalibrated.dot_area import DotAreaChange
from manytouch.estimation.uncalibrated.marker_spacing import MarkerSpacing, marker_spacing
from manytouch.estimation.uncalibrated.swelling import SwellingMap, SwellingModel
from manytouch.geometry.camera import cam_from_sheet
from manytouch.geometry.neighbours import Neighbours, nearest_neighbours
from manytouch.values import Sensor, TrackedGrid
from manytouch.values.arrays import Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SwellingLoadState:
    """What a `SwellingLoad` keeps between frames.

    Attributes:
        displacement_map: from displacements to the load, which sets its scale.
        swelling_map: from the swelling to where the load is.
        spacing: from displacements to the changes of spacings.
        neighbours: of each marker.
        rest_log_area: (m,) logarithm of the areas of the dots at rest in px^2, NaN where not known.
    """

    displacement_map: LoadMap
    swelling_map: SwellingMap
    spacing: MarkerSpacing
    neighbours: Neighbours
    rest_log_area: Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SwellingLoad:
    """The load where view or sheet were assumed: a `LoadEstimator`.

    Swelling gives the distribution of the load, displacements its scale: light changes dots, but does not
    move them.

    Attributes:
        model: of sheet, fingers and view, for the scale.
        swelling_model: of the swelling under fingers.
        dot_area: change of the areas of dots.
    """

    model: LoadModel = field(default_factory=LoadModel)
    swelling_model: SwellingModel = field(default_factory=SwellingModel)
    dot_area: DotAreaChange = field(default_factory=DotAreaChange)

    def start(self, sensor: Sensor, rest_mm: Points2) -> SwellingLoadState:
        """The state before the first frame, for markers (m, 2) in the plane of the sheet."""
        assert sensor.layout is not None
        rotation, translation = cam_from_sheet(sensor.camera)
        axis_mm = (-translation @ rotation)[:2]
        neighbours = nearest_neighbours(rest_mm)
        return SwellingLoadState(
            displacement_map=self.model(sensor, rest_mm),
            swelling_map=self.swelling_model(sensor.layout, rest_mm, self.model.points_per_pitch),
            spacing=marker_spacing(rest_mm, axis_mm, neighbours),
            neighbours=neighbours,
            rest_log_area=read_only(np.full(len(rest_mm), np.nan)),
        )

    def load_map(self, state: SwellingLoadState) -> LoadMap:
        """The map of the swelling."""
        return state.swelling_map.load_map

    def estimate_load(
        self, state: SwellingLoadState, grid: TrackedGrid, displacement_mm: Points2, std_mm: float
    ) -> LoadEstimate:
        """The load of a frame; see `LoadEstimator`."""
        by_displacement = state.displacement_map
        coefficients = by_displacement.coefficients(displacement_mm.T.ravel() / by_displacement.pitch_mm)
        largest = float(by_displacement.load_on_grid(coefficients).max())
        growth = self.dot_area(grid, state.rest_log_area, state.neighbours)
        swelling = self.swelling_model.swelling(growth, *state.spacing(displacement_mm))
        load_map = state.swelling_map.load_map
        coefficients = load_map.coefficients(swelling)
        scale = max(largest, 0.0) / max(float(load_map.load_on_grid(coefficients).max()), 1e-12)
        variance = state.spacing.noise * std_mm**2 + (self.dot_area.std(grid) or 0.0) ** 2
        return LoadEstimate(
            load_map=load_map,
            coefficients=scale * coefficients,
            variance=scale**2 * variance,
            observed=swelling,
        )

    def refine(self, state: SwellingLoadState, load: LoadEstimate, centre_mm: Points2) -> Points2:
        """Centres (c, 2) that fit the swelling of the frame best."""
        return self.swelling_model.fit_centres(state.swelling_map, centre_mm, load.observed)

    def update_rest(self, state: SwellingLoadState, grid: TrackedGrid, frames: int) -> SwellingLoadState:
        """The state with the dot areas of a frame at rest; `frames` at rest came before it."""
        return replace(state, rest_log_area=self.dot_area.updated_rest(grid, state.rest_log_area, frames))


def uncalibrated_contact_finder() -> LoadContactFinder:
    """The finder of contacts where view or sheet were assumed."""
    return LoadContactFinder(
        load=SwellingLoad(),
        peaks=LoadPeakFinder(start_load=0.0125, stay_load=0.01, start_share=0.4, stay_share=0.35),
        assumed_centre_std_pitch=0.5,
        most_depth_std_pitch=1.0,
        local_motion=LocalMotion(),
    )
