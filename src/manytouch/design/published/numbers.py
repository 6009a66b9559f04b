"""The design numbers of the paper: Table 1 and Figure 2, equation 1, equations 2 to 4.

The paper prints thickness, Poisson's ratio, density, force and depth of its press, and the distance of the
camera. It does not print the size of the sheet, pitch, radius and height of the markers, or the field of view
of the camera: these are assumed here, and labelled as such.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from manytouch.design.deflection import DeflectionCurve, deflection_curve
from manytouch.design.dimensions import MIN_MARKER_GAP_PX, Design, Reason, light_lattice
from manytouch.design.materials import MATERIALS
from manytouch.design.requirements import CameraSpecification, Requirements
from manytouch.design.spacing import gap_mm, largest_radius_mm, smallest_pitch_mm
from manytouch.design.stand_off import StandOff, focal_px, stand_off, vfov_rad
from manytouch.values import Camera, Sensor, Sheet
from manytouch.values.arrays import read_only

THICKNESS_MM, POISSON, DENSITY_KG_M3, FORCE_N = 3.0, 0.45, 960.0, 10.0
DEPTH_MM, DISTANCE_MM, FOCUS_MM = 10.1, 116.3, 100.0
"""Printed in the paper."""

PRINTED_MPA, GPA_MPA = 0.01, 10.0
"""Table 1 prints 0.01 N/mm². 0.01 GPa, which would be a slip of the unit, is 10 N/mm²."""

SIZES_MM = ((120.0, 80.0), (70.0, 70.0))
PITCH_MM, RADIUS_MM, HEIGHT_MM = 4.0, 1.0, 1.0
HEIGHTS_MM = (0.0, HEIGHT_MM, 2.0)
WIDTH_PX, HEIGHT_PX = 2560, 1440
"""Assumed, except the size of the image (section 4). Table 3 measures up to 115 mm on the sheet; the markers
of Figure 3 stand on it."""

MATERIAL = next(item for item in MATERIALS if item.name == "TPU, Shore A 60")
"""TPU is the paper's choice; this one has the tensile strength of Table 1, 20 N/mm²."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModulusReading:
    """Table 1 with one reading of its elastic modulus, on one sheet.

    Attributes:
        size_mm: of the sheet.
        young_MPa: as read.
        linear_mm: depth of 10 N on 1 cm² if small forces could be scaled up.
        depth_mm: with large deflection; None: beyond 1.5 times the printed depth.
        linear_young_MPa, large_young_MPa: moduli with which the two models give the printed depth.
    """

    size_mm: tuple[float, float]
    young_MPa: float
    linear_mm: float
    depth_mm: float | None
    linear_young_MPa: float
    large_young_MPa: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallestGap:
    """Equation 1 on the printed press, at the pair of markers with the smallest gap.

    Attributes:
        height_mm: of the markers.
        slope_deg, turn_deg: theta and its change within a pitch.
        corrected_mm, printed_mm: the gap, with the fourth term corrected and as printed.
        smallest_pitch_mm, largest_radius_mm: at which the gap would be 3 px.
    """

    height_mm: float
    slope_deg: float
    turn_deg: float
    corrected_mm: float
    printed_mm: float
    smallest_pitch_mm: float
    largest_radius_mm: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperDesign:
    """All numbers, and the sensor that they describe.

    Attributes:
        moduli: Table 1, both readings on each sheet.
        curves: depth against force over modulus, Figure 2, of each sheet.
        spacings: equation 1 for some heights of the markers.
        hfov_deg: assumed: that at which the height of the sheet fills the image at the printed distance.
        stand_off: equations 2 to 4 with it.
        design: the sensor, for `write_design`.
    """

    moduli: tuple[ModulusReading, ...]
    curves: tuple[DeflectionCurve, ...]
    spacings: tuple[SmallestGap, ...]
    hfov_deg: float
    stand_off: StandOff
    design: Design


def paper_design(on_message: Callable[[str], object] | None = None) -> PaperDesign:
    """Compute everything; takes some seconds."""
    curves = []
    for size_mm in SIZES_MM:
        if on_message is not None:
            on_message(f"computing the deflection of a sheet of {size_mm[0]:g} x {size_mm[1]:g} mm")
        curves.append(
            deflection_curve(
                size_mm=size_mm, thickness_mm=THICKNESS_MM, poisson=POISSON, deepest_mm=1.5 * DEPTH_MM
            )
        )
    hfov_deg = assumed_hfov_deg()
    off = stand_off(
        view_mm=SIZES_MM[0],
        hfov_rad=math.radians(hfov_deg),
        vfov_rad=vfov_rad(WIDTH_PX, HEIGHT_PX, math.radians(hfov_deg)),
        least_focus_mm=FOCUS_MM,
    )
    moduli = tuple(
        modulus_reading(curve, young_MPa) for curve in curves for young_MPa in (PRINTED_MPA, GPA_MPA)
    )
    sensor = _sensor(hfov_deg, moduli[0].large_young_MPa)
    mm_per_px = DISTANCE_MM / sensor.camera.fx_px
    spacings = tuple(
        marker_spacing(curves[0], height_mm, MIN_MARKER_GAP_PX * mm_per_px) for height_mm in HEIGHTS_MM
    )
    design = Design(
        requirements=Requirements(
            area_mm=SIZES_MM[0],
            deepest_mm=DEPTH_MM,
            force_N=(0.1, FORCE_N),
            camera=CameraSpecification(
                width_px=WIDTH_PX, height_px=HEIGHT_PX, hfov_deg=hfov_deg, least_focus_mm=FOCUS_MM
            ),
            marker_height_mm=HEIGHT_MM,
            thickness_mm=THICKNESS_MM,
        ),
        sensor=sensor,
        material=MATERIAL,
        curve=curves[0],
        stand_off=off,
    )
    found = PaperDesign(
        moduli=moduli,
        curves=tuple(curves),
        spacings=spacings,
        hfov_deg=hfov_deg,
        stand_off=off,
        design=design,
    )
    return replace(found, design=replace(design, reasons=reasons(found)))


def assumed_hfov_deg() -> float:
    """Field of view at which the height of the sheet fills the image at 116.3 mm; degrees."""
    tangent = 0.5 * SIZES_MM[0][1] / DISTANCE_MM * WIDTH_PX / HEIGHT_PX
    return math.degrees(2.0 * math.atan(tangent))


def modulus_reading(curve: DeflectionCurve, young_MPa: float) -> ModulusReading:
    """Depth of 10 N on 1 cm² for a modulus, and the moduli that give the printed depth."""
    per_mm2 = float(curve.depth_mm[0] / curve.force_over_E_mm2[0])
    ratio_mm2 = FORCE_N / young_MPa
    return ModulusReading(
        size_mm=curve.size_mm,
        young_MPa=young_MPa,
        linear_mm=per_mm2 * ratio_mm2,
        depth_mm=curve.depth_at(ratio_mm2) if ratio_mm2 <= curve.force_over_E_mm2[-1] else None,
        linear_young_MPa=per_mm2 * FORCE_N / DEPTH_MM,
        large_young_MPa=FORCE_N / curve.force_over_E_at(DEPTH_MM),
    )


def marker_spacing(curve: DeflectionCurve, height_mm: float, least_gap_mm: float) -> SmallestGap:
    """Equation 1 where the gap is smallest, on a press of the printed depth."""
    pairs = curve.pairs_rad(PITCH_MM, DEPTH_MM)

    def gap(pair: tuple[float, float]) -> float:
        return gap_mm(
            pitch_mm=PITCH_MM, radius_mm=RADIUS_MM, height_mm=height_mm, slope_rad=pair[0], turn_rad=pair[1]
        )

    slope, turn = min(pairs, key=gap)
    # equation 1 as printed has cos instead of sin in its fourth term
    misprint_mm = height_mm * (math.sin(slope + turn) - math.cos(slope + turn))
    limits = [{"gap_mm": least_gap_mm, "slope_rad": one, "turn_rad": change} for one, change in pairs]
    return SmallestGap(
        height_mm=height_mm,
        slope_deg=math.degrees(slope),
        turn_deg=math.degrees(turn),
        corrected_mm=gap((slope, turn)),
        printed_mm=gap((slope, turn)) + misprint_mm,
        smallest_pitch_mm=max(
            smallest_pitch_mm(radius_mm=RADIUS_MM, height_mm=height_mm, **limit) for limit in limits
        ),
        largest_radius_mm=min(
            largest_radius_mm(pitch_mm=PITCH_MM, height_mm=height_mm, **limit) for limit in limits
        ),
    )


def reasons(found: PaperDesign) -> tuple[Reason, ...]:
    """Every number with its equation, table or figure, and what of it is assumed."""
    off, first = found.stand_off, found.moduli[0]
    x_mm, y_mm = SIZES_MM[0]
    gap = next(one for one in found.spacings if one.height_mm == HEIGHT_MM)
    small = next(one for one in found.moduli if one.size_mm == SIZES_MM[1])
    return (
        Reason(
            about="sheet (Table 1)",
            chosen=f"{THICKNESS_MM:g} mm thick, Poisson's ratio {POISSON:g}, {DENSITY_KG_M3:g} kg/m³; "
            f"assumed: {x_mm:g} x {y_mm:g} mm",
            why="the paper prints no outline; Table 3 measures 115 mm on it",
        ),
        Reason(
            about="elastic modulus (Table 1, Figure 2)",
            chosen=f"{first.large_young_MPa:.1f} MPa gives {DEPTH_MM:g} mm under {FORCE_N:g} N on 1 cm²",
            why=f"printed: {PRINTED_MPA:g} N/mm², with which a linear model would be "
            f"{first.linear_mm / 1000:.0f} m deep. Read as {PRINTED_MPA:g} GPa = {GPA_MPA:g} N/mm², a linear "
            f"model of a sheet of {SIZES_MM[1][0]:g} x {SIZES_MM[1][1]:g} mm is "
            f"{small.linear_young_MPa / GPA_MPA * DEPTH_MM:.1f} mm deep, so a slip of the unit is "
            "likely. With large deflection, in which the sheet stretches, it takes a softer material",
        ),
        Reason(
            about="markers (Figure 3, equation 1)",
            chosen=f"assumed: every {PITCH_MM:g} mm, radius {RADIUS_MM:g} mm, {HEIGHT_MM:g} mm high; gap "
            f"{gap.corrected_mm:.2f} mm",
            why=f"on that press a marker's base is inclined by {abs(gap.slope_deg):.0f} degrees where the "
            f"gap is smallest; it would be {MIN_MARKER_GAP_PX:g} px with markers every "
            f"{gap.smallest_pitch_mm:.2f} mm or a radius of {gap.largest_radius_mm:.2f} mm",
        ),
        Reason(
            about="distance of the camera (equations 2 to 4)",
            chosen=f"{off.distance_mm:.1f} mm",
            why=f"d1 = {off.width_mm:.1f} mm, d2 = {off.height_mm:.1f} mm, F = {off.focus_mm:g} mm; the "
            f"{off.limit} is the limit, and d > F (printed d < F). Assumed: a horizontal field of view of "
            f"{found.hfov_deg:.1f} degrees, with which {y_mm:g} mm fill the height of the image at the "
            f"printed {DISTANCE_MM:g} mm",
        ),
    )


def _sensor(hfov_deg: float, young_MPa: float) -> Sensor:
    focal = focal_px(WIDTH_PX, math.radians(hfov_deg))
    return Sensor(
        name="sheet of the paper",
        camera=Camera(
            width_px=WIDTH_PX,
            height_px=HEIGHT_PX,
            fx_px=focal,
            fy_px=focal,
            cx_px=0.5 * (WIDTH_PX - 1),
            cy_px=0.5 * (HEIGHT_PX - 1),
            distortion=read_only(np.zeros(5)),
            rotation_vector=read_only(np.zeros(3)),
            translation_mm=read_only(np.array([0.0, 0.0, DISTANCE_MM])),
        ),
        layout=light_lattice(SIZES_MM[0], PITCH_MM, RADIUS_MM, HEIGHT_MM),
        sheet=Sheet(
            size_mm=read_only(np.array(SIZES_MM[0])),
            thickness_mm=THICKNESS_MM,
            young_MPa=round(young_MPa, 3),
            poisson=POISSON,
            bending_factor=1.0,
            density_kg_m3=DENSITY_KG_M3,
        ),
        provenance={"origin": "numbers of the paper; outline, markers and field of view are assumed"},
    )
