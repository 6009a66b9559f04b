"""The mechanical model of a sensor's sheet, with nominal values for what the sensor does not state."""

from dataclasses import dataclass, replace

import numpy as np

from manytouch.errors import LayoutError, SensorError
from manytouch.estimation.assumptions import view_is_assumed
from manytouch.estimation.mechanics.inversion.force_nodes import ForceNodes
from manytouch.geometry.spline.patch import Nodal, SplinePatch
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell.equilibrium import compliances_at_rest, tangent_factor
from manytouch.mechanics.shell.shell import Shell
from manytouch.mechanics.solver.normal_equations import NormalEquations
from manytouch.values import Camera, Layout, Sensor, Sheet, SheetSpline
from manytouch.values.arrays import Mask, Points2, Scalars, read_only
from manytouch.values.sensor_file.assumed_sheet import ASSUMED_POISSON, assumed_sheet
from manytouch.values.sensor_file.default_std import sheet_std

MIN_MARKERS = 12
"""A layout with fewer markers is refused; a frame that shows fewer has the status `few_markers`."""
PRETENSION_STEP_MM = 1e-3
"""Of a finite difference; it stretches a sheet by less than 0.1 %, which hardly changes its moduli."""

GRAVITY_M_S2 = 9.80665
USUAL_DENSITY_KG_M3 = 1100.0
"""Of a sheet whose sensor file does not state it; silicones and TPU have 960 to 1210 kg/m^3."""

_CLAMPED_BENDING, _CLAMPED_TENSION = 500.56, 12.303
"""Integrals of squared second and first derivatives of the first function of a clamped beam of length 1, over
that of its square."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InversionModel:
    """Everything about the sheet that stays the same between frames.

    Attributes:
        camera, layout: of the sensor.
        patch: spline patch of the middle surface.
        shell: energy and forces of the sheet.
        dots: marker images.
        stretched: those with `PRETENSION_STEP_MM` more of pretension over E, for derivatives by it.
        normal_equations: of the inversion.
        nodes: of the sheet.
        pitch_mm: geometric mean of both pitches of the layout.
        thickness_mm: of the sheet.
        thickness_std_mm: its standard deviation where it was assumed; else NaN.
        young_MPa: None if forces are relative, over E.
        weight_mm2: (nodes,) weight of the sheet over E at each node; 0 if E is not known.
        young_relative_std: its standard deviation over its value.
        is_excluded: (n,) nodes so near a clamp that they have its forces, or beyond the markers of an assumed
            sheet.
        inner_markers: number of markers two pitches or more inside the outermost ones.
        is_assumed: whether thickness and outline were assumed.
        assumed_depth_std: relative standard deviation of depths by what was assumed of sheet and camera.
    """

    camera: Camera
    layout: Layout
    patch: SplinePatch
    shell: Shell
    dots: MarkerImages
    stretched: MarkerImages
    normal_equations: NormalEquations
    nodes: ForceNodes
    pitch_mm: float
    thickness_mm: float
    thickness_std_mm: float
    young_MPa: float | None
    weight_mm2: Scalars
    young_relative_std: float
    is_excluded: Mask
    inner_markers: int
    is_assumed: bool
    assumed_depth_std: float

    def with_pretension(self, over_E_mm: float) -> "InversionModel":
        """The model with another membrane force per length at rest, over E."""
        shell = replace(self.shell, pretension_over_E_mm=over_E_mm)
        dots = self.dots.changed(shell=shell)
        seen_mm2_per_px, compliance_per_mm = _node_responses(dots, self.pitch_mm)
        nodes = replace(
            self.nodes,
            seen_mm2_per_px=seen_mm2_per_px,
            compliance_per_mm=compliance_per_mm,
            stiffening=_stiffening(shell),
        )
        equations = NormalEquations(shell=shell, dots=dots)
        return replace(
            self,
            shell=shell,
            dots=dots,
            stretched=_stretched(dots),
            normal_equations=equations,
            nodes=nodes,
        )

    def compliance_per_mm(self, place_mm: Points2) -> Scalars:
        """`ForceNodes.compliance_per_mm` at places (k, 2) of the sheet."""
        points = self.patch.at(place_mm)
        return np.asarray((points.value * self.nodes.compliance_per_mm[points.node]).sum(axis=1))

    def edge_nearness(self, centre_mm: Scalars) -> float:
        """How near a place (2,) of an assumed sheet is to its outermost markers.

        It is 1 within a pitch of them and beyond them, and e times less each half pitch further inside; 0 on
        a sheet that is known.
        """
        if not self.is_assumed:
            return 0.0
        half_mm = np.abs(self.layout.rest_mm[:, :2]).max(axis=0)
        inside = float(((half_mm - np.abs(centre_mm)) / self.layout.pitch_mm).min())
        return float(np.exp(-2.0 * max(inside - 1.0, 0.0)))

    def spline(
        self, coefficient_mm: Nodal, force_mm2: Nodal, pretension_std_mm: float = float("nan")
    ) -> SheetSpline:
        """Shape (n, 3) and nodal forces over E (n, 3) as a value.

        Args:
            coefficient_mm, force_mm2: of the shape.
            pretension_std_mm: standard deviation of the pretension over E.
        """
        return SheetSpline(
            size_mm=self.patch.size_mm,
            centre_mm=self.patch.centre_mm,
            elements=self.patch.elements,
            is_clamped=self.patch.boundary == "clamped",
            thickness_mm=self.thickness_mm,
            poisson=self.shell.poisson,
            coefficient_mm=coefficient_mm,
            force_over_E_mm2=force_mm2,
            young_MPa=self.young_MPa,
            shear_mm2=self.shell.shear_mm2,
            tilt_mm2=self.shell.tilt_mm2,
            clamped_end=self.patch.clamped_end,
            pretension_over_E_mm=self.shell.pretension_over_E_mm,
            pretension_std_over_E_mm=pretension_std_mm,
            thickness_std_mm=self.thickness_std_mm,
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NominalSheet:
    """The model of a sheet: what holds where the sensor states nothing, and the size of its elements.

    Attributes:
        poisson: Poisson's ratio if the sensor does not state it; that of nearly incompressible rubber.
        element_thickness: largest length of an element, in thicknesses; at most one pitch.
        min_element_thickness: least length of an element, in thicknesses. A point force on a node of a sheet
            with shear_mm2 = t^2 / 5 has nodal forces without tension if elements are at least sqrt(6 / 5) t
            long; finer loads are not visible on the camera-side face.
        max_elements: largest number of elements; if it is exceeded, elements are longer.
        least_stds: least normal force of a contact, in standard deviations by the usual noise of a single
            force in the middle of the sheet. Compared were 6 and 10 on 160 varied presses, and depths of the
            middle from 0.003 to 0.01 pitches under that force (ADR 158).
        thickness_depth: relative change of a depth over that of an assumed thickness. The face moves in its
            plane by half the thickness times the slope.
        assumed_view_std: relative standard deviation of a depth where the field of view was assumed: that of
            the distance to the camera.
        clamp_thickness: contacts with a centre within this distance of a clamp are left out, in thicknesses.
            A clamp line that is wrong by a third of it causes forces there.
        margin_pitch: how far the model of an assumed sheet goes on beyond the outermost markers, in pitches.
        beyond_pitch: nodes further than this from the outermost markers of an assumed sheet may have any
            forces, in pitches.
        inner_pitch: contacts further than this from them are left out, in pitches.
    """

    poisson: float = ASSUMED_POISSON
    element_thickness: float = 1.4
    min_element_thickness: float = 1.1
    max_elements: int = 1200
    least_stds: float = 6.0
    clamp_thickness: float = 1.0
    margin_pitch: float = 6.0
    beyond_pitch: float = 1.5
    inner_pitch: float = 0.5
    thickness_depth: float = 0.6
    assumed_view_std: float = 0.15

    def __call__(self, sensor: Sensor, usual_std_px: float) -> InversionModel:
        """The model of a sensor's sheet.

        Args:
            sensor: with a layout.
            usual_std_px: the usual standard deviation of the marker images.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: it has too few markers.
        """
        layout = checked_layout(sensor)
        sheet = assumed_sheet(layout) if sensor.sheet is None else sensor.sheet
        pitch_mm, thickness_mm = float(np.sqrt(np.prod(layout.pitch_mm))), sheet.thickness_mm
        shell = self._shell(self._patch(layout, sheet), sheet)
        patch = shell.patch
        dots = MarkerImages(
            shell=shell,
            camera=sensor.camera,
            rest_mm=layout.rest_mm,
            radius_mm=layout.radius_mm,
            height_mm=layout.height_mm,
        )
        reach_mm = 0.5 * np.array(patch.size_mm) - self.clamp_thickness * thickness_mm
        inner_mm = self._half_mm(layout, self.inner_pitch) if sheet.is_assumed else reach_mm
        off_mm = np.abs(patch.place_mm - np.array(patch.centre_mm))
        is_beyond = self._is_beyond(layout, sheet, patch)
        element_mm = np.array(patch.size_mm) / np.array(patch.elements)
        seen_mm2_per_px, compliance_per_mm = _node_responses(dots, pitch_mm)
        return InversionModel(
            camera=sensor.camera,
            layout=layout,
            patch=patch,
            shell=shell,
            dots=dots,
            stretched=_stretched(dots),
            normal_equations=NormalEquations(shell=shell, dots=dots),
            nodes=ForceNodes(
                shape=patch.shape,
                place_mm=patch.place_mm,
                element_mm=element_mm,
                own_spread_mm2=element_mm**2 / 3.0 - 2.0 * shell.shear_mm2,
                inner_mm=read_only(inner_mm),
                force_unit_mm2=pitch_mm * thickness_mm,
                least_seen_px=self.least_stds * usual_std_px,
                seen_mm2_per_px=seen_mm2_per_px,
                is_beyond=read_only(is_beyond),
                compliance_per_mm=compliance_per_mm,
                stiffening=_stiffening(shell),
            ),
            pitch_mm=pitch_mm,
            thickness_mm=thickness_mm,
            thickness_std_mm=float((sheet.is_assumed and sheet.thickness_std_mm) or np.nan),
            young_MPa=sheet.young_MPa if sensor.scale_is_known else None,
            weight_mm2=_weight_mm2(shell, sheet, sensor.scale_is_known),
            young_relative_std=_young_relative_std(sheet),
            is_excluded=read_only((off_mm > reach_mm).any(axis=1) | is_beyond),
            inner_markers=int(
                (np.abs(layout.rest_mm[:, :2]) < self._half_mm(layout, -1.5)).all(axis=1).sum()
            ),
            is_assumed=sheet.is_assumed,
            assumed_depth_std=self._assumed_depth_std(sensor, sheet),
        )

    def _assumed_depth_std(self, sensor: Sensor, sheet: Sheet) -> float:
        """`InversionModel.assumed_depth_std`."""
        view = self.assumed_view_std if view_is_assumed(sensor) else 0.0
        if not sheet.is_assumed:
            return view
        thickness = self.thickness_depth * (sheet.thickness_std_mm or 0.0) / sheet.thickness_mm
        return float(np.hypot(view, thickness))

    def _patch(self, layout: Layout, sheet: Sheet) -> SplinePatch:
        """The whole sheet, or all of the model of an assumed one."""
        size_mm, thickness_mm = sheet.size_mm, sheet.thickness_mm
        if sheet.is_assumed:
            size_mm = 2.0 * self._half_mm(layout, self.margin_pitch)
        longest_mm = np.minimum(layout.pitch_mm, self.element_thickness * thickness_mm)
        longest_mm = np.maximum(longest_mm, self.min_element_thickness * thickness_mm)
        count = np.maximum(np.rint(size_mm / longest_mm), 4)
        count = np.maximum(np.floor(count * min(1.0, np.sqrt(self.max_elements / np.prod(count)))), 4)
        return SplinePatch(
            size_mm=(float(size_mm[0]), float(size_mm[1])), elements=(int(count[0]), int(count[1]))
        )

    def _half_mm(self, layout: Layout, beyond_pitch: float) -> Scalars:
        """(2,) distance from the origin of what is so many pitches beyond the outermost markers."""
        return np.asarray(np.abs(layout.rest_mm[:, :2]).max(axis=0) + beyond_pitch * layout.pitch_mm)

    def _is_beyond(self, layout: Layout, sheet: Sheet, patch: SplinePatch) -> Mask:
        """`ForceNodes.is_beyond`."""
        if not sheet.is_assumed:
            return np.zeros(len(patch.place_mm), dtype=np.bool_)
        half_mm = self._half_mm(layout, self.beyond_pitch)
        return np.asarray((np.abs(patch.place_mm) > half_mm).any(axis=1))

    def _shell(self, patch: SplinePatch, sheet: Sheet) -> Shell:
        """The shell; its pretension is 0 where E is not known."""
        tension, young, stretched_mm = sheet.pretension_N_per_mm, sheet.young_MPa, 0.0
        if tension is not None and young is not None:
            stretched_mm = tension / young
        return Shell(
            patch=patch,
            thickness_mm=sheet.thickness_mm,
            poisson=self.poisson if sheet.poisson is None else sheet.poisson,
            pretension_over_E_mm=stretched_mm,
            bending_factor=1.0 if sheet.bending_factor is None else sheet.bending_factor,
        )


def _stretched(dots: MarkerImages) -> MarkerImages:
    shell = dots.shell
    over_E_mm = shell.pretension_over_E_mm + PRETENSION_STEP_MM
    return dots.changed(shell=replace(shell, pretension_over_E_mm=over_E_mm))


def _node_responses(dots: MarkerImages, width_mm: float) -> tuple[float, Scalars]:
    """`ForceNodes.seen_mm2_per_px`, by a press on a square patch of this width, and `compliance_per_mm`."""
    shell, patch = dots.shell, dots.shell.patch
    offset_mm = 0.25 * width_mm * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    load = patch.load(np.array(patch.centre_mm) + offset_mm, np.tile([0.0, 0.0, 0.25], (4, 1)))
    at_rest, tangent, force = np.zeros_like(load), shell.empty_tangent(), np.empty_like(load)
    shell.forces_and_tangent(at_rest, force, tangent)
    moved = tangent_factor(shell, tangent).solve((load * patch.is_free).reshape(1, -1))[0].reshape(-1, 3)
    moved_px = np.einsum("mank,mnk->ma", dots.derivative_px(at_rest), moved[dots.tips.basis.node])
    seen_mm2_per_px = 1.0 / max(float(np.linalg.norm(moved_px)), np.finfo(np.float64).tiny)
    return seen_mm2_per_px, read_only(compliances_at_rest(shell, tangent))


def _stiffening(shell: Shell) -> float:
    """Growth of the stiffness of a clamped sheet in its first mode over the mean square of its slopes.

    The mean membrane force of a sheet with immovable edges is E t / (4 (1 - nu)) times the mean square slope
    (that of H. M. Berger 1955, doi:10.1115/1.4011138, but for the mean over both axes). The stiffnesses by
    bending and by tension are those of products of clamped beam functions (G. B. Warburton 1954,
    doi:10.1243/PIME_PROC_1954_168_040_02).
    """
    x_mm, y_mm = shell.patch.size_mm
    bending = _CLAMPED_BENDING * (x_mm**-4 + y_mm**-4) + 2.0 * (_CLAMPED_TENSION / (x_mm * y_mm)) ** 2
    tension = _CLAMPED_TENSION * (x_mm**-2 + y_mm**-2)
    rigidity_mm3 = shell.bending_factor * shell.thickness_mm**3 / (12.0 * (1.0 - shell.poisson**2))
    stretched_mm = shell.thickness_mm / (4.0 * (1.0 - shell.poisson))
    return stretched_mm * tension / (rigidity_mm3 * bending + shell.pretension_over_E_mm * tension)


def _weight_mm2(shell: Shell, sheet: Sheet, scale_is_known: bool) -> Scalars:
    """`InversionModel.weight_mm2`."""
    if sheet.young_MPa is None or not scale_is_known:
        return read_only(np.zeros(shell.patch.node_count))
    density_kg_m3 = USUAL_DENSITY_KG_M3 if sheet.density_kg_m3 is None else sheet.density_kg_m3
    weight_MPa = density_kg_m3 * GRAVITY_M_S2 * shell.thickness_mm * 1e-9
    return read_only(weight_MPa / sheet.young_MPa * shell.patch.area_mm2)


def _young_relative_std(sheet: Sheet) -> float:
    std = sheet_std(sheet).young_MPa
    return 0.0 if std is None or sheet.young_MPa is None else std / sheet.young_MPa


def checked_layout(sensor: Sensor) -> Layout:
    """The layout of a sensor.

    Raises:
        SensorError: it has none.
        LayoutError: it has fewer than `MIN_MARKERS` markers.
    """
    layout = sensor.layout
    if layout is None:
        raise SensorError(
            f"sensor {sensor.name!r} has no [markers], but the method mechanics needs their layout: "
            "run `manytouch calibrate rest` first"
        )
    if len(layout.rest_mm) < MIN_MARKERS:
        raise LayoutError(
            f"the layout of sensor {sensor.name!r} has {len(layout.rest_mm)} markers, but the method "
            f"mechanics needs at least {MIN_MARKERS}: choose a region with more of them, "
            "or --method perimeter"
        )
    return layout
