"""The mechanical model of a sensor's sheet, with nominal values for what the sensor does not state."""

from dataclasses import dataclass

import numpy as np

from manytouch.errors import LayoutError, SensorError
from manytouch.estimation.mechanics.force_clusters import ForceLattice
from manytouch.geometry.spline.patch import Nodal, PointBasis, SplinePatch
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell.shell import THICK_BENDING, Shell
from manytouch.mechanics.solver.normal_equations import NormalEquations
from manytouch.values import Camera, Layout, Sensor, Sheet, SheetSpline
from manytouch.values.arrays import Mask, read_only

MIN_MARKERS = 12


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InversionModel:
    """Everything about the sheet that stays the same between frames.

    Attributes:
        camera, layout: of the sensor.
        patch: spline patch of the middle surface.
        shell: energy and forces of the sheet.
        dots: marker images.
        normal_equations: of the inversion.
        lattice: of the nodes.
        nodes: basis functions at the Greville points of the nodes.
        pitch_mm: geometric mean of both pitches of the layout.
        thickness_mm: of the sheet.
        young_MPa: None if forces are relative, over E.
        young_relative_std: its standard deviation over its value.
        is_outside: (n,) nodes whose forces may be those of the unknown sheet beyond the markers.
        is_excluded: (n,) these, and nodes so near a clamp that they have its forces.
        is_nominal: whether thickness and outline were assumed.
    """

    camera: Camera
    layout: Layout
    patch: SplinePatch
    shell: Shell
    dots: MarkerImages
    normal_equations: NormalEquations
    lattice: ForceLattice
    nodes: PointBasis
    pitch_mm: float
    thickness_mm: float
    young_MPa: float | None
    young_relative_std: float
    is_outside: Mask
    is_excluded: Mask
    is_nominal: bool

    def spline(self, coefficient_mm: Nodal, force_mm2: Nodal) -> SheetSpline:
        """Shape (n, 3) and nodal forces over E (n, 3) as a value."""
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
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NominalSheet:
    """Nominal properties of a sheet, and the size of its elements.

    Attributes:
        poisson: Poisson's ratio if the sensor does not state it; that of nearly incompressible rubber.
        thickness_pitch: thickness if the sensor does not state it, in pitches.
        margin_pitch: distance from the outer markers to the outline if it is not known, in pitches.
        element_thickness: largest length of an element, in thicknesses; at most one pitch.
        max_elements: largest number of elements; if it is exceeded, elements are longer.
        clamp_thickness: contacts with a centre within this distance of a clamp are left out, in thicknesses.
            A clamp line that is wrong by a third of it causes forces there.
    """

    poisson: float = 0.45
    thickness_pitch: float = 0.75
    margin_pitch: float = 2.5
    element_thickness: float = 1.4
    max_elements: int = 1200
    clamp_thickness: float = 2.0

    def __call__(self, sensor: Sensor) -> InversionModel:
        """The model of a sensor's sheet.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: it has too few markers.
        """
        layout = _checked_layout(sensor)
        sheet, pitch_mm = sensor.sheet, float(np.sqrt(np.prod(layout.pitch_mm)))
        is_nominal = sheet is None or sheet.is_assumed
        thickness_mm = self.thickness_pitch * pitch_mm if sheet is None else sheet.thickness_mm
        patch = self._patch(layout, None if is_nominal else sheet, thickness_mm, pitch_mm)
        shell = self._shell(patch, sheet, thickness_mm)
        dots = MarkerImages(
            shell=shell,
            camera=sensor.camera,
            rest_mm=layout.rest_mm,
            radius_mm=layout.radius_mm,
            height_mm=layout.height_mm,
        )
        low, high = layout.rest_mm[:, :2].min(axis=0), layout.rest_mm[:, :2].max(axis=0)
        slack_mm = 0.5 * layout.pitch_mm
        is_beyond_markers = ((patch.place_mm < low - slack_mm) | (patch.place_mm > high + slack_mm)).any(
            axis=1
        )
        is_outside = is_beyond_markers | patch.is_rim if is_nominal else patch.is_rim
        inner_mm = np.maximum(-low, high) + slack_mm
        if not is_nominal and sheet is not None:
            inner_mm = 0.5 * sheet.size_mm - self.clamp_thickness * thickness_mm
        return InversionModel(
            camera=sensor.camera,
            layout=layout,
            patch=patch,
            shell=shell,
            dots=dots,
            normal_equations=NormalEquations(shell=shell, dots=dots),
            lattice=ForceLattice(
                shape=patch.shape,
                place_mm=patch.place_mm,
                element_mm=np.array(patch.size_mm) / np.array(patch.elements),
                inner_mm=read_only(inner_mm),
                force_unit_mm2=pitch_mm * thickness_mm,
            ),
            nodes=patch.at(patch.place_mm),
            pitch_mm=pitch_mm,
            thickness_mm=thickness_mm,
            young_MPa=None if sheet is None or not sensor.scale_is_known else sheet.young_MPa,
            young_relative_std=_young_relative_std(sheet),
            is_outside=read_only(is_outside),
            is_excluded=read_only(is_outside | (np.abs(patch.place_mm) > inner_mm).any(axis=1)),
            is_nominal=is_nominal,
        )

    def _patch(
        self, layout: Layout, sheet: Sheet | None, thickness_mm: float, pitch_mm: float
    ) -> SplinePatch:
        """The whole sheet of the sensor file; without one, the area of the markers and a margin."""
        if sheet is not None:
            size_mm, centre_mm = sheet.size_mm, np.zeros(2)
        else:
            low, high = layout.rest_mm[:, :2].min(axis=0), layout.rest_mm[:, :2].max(axis=0)
            size_mm = high - low + 2.0 * self.margin_pitch * layout.pitch_mm
            centre_mm = 0.5 * (low + high)
        longest_mm = np.minimum(layout.pitch_mm, self.element_thickness * thickness_mm)
        count = np.maximum(np.rint(size_mm / longest_mm), 4)
        count = np.maximum(np.floor(count * min(1.0, np.sqrt(self.max_elements / np.prod(count)))), 4)
        return SplinePatch(
            size_mm=(float(size_mm[0]), float(size_mm[1])),
            elements=(int(count[0]), int(count[1])),
            boundary="clamped" if sheet is not None else "soft",
            centre_mm=(float(centre_mm[0]), float(centre_mm[1])),
        )

    def _shell(self, patch: SplinePatch, sheet: Sheet | None, thickness_mm: float) -> Shell:
        """The shell; its pretension is 0 where E is not known."""
        stretched_mm, bending, poisson = 0.0, 1.0, self.poisson
        if sheet is not None:
            poisson = self.poisson if sheet.poisson is None else sheet.poisson
            bending = 1.0 if sheet.bending_factor is None else sheet.bending_factor
            if sheet.pretension_N_per_mm is not None and sheet.young_MPa is not None:
                stretched_mm = sheet.pretension_N_per_mm / sheet.young_MPa
        return Shell(
            patch=patch,
            thickness_mm=thickness_mm,
            poisson=poisson,
            pretension_over_E_mm=stretched_mm,
            bending_factor=THICK_BENDING * bending,
        )


def _young_relative_std(sheet: Sheet | None) -> float:
    if sheet is None or sheet.young_MPa is None or sheet.young_std_MPa is None:
        return 0.0
    return sheet.young_std_MPa / sheet.young_MPa


def _checked_layout(sensor: Sensor) -> Layout:
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
