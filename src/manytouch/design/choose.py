"""Chooses the dimensions of a sensor from requirements, with the reason for each choice."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from manytouch.calibration.sheet.fit import STIFFNESS_PRIOR_STD
from manytouch.design.deflection import DeflectionCurve, deflection_curve
from manytouch.design.materials import MATERIALS, POISSON, Material
from manytouch.design.requirements import DesignError, Requirements
from manytouch.design.spacing import largest_height_mm, largest_radius_mm, smallest_pitch_mm
from manytouch.design.stand_off import StandOff, focal_px, stand_off, vfov_rad
from manytouch.values import Camera, Layout, Sensor, Sheet
from manytouch.values.arrays import read_only

MIN_RIM_MM = 10.0
RIM_THICKNESSES, RIM_PITCHES = 2.0, 1.5
"""Contact forces cannot be separated from clamp forces within two thicknesses of the clamp; a press moves
markers within 1.5 pitches."""
VIEW_MARGIN = 1.03
MIN_RADIUS_PX = 3.0
MIN_GAP_PX = 3.0
RESOLUTION_PITCHES = 2.0
"""Two-point resolution in pitches (docs/metrics.md)."""
MAX_PITCH_MM = 6.0
RADIUS_PER_PITCH = 0.25
THICKNESSES_MM = (2.0, 3.0, 4.0)
STRENGTH_SHARE = 0.5
"""The sheet is stretched to at most this share of its strength."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reason:
    """A choice.

    Attributes:
        about: the dimension or part.
        chosen: its value, with the unit.
        why: one or two sentences with the decisive numbers.
    """

    about: str
    chosen: str
    why: str


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Design:
    """A sensor that satisfies requirements.

    Attributes:
        requirements: of the sensor.
        sensor: as designed; its forces are only calibrated after `calibrate sheet`.
        material: of the sheet.
        curve: depth in the middle of the sheet under increasing force.
        stand_off: of the camera.
        reasons: in the order of the choices.
    """

    requirements: Requirements
    sensor: Sensor
    material: Material
    curve: DeflectionCurve
    stand_off: StandOff
    reasons: tuple[Reason, ...] = ()

    @property
    def mm_per_px(self) -> float:
        """Size of a pixel on the sheet at rest."""
        return float(self.sensor.camera.translation_mm[2]) / self.sensor.camera.fx_px

    @property
    def depth_at_most_mm(self) -> float:
        """Depth under the largest force."""
        return self.curve.depth_at(self.requirements.force_N[1] / self.material.young_MPa)

    @property
    def depth_at_least_mm(self) -> float:
        """Depth under the smallest force."""
        return self.curve.depth_at(self.requirements.force_N[0] / self.material.young_MPa)


def design_sensor(requirements: Requirements, *, on_message: Callable[[str], object] | None = None) -> Design:
    """Choose a sheet, its markers and the stand-off of the camera.

    Args:
        requirements: of the sensor.
        on_message: receives progress messages; the computation takes some seconds.

    Raises:
        DesignError: no sensor satisfies the requirements; the message names the one that conflicts and a
            remedy.
    """
    material, curve = _sheet(requirements, on_message)
    size = curve.size_mm
    off = _stand_off(requirements, size)
    distance_mm = math.ceil(10 * off.distance_mm) / 10
    focal = focal_px(requirements.camera.width_px, math.radians(requirements.camera.hfov_deg))
    mm_per_px = distance_mm / focal
    pitch, radius = _markers(requirements, mm_per_px)
    _check_gaps(requirements, curve, pitch, radius, MIN_GAP_PX * mm_per_px)
    sheet = Sheet(
        size_mm=read_only(np.array(size)),
        thickness_mm=curve.thickness_mm,
        young_MPa=round(material.young_MPa, 3),
        young_std_MPa=round(STIFFNESS_PRIOR_STD * material.young_MPa, 3),
        poisson=POISSON,
        bending_factor=1.0,
        density_kg_m3=material.density_kg_m3,
    )
    sensor = Sensor(
        name=f"designed sheet {size[0]:g} x {size[1]:g} mm",
        camera=_camera(requirements, focal, distance_mm),
        layout=lattice(size, pitch, radius, requirements.marker_height_mm),
        sheet=sheet,
        provenance={"origin": "designed", "material": f"{material.name} (nominal stiffness; calibrate it)"},
    )
    found = Design(requirements=requirements, sensor=sensor, material=material, curve=curve, stand_off=off)
    return replace(found, reasons=tuple(_reasons(found)))


def _stand_off(requirements: Requirements, size: tuple[float, float]) -> StandOff:
    camera = requirements.camera
    hfov = math.radians(camera.hfov_deg)
    off = stand_off(
        view_mm=(VIEW_MARGIN * size[0], VIEW_MARGIN * size[1]),
        hfov_rad=hfov,
        vfov_rad=vfov_rad(camera.width_px, camera.height_px, hfov),
        least_focus_mm=camera.least_focus_mm + requirements.deepest_mm,
    )
    if off.distance_mm < 3 * requirements.deepest_mm:
        raise DesignError(
            f"a press of {requirements.deepest_mm:g} mm comes too close to a camera {off.distance_mm:.0f} mm "
            "away: reduce the deepest press, or use a camera with a narrower field of view"
        )
    return off


def rim_mm(requirements: Requirements, thickness_mm: float) -> float:
    """Distance between the clamp line and the touchable area, mm."""
    reach_mm = RIM_THICKNESSES * thickness_mm + RIM_PITCHES * _pitch_mm(requirements)
    return max(MIN_RIM_MM, math.ceil(2 * reach_mm) / 2)


def _pitch_mm(requirements: Requirements) -> float:
    return min(requirements.separation_mm / RESOLUTION_PITCHES, MAX_PITCH_MM)


def _markers(requirements: Requirements, mm_per_px: float) -> tuple[float, float]:
    """Pitch and radius of the markers, mm."""
    pitch = _pitch_mm(requirements)
    least = max(MIN_RADIUS_PX * mm_per_px, requirements.printer.nozzle_mm)
    radius = max(RADIUS_PER_PITCH * pitch, least)
    if pitch - 2 * radius < max(2 * requirements.printer.nozzle_mm, MIN_GAP_PX * mm_per_px):
        raise DesignError(
            f"contacts {requirements.separation_mm:g} mm apart need markers every {pitch:.2g} mm, but a "
            "marker "
            f"that the camera resolves ({mm_per_px:.3f} mm per px) and the printer prints "
            f"({requirements.printer.nozzle_mm:g} mm lines) is {2 * radius:.2g} mm wide: use a larger "
            "separation, a smaller area, or a camera with more pixels"
        )
    return pitch, radius


def _sheet(
    requirements: Requirements, on_message: Callable[[str], object] | None
) -> tuple[Material, DeflectionCurve]:
    """The softest combination of material and thickness that supports the largest force."""
    materials = [item for item in MATERIALS if requirements.material in (None, item.name)]
    if not materials:
        raise DesignError(
            f"the material {requirements.material!r} is not known; choose one of "
            f"{', '.join(repr(item.name) for item in MATERIALS)}"
        )
    thicknesses = THICKNESSES_MM if requirements.thickness_mm is None else (requirements.thickness_mm,)
    found: list[tuple[float, Material, DeflectionCurve]] = []
    stiffest = (math.inf, "")
    for thickness in thicknesses:
        if on_message is not None:
            on_message(f"computing the deflection of a sheet of {thickness:g} mm")
        rim = rim_mm(requirements, thickness)
        size = (requirements.area_mm[0] + 2 * rim, requirements.area_mm[1] + 2 * rim)
        curve = deflection_curve(
            size_mm=size, thickness_mm=thickness, poisson=POISSON, deepest_mm=requirements.deepest_mm
        )
        for material in materials:
            depth = curve.depth_at(requirements.force_N[1] / material.young_MPa)
            stress_MPa = material.young_MPa * curve.strain_at(depth)
            stiffest = min(stiffest, (depth, f"{material.name}, {thickness:g} mm thick"))
            if depth <= requirements.deepest_mm and stress_MPa <= STRENGTH_SHARE * material.strength_MPa:
                found.append((depth, material, curve))
    if not found:
        raise DesignError(
            f"no sheet supports {requirements.force_N[1]:g} N on 1 cm² within {requirements.deepest_mm:g} "
            "mm: the "
            f"stiffest, {stiffest[1]}, is pressed {stiffest[0]:.1f} mm deep; allow a deeper press, a "
            "smaller force "
            "or area, or a thicker sheet"
        )
    _, material, curve = max(found, key=lambda item: item[0])
    return material, curve


def _check_gaps(
    requirements: Requirements, curve: DeflectionCurve, pitch: float, radius: float, least_mm: float
) -> None:
    gap = curve.smallest_gap_mm(
        pitch_mm=pitch,
        radius_mm=radius,
        height_mm=requirements.marker_height_mm,
        depth_mm=requirements.deepest_mm,
    )
    if gap < least_mm:
        height = min(
            largest_height_mm(
                pitch_mm=pitch, radius_mm=radius, gap_mm=least_mm, slope_rad=slope, turn_rad=turn
            )
            for slope, turn in curve.pairs_rad(pitch, requirements.deepest_mm)
        )
        raise DesignError(
            f"under a press of {requirements.deepest_mm:g} mm the gap between markers "
            f"{requirements.marker_height_mm:g} "
            f"mm high is {max(gap, 0):.2f} mm, less than the {least_mm:.2f} mm that the camera resolves: "
            "make "
            f"them at most {height:.1f} mm high, or use a larger separation"
        )


def _camera(requirements: Requirements, focal: float, distance_mm: float) -> Camera:
    camera = requirements.camera
    return Camera(
        width_px=camera.width_px,
        height_px=camera.height_px,
        fx_px=focal,
        fy_px=focal,
        cx_px=(camera.width_px - 1) / 2,
        cy_px=(camera.height_px - 1) / 2,
        distortion=read_only(np.zeros(5)),
        rotation_vector=read_only(np.zeros(3)),
        translation_mm=read_only(np.array([0.0, 0.0, distance_mm])),
    )


def lattice(size: tuple[float, float], pitch: float, radius: float, height: float) -> Layout:
    """A lattice of light markers that fills a sheet; all arguments in mm."""
    columns, rows = (int(side / pitch + 1e-9) for side in size)
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    rest = np.zeros((rows * columns, 3))
    rest[:, 0] = (column - (columns - 1) / 2) * pitch
    rest[:, 1] = (row - (rows - 1) / 2) * pitch
    return Layout(
        rest_mm=read_only(rest),
        row_column=read_only(np.column_stack([row, column]).astype(np.int64)),
        pitch_mm=read_only(np.array([pitch, pitch])),
        radius_mm=read_only(np.full(len(rest), radius)),
        height_mm=height,
        polarity="light",
        is_missing=read_only(np.zeros(len(rest), dtype=np.bool_)),
    )


def _room(found: Design, layout: Layout) -> Reason:
    """The gap by equation 1 where it is smallest, and the limits of pitch, radius and height."""
    deepest_mm, least_mm = found.requirements.deepest_mm, MIN_GAP_PX * found.mm_per_px
    d, r, h = float(layout.pitch_mm[0]), float(layout.radius_mm[0]), layout.height_mm
    gap = found.curve.smallest_gap_mm(pitch_mm=d, radius_mm=r, height_mm=h, depth_mm=deepest_mm)
    pairs = [
        {"gap_mm": least_mm, "slope_rad": slope, "turn_rad": turn}
        for slope, turn in found.curve.pairs_rad(d, deepest_mm)
    ]
    pitch = max(smallest_pitch_mm(radius_mm=r, height_mm=h, **pair) for pair in pairs)
    radius = min(largest_radius_mm(pitch_mm=d, height_mm=h, **pair) for pair in pairs)
    height = min(largest_height_mm(pitch_mm=d, radius_mm=r, **pair) for pair in pairs)
    steepest = max(abs(pair["slope_rad"]) for pair in pairs)
    turn = max(pair["turn_rad"] for pair in pairs)
    return Reason(
        about="gap between markers",
        chosen=f"{gap:.2f} mm ({gap / found.mm_per_px:.1f} px) at a press of {deepest_mm:g} mm",
        why=f"smallest gap by equation 1 for all pairs of a row; the largest slope is "
        f"{math.degrees(steepest):.0f} degrees and changes by {math.degrees(turn):.0f} degrees within a "
        "pitch. "
        f"The gap would be {MIN_GAP_PX:g} px with markers every {pitch:.1f} mm, or with a radius of "
        f"{radius:.1f} mm, or {height:.0f} mm high",
    )


def _reasons(found: Design) -> Iterator[Reason]:
    requirements, sensor, off = found.requirements, found.sensor, found.stand_off
    sheet, layout, camera = sensor.sheet, sensor.layout, requirements.camera
    assert sheet is not None and layout is not None and layout.shape is not None  # noqa: PT018
    x, y = (float(side) for side in sheet.size_mm)
    yield Reason(
        about="clamped outline",
        chosen=f"{x:g} x {y:g} mm",
        why=f"the area of {requirements.area_mm[0]:g} x {requirements.area_mm[1]:g} mm and a rim of "
        f"{rim_mm(requirements, sheet.thickness_mm):g} mm: {RIM_THICKNESSES:g} thicknesses, because contact "
        "forces cannot be separated from clamp forces there, and the "
        f"{RIM_PITCHES:g} pitches within which a press moves markers",
    )
    yield Reason(
        about="stand-off of the camera",
        chosen=f"{sensor.camera.translation_mm[2]:.1f} mm",
        why=f"the outline fills the width of the image at {off.width_mm:.1f} mm and its height at "
        f"{off.height_mm:.1f} mm (equations 2 and 3), and the deepest press is in focus from "
        f"{off.focus_mm:.1f} mm on (equation 4, as d > F); the {off.limit} is the limit. One pixel is "
        f"{found.mm_per_px:.4f} mm",
    )
    yield Reason(
        about="markers",
        chosen=f"{layout.shape[0]} x {layout.shape[1]}, every {layout.pitch_mm[0]:g} mm, radius "
        f"{layout.radius_mm[0]:.2f} mm ({layout.radius_mm[0] / found.mm_per_px:.1f} px)",
        why=f"the two-point resolution of {requirements.separation_mm:g} mm is {RESOLUTION_PITCHES:g} "
        "pitches; the "
        f"radius is a quarter of the pitch, and at least {MIN_RADIUS_PX:g} px and one printed line",
    )
    yield _room(found, layout)
    stress = found.material.young_MPa * found.curve.strain_at(found.depth_at_most_mm)
    yield Reason(
        about="sheet",
        chosen=f"{found.material.name}, {sheet.thickness_mm:g} mm thick, E about "
        f"{found.material.young_MPa:.2g} MPa",
        why=f"the softest that supports {requirements.force_N[1]:g} N on 1 cm² within "
        f"{requirements.deepest_mm:g} mm: {found.depth_at_most_mm:.1f} mm, and "
        f"{1e3 * found.depth_at_least_mm:.0f} µm under "
        f"{requirements.force_N[0]:g} N; its largest strain is "
        f"{100 * found.curve.strain_at(found.depth_at_most_mm):.0f} %, at a stress of about {stress:.1f} "
        "MPa; it breaks at "
        f"{found.material.strength_MPa:g} MPa",
    )
    yield Reason(about="frame rate", chosen=f"{camera.fps:g} per second", why="of the camera at this size")
