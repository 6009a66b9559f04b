"""The reasons for the dimensions of a designed sensor, in plain sentences."""

import math
from collections.abc import Iterator

from manytouch.design.dimensions import (
    MIN_MARKER_GAP_PX,
    MIN_MARKER_RADIUS_PX,
    RESOLUTION_PITCHES,
    RIM_PITCHES,
    RIM_THICKNESSES,
    Design,
    Reason,
    rim_mm,
)
from manytouch.design.spacing import largest_height_mm, largest_radius_mm, smallest_pitch_mm
from manytouch.values import Layout


def reasons_for(found: Design) -> Iterator[Reason]:
    """One reason for each dimension, in the order of the choices."""
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
        f"pitches; the radius is a quarter of the pitch, and at least {MIN_MARKER_RADIUS_PX:g} px and one "
        "printed line",
    )
    yield _gap_reason(found, layout)
    depth_mm, least_um = found.depth_under_largest_force_mm, 1e3 * found.depth_under_smallest_force_mm
    strain = found.curve.strain_at(depth_mm)
    stress = found.material.young_MPa * strain
    yield Reason(
        about="sheet",
        chosen=f"{found.material.name}, {sheet.thickness_mm:g} mm thick, E about "
        f"{found.material.young_MPa:.2g} MPa",
        why=f"the softest that supports {requirements.force_N[1]:g} N on 1 cm² within "
        f"{requirements.deepest_mm:g} mm: {depth_mm:.1f} mm, and {least_um:.0f} µm under "
        f"{requirements.force_N[0]:g} N; its largest strain is {100 * strain:.0f} %, at a stress of about "
        f"{stress:.1f} MPa; it breaks at {found.material.strength_MPa:g} MPa",
    )
    yield Reason(about="frame rate", chosen=f"{camera.fps:g} per second", why="of the camera at this size")


def _gap_reason(found: Design, layout: Layout) -> Reason:
    """The gap by equation 1 where it is smallest, and the limits of pitch, radius and height."""
    deepest_mm, least_mm = found.requirements.deepest_mm, MIN_MARKER_GAP_PX * found.mm_per_px
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
        why="smallest gap by equation 1 for all pairs of a row; the largest slope is "
        f"{math.degrees(steepest):.0f} degrees and changes by {math.degrees(turn):.0f} degrees within a "
        f"pitch. The gap would be {MIN_MARKER_GAP_PX:g} px with markers every {pitch:.1f} mm, or with a "
        f"radius of {radius:.1f} mm, or {height:.0f} mm high",
    )
