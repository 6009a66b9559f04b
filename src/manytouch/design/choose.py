"""Chooses the dimensions of a sensor from requirements."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from manytouch.calibration.sheet.fit import STIFFNESS_PRIOR_STD
from manytouch.design.deflection import DeflectionCurve, deflection_curve
from manytouch.design.dimensions import (
    LEAST_DISTANCES_PER_DEPTH,
    MIN_MARKER_GAP_PX,
    MIN_MARKER_RADIUS_PX,
    RADIUS_PER_PITCH,
    STRENGTH_SHARE,
    THICKNESSES_MM,
    VIEW_MARGIN,
    Design,
    light_lattice,
    pitch_mm,
    rim_mm,
)
from manytouch.design.materials import MATERIALS, POISSON, Material
from manytouch.design.reasons import reasons_for
from manytouch.design.requirements import DesignError, Requirements
from manytouch.design.spacing import largest_height_mm
from manytouch.design.stand_off import StandOff, focal_px, stand_off, vfov_rad
from manytouch.limits import MAX_MARKERS
from manytouch.values import Camera, Sensor, Sheet
from manytouch.values.arrays import read_only

MAX_SHEET_MM2, MAX_SIDE_MM = 1e6, 5e3
"""Largest area and side of a sheet with its rim; the deflection of the largest one takes 2 GB."""


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
    _check_gaps(requirements, curve, pitch, radius, MIN_MARKER_GAP_PX * mm_per_px)
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
        layout=light_lattice(size, pitch, radius, requirements.marker_height_mm),
        sheet=sheet,
        provenance={"origin": "designed", "material": f"{material.name} (nominal stiffness; calibrate it)"},
    )
    found = Design(requirements=requirements, sensor=sensor, material=material, curve=curve, stand_off=off)
    return replace(found, reasons=tuple(reasons_for(found)))


def _stand_off(requirements: Requirements, size: tuple[float, float]) -> StandOff:
    camera = requirements.camera
    hfov = math.radians(camera.hfov_deg)
    off = stand_off(
        view_mm=(VIEW_MARGIN * size[0], VIEW_MARGIN * size[1]),
        hfov_rad=hfov,
        vfov_rad=vfov_rad(camera.width_px, camera.height_px, hfov),
        least_focus_mm=camera.least_focus_mm + requirements.deepest_mm,
    )
    if off.distance_mm < LEAST_DISTANCES_PER_DEPTH * requirements.deepest_mm:
        raise DesignError(
            f"a press of {requirements.deepest_mm:g} mm comes too close to a camera {off.distance_mm:.0f} mm "
            "away: reduce the deepest press, or use a camera with a narrower field of view"
        )
    return off


def _markers(requirements: Requirements, mm_per_px: float) -> tuple[float, float]:
    """Pitch and radius of the markers, mm."""
    pitch = pitch_mm(requirements)
    least = max(MIN_MARKER_RADIUS_PX * mm_per_px, requirements.printer.nozzle_mm)
    radius = max(RADIUS_PER_PITCH * pitch, least)
    if pitch - 2 * radius < max(2 * requirements.printer.nozzle_mm, MIN_MARKER_GAP_PX * mm_per_px):
        raise DesignError(
            f"contacts {requirements.separation_mm:g} mm apart need markers every {pitch:.2g} mm, but a "
            f"marker that the camera resolves ({mm_per_px:.3f} mm per px) and the printer prints "
            f"({requirements.printer.nozzle_mm:g} mm lines) is {2 * radius:.2g} mm wide: use a larger "
            "separation, a smaller area, or a camera with more pixels"
        )
    return pitch, radius


def _sheet(
    requirements: Requirements, on_message: Callable[[str], object] | None
) -> tuple[Material, DeflectionCurve]:
    """The material and thickness that the largest force presses deepest, within the limits of the sheet.

    The limits are the deepest press and `STRENGTH_SHARE` of the strength of the material.

    Raises:
        DesignError: every combination exceeds a limit, or the sheet is too large to be computed.
    """
    materials = [item for item in MATERIALS if requirements.material in (None, item.name)]
    thicknesses = THICKNESSES_MM if requirements.thickness_mm is None else (requirements.thickness_mm,)
    found: list[tuple[float, Material, DeflectionCurve]] = []
    stiffest = (math.inf, "")
    for thickness in thicknesses:
        if on_message is not None:
            on_message(f"computing the deflection of a sheet of {thickness:g} mm")
        rim = rim_mm(requirements, thickness)
        size = (requirements.area_mm[0] + 2 * rim, requirements.area_mm[1] + 2 * rim)
        _check_size(requirements, size)
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
            f"mm: the stiffest, {stiffest[1]}, is pressed {stiffest[0]:.1f} mm deep; allow a deeper press, "
            "a smaller force or area, or a thicker sheet"
        )
    _, material, curve = max(found, key=lambda item: item[0])
    return material, curve


def _check_size(requirements: Requirements, size: tuple[float, float]) -> None:
    """Refuse a sheet before memory is allocated for it."""
    if size[0] * size[1] > MAX_SHEET_MM2 or max(size) > MAX_SIDE_MM:
        raise DesignError(
            f"a sheet of {size[0]:g} x {size[1]:g} mm (the area and its rim) is too large: at most "
            f"{1e-6 * MAX_SHEET_MM2:g} m² and {1e-3 * MAX_SIDE_MM:g} m along a side are designed; reduce the "
            "area, or use several sensors"
        )
    pitch = pitch_mm(requirements)
    count = math.floor(size[0] / pitch) * math.floor(size[1] / pitch)
    if count > MAX_MARKERS:
        raise DesignError(
            f"a sheet of {size[0]:g} x {size[1]:g} mm with markers every {pitch:.2g} mm has {count} markers: "
            f"at most {MAX_MARKERS} are allowed; use a larger separation or a smaller area"
        )


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
            f"{requirements.marker_height_mm:g} mm high is {max(gap, 0):.2f} mm, less than the "
            f"{least_mm:.2f} mm that the camera resolves: make them at most {height:.1f} mm high, or use a "
            "larger separation"
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
