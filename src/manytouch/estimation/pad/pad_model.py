"""Everything about a bonded pad that stays the same between frames."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64
from scipy.ndimage import map_coordinates

from manytouch.errors import LayoutError, SensorError
from manytouch.estimation.pad.patch_kernels import LayerTable, Markers, PadGrid
from manytouch.geometry.camera import mm_per_px, project, ray
from manytouch.geometry.refraction import project_through_window
from manytouch.geometry.spline.patch import Nodal, PointBasis, SplinePatch
from manytouch.mechanics.pad.elasticity import PadResponse, pad_response
from manytouch.mechanics.pad.layer import radial_table
from manytouch.mechanics.pad.layer_nodes import layer_node_response
from manytouch.mechanics.pad.patch_depth import PatchDepthTable, patch_depth_table
from manytouch.values import Camera, Layout, Sensor, Sheet, SheetSpline
from manytouch.values.arrays import Points2, Points3, read_only
from manytouch.values.sensor_file.default_std import POISSON_STD, SheetStd, camera_std, sheet_std

MIN_MARKERS = 12
MOTIONS = 6
"""Motion of the whole image, all that a rigid camera can cause: shift x, y in px; growth and turn about the
middle, as ratio and in rad; what a turn of the camera about its own x and y adds to these, in rad."""
FACE_THICKNESS_MM = 1e-3
"""Thickness in the `SheetSpline` of a pad, whose spline is the contact face itself."""
_LAYER_REACH = 3.0
"""Distance from a load, in thicknesses, up to which the exact response of a layer is used. Further away all
motion is in `BondedPadModel.by_sides`: by shear it is up to 7 % of the largest, and smooth."""
_PERIOD = 8.0
"""Period of the loads of the layer on nodes, in thicknesses: copies of a load are 5 or more from where it is
used, and move markers there by less than 1 % of the largest motion by shear, 3 % in the plane by pressure."""
_DISTANCES = 300  # of the table of the layer; linear interpolation is within 0.6 % of the largest motion
_ROOTS = (0.05, 0.6, 14)
"""Roots of the Gaussians of that table, in thicknesses: least, largest, number. Linear interpolation between
two is within 1.5 % of the largest motion."""
_STEP_MM = 1e-4  # of the derivative of the projection
_STEP_RAD = 1e-5  # of the derivative by the turn of the camera


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BondedPadModel:
    """A bonded pad under a camera: what stays the same between frames. Forces are over E, images in px.

    Attributes:
        camera, layout, sheet: of the sensor.
        patch: nodes of the contact face.
        grid: the same for compiled functions.
        table: response of an unbounded layer at the depth of the markers.
        depth_table: depth of the same layer under a ball, a flat face and a ring, numbered as in `Profile`.
        node_depth: (a, b) depth times E of the same layer at the nodes of a period, per normal force on the
            first one, 1/mm; the nodes are counted along x and y.
        by_sides: (3, nx, ny, 2 m) change of the marker images per nodal force along x, y, z by the free sides
            of the pad; the splines are counted along x and y.
        by_parameter: (p, 3, nx, ny, 2 m) change of the marker images per nodal force for one standard
            deviation of Poisson's ratio, of the thickness, and of the depth of the markers.
        depth_by_parameter: (2, n, n) change of the depths of the contact face per normal force, for the same
            of the first two; the depth of the markers does not change it.
        marker: (n, 3, m, 3) displacement of the markers per nodal force.
        face: (n, 3, n, 3) coefficients of the contact face per nodal force.
        over_marker: basis functions of the contact face over the markers.
        slope_px: (m, 2, 3) derivative of the marker images by their positions.
        markers: places at rest and the same derivative, for compiled functions.
        rest_px: (m, 2) projection of the markers at rest.
        motion: (MOTIONS, 2 m) change of the marker images by the motion of the image.
        pitch_mm, pitch_px: geometric mean of the pitches.
        poisson: Poisson's ratio.
        shape_is_nominal: whether thickness and outline are those of a kind of sensor, and not of this one.
        young_MPa: None if forces are relative.
        young_std, scale_std: relative standard deviations of Young's modulus and of the scale of the image.
    """

    camera: Camera
    layout: Layout
    sheet: Sheet
    patch: SplinePatch
    grid: PadGrid
    table: LayerTable
    depth_table: PatchDepthTable
    node_depth: Float64[np.ndarray, "px py"]
    by_sides: Float64[np.ndarray, "3 nx ny r"]
    by_parameter: Float64[np.ndarray, "p 3 nx ny r"]
    depth_by_parameter: Float64[np.ndarray, "2 nodes nodes"]
    marker: Float64[np.ndarray, "nodes 3 m 3"]
    face: Float64[np.ndarray, "nodes 3 nodes 3"]
    over_marker: PointBasis
    slope_px: Float64[np.ndarray, "m 2 3"]
    markers: Markers
    rest_px: Points2
    motion: Float64[np.ndarray, "6 r"]
    pitch_mm: float
    pitch_px: float
    poisson: float
    shape_is_nominal: bool
    young_MPa: float | None
    young_std: float
    scale_std: float

    @property
    def thickness_mm(self) -> float:
        """Thickness of the pad."""
        return self.sheet.thickness_mm

    def by_node(self, along: Float64[np.ndarray, "nx ny *k"]) -> Float64[np.ndarray, "nodes *k"]:
        """Values that are counted along x and y, in the order of the nodes."""
        ordered = along if self.patch.is_x_slow else along.swapaxes(0, 1)
        return np.ascontiguousarray(ordered.reshape(self.patch.node_count, *along.shape[2:]))

    def by_place(self, values: Nodal) -> Float64[np.ndarray, "nx ny 3"]:
        """Values of the nodes (n, 3), counted along x and y."""
        grid = values.reshape(*self.patch.shape, 3)
        return np.ascontiguousarray(grid if self.patch.is_x_slow else grid.swapaxes(0, 1))

    def project(self, displacement_mm: Points3) -> Points2:
        """(m, 2) marker images for displacements (m, 3) of the markers."""
        return project_through_window(self.camera, self.sheet, self.layout.rest_mm + displacement_mm)

    def spline(self, coefficient_mm: Nodal, force_mm2: Nodal) -> SheetSpline:
        """The contact face (n, 3) and nodal forces over E (n, 3) as a value."""
        return SheetSpline(
            size_mm=self.patch.size_mm,
            centre_mm=self.patch.centre_mm,
            elements=self.patch.elements,
            is_clamped=False,
            thickness_mm=FACE_THICKNESS_MM,
            poisson=self.poisson,
            coefficient_mm=read_only(coefficient_mm),
            force_over_E_mm2=read_only(force_mm2),
            young_MPa=self.young_MPa,
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NominalPad:
    """Nominal properties of a pad, and the size of its elements.

    Attributes:
        poisson: Poisson's ratio if the sensor does not state it; that of silicone.
        element_thickness: length of an element, in thicknesses. In-plane motion by loads of this width is
            within 3 % of that of a layer.
        max_elements: largest number of elements along a side; beyond, elements are longer.
    """

    poisson: float = 0.48
    element_thickness: float = 1.0 / 3.0
    max_elements: int = 27

    def __call__(self, sensor: Sensor) -> BondedPadModel:
        """The model of a sensor's pad.

        Raises:
            SensorError: the sensor has no layout or no sheet.
            LayoutError: it has too few markers.
        """
        layout, sheet = _require_markers(sensor)
        camera, stds = sensor.camera, sheet_std(sheet)
        poisson = self.poisson if sheet.poisson is None else sheet.poisson
        depth_mm = sheet.marker_depth_mm or 0.0
        patch = self._patch(sheet)
        response = pad_response(patch, sheet.thickness_mm, poisson, layout.rest_mm[:, :2], depth_mm)
        rest_px, slope_px = _projection(camera, sheet, layout)
        by_sides = response.marker - _layer(patch, sheet, poisson, layout)
        by_parameter, depth_by_parameter = _by_parameter(response, stds, patch, slope_px)
        pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
        return BondedPadModel(
            camera=camera,
            layout=layout,
            sheet=sheet,
            patch=patch,
            grid=_grid(patch),
            table=layer_table(sheet.thickness_mm, poisson, depth_mm, _dot_radius_mm(layout)),
            depth_table=patch_depth_table(sheet.thickness_mm, poisson),
            node_depth=np.ascontiguousarray(_layer_nodes(patch, sheet, poisson, 0.0)[:, :, 2, 2]),
            by_sides=read_only(_images(by_sides, patch, slope_px)),
            by_parameter=read_only(by_parameter),
            depth_by_parameter=read_only(depth_by_parameter),
            marker=read_only(np.ascontiguousarray(response.marker.transpose(2, 3, 0, 1))),
            face=response.face,  # symmetric
            over_marker=patch.at(layout.rest_mm[:, :2]),
            slope_px=read_only(slope_px),
            markers=Markers(place=np.ascontiguousarray(layout.rest_mm[:, :2]), slope=slope_px),
            rest_px=read_only(rest_px),
            motion=read_only(_motion(camera, rest_px)),
            pitch_mm=pitch_mm,
            pitch_px=pitch_mm / mm_per_px(camera),
            poisson=poisson,
            shape_is_nominal=sensor.shape_is_nominal,
            young_MPa=sheet.young_MPa if sensor.scale_is_known else None,
            young_std=_young_std(sheet, stds),
            scale_std=_scale_std(camera),
        )

    def _patch(self, sheet: Sheet) -> SplinePatch:
        """The contact face, with odd numbers of elements."""
        wanted = np.floor(sheet.size_mm / (self.element_thickness * sheet.thickness_mm))
        count = 2 * (np.clip(wanted, 5, self.max_elements).astype(int) // 2) + 1
        return SplinePatch(
            size_mm=(float(sheet.size_mm[0]), float(sheet.size_mm[1])),
            elements=(int(count[0]), int(count[1])),
            boundary="soft",
        )


def _require_markers(sensor: Sensor) -> tuple[Layout, Sheet]:
    """The layout and the sheet of a sensor.

    Raises:
        SensorError: it has no layout or no sheet.
        LayoutError: it has too few markers.
    """
    layout, sheet = sensor.layout, sensor.sheet
    if layout is None or sheet is None:
        raise SensorError(
            f"sensor {sensor.name!r} has no [markers] or no [sheet], "
            "which the mechanics of a bonded pad needs"
        )
    if len(layout.rest_mm) < MIN_MARKERS:
        raise LayoutError(
            f"sensor {sensor.name!r} has {len(layout.rest_mm)} markers; a pad needs {MIN_MARKERS} or more"
        )
    return layout, sheet


def _images(
    marker: np.ndarray, patch: SplinePatch, slope_px: Float64[np.ndarray, "m 2 3"]
) -> Float64[np.ndarray, "3 nx ny r"]:
    """Marker images of a response of the markers (m, 3, n, 3)."""
    moved = np.einsum("mij,mjnc->cnmi", slope_px, marker)
    grid = moved.reshape(3, *patch.shape, -1)
    return np.ascontiguousarray(grid if patch.is_x_slow else grid.swapaxes(1, 2))


def _by_parameter(
    response: PadResponse, stds: SheetStd, patch: SplinePatch, slope_px: Float64[np.ndarray, "m 2 3"]
) -> tuple[np.ndarray, np.ndarray]:
    """`by_parameter` and `depth_by_parameter` of `BondedPadModel`."""
    poisson_std = POISSON_STD if stds.poisson is None else stds.poisson
    images = [
        poisson_std * _images(response.by_poisson, patch, slope_px),
        stds.thickness_mm * _images(response.by_thickness, patch, slope_px),
        (stds.marker_depth_mm or 0.0) * _images(response.by_marker_depth, patch, slope_px),
    ]
    depths = [poisson_std * response.depth_by_poisson, stds.thickness_mm * response.depth_by_thickness]
    return np.stack(images), np.stack(depths)


def _young_std(sheet: Sheet, stds: SheetStd) -> float:
    """Relative standard deviation of Young's modulus; 0 if it is not known."""
    if sheet.young_MPa is None or stds.young_MPa is None:
        return 0.0
    return stds.young_MPa / sheet.young_MPa


def _scale_std(camera: Camera) -> float:
    """Relative standard deviation of the scale of the image."""
    stds = camera_std(camera)
    focal = stds.fx_px / camera.fx_px
    distance = float(stds.translation_mm[2] / abs(camera.translation_mm[2]))
    return float(np.hypot(focal, distance))


def _layer(
    patch: SplinePatch, sheet: Sheet, poisson: float, layout: Layout
) -> Float64[np.ndarray, "m 3 nodes 3"]:
    """The response of the markers if the pad had no sides, on the same nodes."""
    step_mm = np.array(patch.size_mm) / np.array(patch.elements)
    coefficient = _layer_nodes(patch, sheet, poisson, sheet.marker_depth_mm or 0.0)
    away_mm = layout.rest_mm[:, None, :2] - patch.place_mm
    is_near = np.linalg.norm(away_mm, axis=2) < _LAYER_REACH * sheet.thickness_mm
    place = (away_mm[is_near] / step_mm).T
    found = np.zeros((*away_mm.shape[:2], 3, 3))
    for i, load in np.ndindex(3, 3):
        found[is_near, i, load] = map_coordinates(
            coefficient[:, :, i, load], place, order=3, prefilter=False, mode="grid-wrap"
        )
    return found.transpose(0, 2, 1, 3)


def _layer_nodes(
    patch: SplinePatch, sheet: Sheet, poisson: float, depth_mm: float
) -> Float64[np.ndarray, "px py 3 3"]:
    """`layer_node_response` on elements of the size of a pad's."""
    step_mm = np.array(patch.size_mm) / np.array(patch.elements)
    counts = np.maximum(np.ceil(_PERIOD * sheet.thickness_mm / step_mm).astype(int), 8)
    return layer_node_response(
        (float(step_mm[0]), float(step_mm[1])),
        (int(counts[0]), int(counts[1])),
        sheet.thickness_mm,
        poisson,
        depth_mm,
    )


def _motion(camera: Camera, rest_px: Points2) -> Float64[np.ndarray, "6 r"]:
    """Marker images by the motion of the image."""
    away_px = rest_px - rest_px.mean(axis=0)
    turned_px = np.column_stack([-away_px[:, 1], away_px[:, 0]])
    count = len(away_px)
    plane = np.stack(
        [np.tile([1.0, 0.0], count), np.tile([0.0, 1.0], count), away_px.ravel(), turned_px.ravel()]
    )
    tilt = _tilt(camera, rest_px)
    return np.vstack([plane, tilt - tilt @ np.linalg.pinv(plane) @ plane])


def _tilt(camera: Camera, rest_px: Points2) -> Float64[np.ndarray, "2 r"]:
    """Change of images (m, 2) as the camera turns about its own x and y by the right-hand rule, in px/rad.

    It is a change of the directions of the rays in air alone, whatever window lies before the camera.
    """
    direction = np.column_stack([ray(camera, rest_px), np.ones(len(rest_px))])
    frame = replace(camera, rotation_vector=np.zeros(3), translation_mm=np.zeros(3))
    images = []
    for axis in np.eye(3)[:2]:
        turned = _STEP_RAD * np.cross(direction, axis)
        moved_px = project(frame, direction + turned) - project(frame, direction - turned)
        images.append(moved_px.ravel() / (2.0 * _STEP_RAD))
    return np.stack(images)


def _grid(patch: SplinePatch) -> PadGrid:
    """The nodes for compiled functions."""
    (x_mm, y_mm), (wide_mm, high_mm), (columns, rows) = patch.corner_mm, patch.size_mm, patch.elements
    return PadGrid(
        corner_x=float(x_mm),
        corner_y=float(y_mm),
        step_x=wide_mm / columns,
        step_y=high_mm / rows,
        count_x=columns,
        count_y=rows,
    )


def _dot_radius_mm(layout: Layout) -> float:
    """Median radius of the dots; 0 if it is not known."""
    radius_mm = layout.radius_mm[np.isfinite(layout.radius_mm)]
    return float(np.median(radius_mm)) if len(radius_mm) else 0.0


def layer_table(
    thickness_mm: float, poisson: float, depth_mm: float, dot_radius_mm: float = 0.0
) -> LayerTable:
    """The response of dots in an unbounded layer at a depth below its face."""
    distance_mm = np.linspace(0.0, _LAYER_REACH * thickness_mm, _DISTANCES)
    root_mm = thickness_mm * np.geomspace(*_ROOTS)
    value = radial_table(distance_mm, root_mm, thickness_mm, poisson, depth_mm, dot_radius_mm=dot_radius_mm)
    return LayerTable(
        value=read_only(np.ascontiguousarray(value)), step=float(distance_mm[1]), root=read_only(root_mm)
    )


def _projection(camera: Camera, sheet: Sheet, layout: Layout) -> tuple[Points2, np.ndarray]:
    """(m, 2) images of the markers at rest and (m, 2, 3) their derivatives by the positions."""
    rest_px = project_through_window(camera, sheet, layout.rest_mm)
    slope = [
        (
            project_through_window(camera, sheet, layout.rest_mm + step)
            - project_through_window(camera, sheet, layout.rest_mm - step)
        )
        / (2.0 * _STEP_MM)
        for step in _STEP_MM * np.eye(3)
    ]
    return rest_px, np.stack(slope, axis=-1)
