"""The surface at the markers by the paper's depth, after the motion of the view has been removed.

`covariance_mm2` of the surface is the noise of the centres propagated through the perimeters, plus the
deviation of the law itself. For a purely vertical motion w the law measures w + (R . grad w)/2, with R from
the optical axis, and a stretch e of the sheet adds d e. The first deviation is computed from the slope of the
measured depth, the second from its curvature, since bending stretches the camera-side face by half the
thickness times the curvature. The measured map contains the deviation that is computed from it, therefore the
deviation is limited to what the map shows. On simulated presses about half of the markers lie within one
standard deviation, and five of six within two.
"""

from dataclasses import dataclass, field

import numpy as np

from manytouch.compilation import plain
from manytouch.errors import LayoutError, SensorError
from manytouch.estimation.assumptions import view_is_assumed
from manytouch.estimation.contact_finder import MarkerMotion
from manytouch.estimation.perimeter.interpolation import MarkerInterpolation
from manytouch.estimation.perimeter.law import PerimeterLaw, perimeter_law
from manytouch.estimation.perimeter.law_inputs import LawErrors
from manytouch.estimation.perimeter.rigid_motion import RigidMotionEstimator
from manytouch.estimation.perimeter.surface_inputs import SurfaceInputs
from manytouch.geometry.camera import cam_from_sheet, onto_plane
from manytouch.geometry.neighbours import Neighbours, lattice_cells, nearest_neighbours, triangle_cells
from manytouch.geometry.plane_table import plane_from_px, plane_table
from manytouch.geometry.refraction import rest_px
from manytouch.values import Layout, Sensor, Status, Surface, TrackedGrid
from manytouch.values.arrays import read_only

MIN_MARKERS = 4
"""A frame with fewer seen markers has no surface."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerGeometry:
    """What a surface needs of the sensor.

    Attributes:
        inputs: of the compiled surface.
        layout: of the sensor.
    """

    inputs: SurfaceInputs
    layout: Layout


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerSurface:
    """Surface at the markers by equation 11 of the paper. It keeps nothing between frames.

    Attributes:
        view_motion: estimates the motion of the view.
        interpolation: of markers that are not seen.
        noise_factor: factor of the variance that depths with independent noise add to slope and curvature,
            which is subtracted. On a lattice, where cells share their markers, the true variance of a
            curvature is 0.6 times that one, so that a curvature counts beyond two standard deviations.
        spill: of the mean square of all marker depths, added in mm² to what the depths around a marker show,
            which limits the variance of its error (`law_error_variances`): a deep press also falsifies the
            depths of markers that show little.
        assumed_scale_std: relative standard deviation of the depth where the field of view was assumed.
    """

    view_motion: RigidMotionEstimator = field(default_factory=RigidMotionEstimator)
    interpolation: MarkerInterpolation = field(default_factory=MarkerInterpolation)
    noise_factor: float = 2.5
    spill: float = 4.0
    assumed_scale_std: float = 0.35

    def start(self, sensor: Sensor) -> MarkerGeometry:
        """Computes everything that depends on the sensor only.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: it has fewer than four markers.
        """
        layout, camera = sensor.layout, sensor.camera
        if layout is None:
            raise SensorError(
                f"sensor {sensor.name!r} has no [markers], but depth needs their rest positions: "
                "run `manytouch calibrate rest` first"
            )
        if len(layout.rest_mm) < MIN_MARKERS:
            raise LayoutError(
                f"the layout of sensor {sensor.name!r} has {len(layout.rest_mm)} markers, but depth needs at "
                f"least {MIN_MARKERS}: select a region with more of them"
            )
        at_rest_px = rest_px(sensor, layout)
        plane_mm = onto_plane(camera, at_rest_px)[:, :2]
        rotation, translation = cam_from_sheet(camera)
        eye_mm = -translation @ rotation
        cells = triangle_cells(plane_mm) if layout.row_column is None else lattice_cells(layout.row_column)
        pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
        law = perimeter_law(cells, plane_mm, eye_mm[:2], -float(eye_mm[2]))
        neighbours = nearest_neighbours(plane_mm)
        lever_mm = 0.5 * (pitch_mm if sensor.sheet is None else sensor.sheet.thickness_mm)
        scale_std = self.assumed_scale_std if view_is_assumed(sensor) else 0.0
        inputs = SurfaceInputs(
            rest=layout.rest_mm,
            nodes=plain(plane_table(camera).nodes),
            plane_from_px=read_only(plane_from_px(camera, at_rest_px)),
            interpolation=plain(self.interpolation.rule(neighbours, pitch_mm)),
            search=plain(self.view_motion.search(self.view_motion.hypotheses(plane_mm))),
            rays=plain(law.rays),
            cells=plain(law.lists),
            errors=plain(self._law_errors(law, neighbours, lever_mm, scale_std)),
            least=MIN_MARKERS,
        )
        return MarkerGeometry(inputs=inputs, layout=layout)

    def __call__(self, geometry: MarkerGeometry, grid: TrackedGrid) -> MarkerMotion | None:
        """Surface and displacements of a frame; None where it shows fewer than four markers."""
        from manytouch.estimation.perimeter.surface_kernels import surface_of_markers

        position_mm, without_view_mm, covariance_mm2, displacement_mm, std_mm = surface_of_markers(
            grid.position_px, grid.covariance_px2, grid.is_seen, plain(geometry.inputs)
        )
        if len(position_mm) == 0:
            return None
        surface = Surface(
            position_mm=read_only(position_mm),
            displacement_mm=read_only(without_view_mm),
            covariance_mm2=read_only(covariance_mm2),
            layout=geometry.layout,
            status=grid.status,
        )
        return MarkerMotion(surface=surface, displacement_mm=displacement_mm, std_mm=std_mm)

    def _law_errors(
        self, law: PerimeterLaw, neighbours: Neighbours, lever_mm: float, scale_std: float
    ) -> LawErrors:
        """Weights of a neighbour's depth, relative to the marker's own, in R . grad w / 2 and in d e."""
        place_mm, index = law.rest_mm, neighbours.index.T
        each = 1.0 / (neighbours.distance.T**2 * len(index))
        along = ((place_mm[index] - place_mm) * (place_mm - law.axis_mm)).sum(axis=2)
        return LawErrors(
            neighbour=read_only(np.ascontiguousarray(index.astype(np.int32))),
            slope=read_only(np.ascontiguousarray(along * each)),
            curvature=read_only(np.ascontiguousarray(2.0 * law.distance_mm * lever_mm * each)),
            noise_factor=self.noise_factor,
            spill=self.spill,
            scale_std=scale_std,
        )


def unknown_surface(layout: Layout, status: Status) -> Surface:
    """The surface of a frame that shows too few markers: NaN everywhere."""
    count = len(layout.rest_mm)
    return Surface(
        position_mm=read_only(np.full((count, 3), np.nan)),
        displacement_mm=read_only(np.full((count, 3), np.nan)),
        covariance_mm2=read_only(np.full((count, 3, 3), np.nan)),
        layout=layout,
        status=Status.FEW_MARKERS if status is Status.OK else status,
    )
