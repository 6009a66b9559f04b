"""From wishes to a sensor: each choice with its reason, and what limits it."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from manytouch.calibration.sheet.fit import STIFFNESS_PRIOR_STD
from manytouch.design.deflection import DeflectionCurve, deflection_curve
from manytouch.design.materials import MATERIALS, POISSON, Material
from manytouch.design.requirements import DesignError, Requirements
from manytouch.design.spacing import least_pitch_mm, most_height_mm, most_radius_mm
from manytouch.design.stand_off import StandOff, focal_px, stand_off, vfov_rad
from manytouch.values import Camera, Layout, Sensor, Sheet
from manytouch.values.arrays import read_only

LEAST_RIM_MM = 10.0
RIM_THICKNESSES, RIM_PITCHES = 2.0, 1.5
"""Next to the clamp forces cannot be told from its own; and those of a press reach so many markers."""
VIEW_MARGIN = 1.03
LEAST_RADIUS_PX = 3.0
LEAST_GAP_PX = 3.0
PITCHES_APART = 2.0
"""Two equal contacts are told apart from about two pitches on (docs/metrics.md)."""
WIDEST_PITCH_MM = 6.0
RADIUS_PER_PITCH = 0.25
THICKNESSES_MM = (2.0, 3.0, 4.0)
STRENGTH_SHARE = 0.5
"""The sheet is stretched to at most this share of its strength."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reason:
    """A choice.

    Attributes:
        about: what was chosen.
        chosen: with its unit.
        why: in a sentence or two, with the numbers that decided.
    """

    about: str
    chosen: str
    why: str


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Design:
    """A sensor that fulfils wishes.

    Attributes:
        wishes: what was asked for.
        sensor: designed; calibrate it before trusting its forces.
        material: of the sheet.
        curve: a fingertip pressed deeper and deeper into its middle.
        stand_off: of the camera.
        reasons: in the order in which things were decided.
    """

    wishes: Requirements
    sensor: Sensor
    material: Material
    curve: DeflectionCurve
    stand_off: StandOff
    reasons: tuple[Reason, ...] = ()

    @property
    def mm_per_px(self) -> float:
        """On the untouched sheet."""
        return float(self.sensor.camera.translation_mm[2]) / self.sensor.camera.fx_px

    @property
    def depth_at_most_mm(self) -> float:
        """Depth under the largest force."""
        return self.curve.depth_at(self.wishes.force_N[1] / self.material.young_MPa)

    @property
    def depth_at_least_mm(self) -> float:
        """Depth under the smallest force."""
        return self.curve.depth_at(self.wishes.force_N[0] / self.material.young_MPa)


def design(wishes: Requirements, *, say: Callable[[str], object] | None = None) -> Design:
    """Choose a sheet, its markers and where the camera stands.

    Args:
        wishes: what the sensor shall do.
        say: told what is being computed, which takes some seconds.

    Raises:
        DesignError: nothing fulfils the wishes; it names the one in the way and what would help.
    """
    material, curve = _sheet(wishes, say)
    size = curve.size_mm
    off = _stand_off(wishes, size)
    distance_mm = math.ceil(10 * off.distance_mm) / 10
    focal = focal_px(wishes.camera.width_px, math.radians(wishes.camera.hfov_deg))
    mm_per_px = distance_mm / focal
    pitch, radius = _markers(wishes, mm_per_px)
    _check_gaps(wishes, curve, pitch, radius, LEAST_GAP_PX * mm_per_px)
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
        camera=_camera(wishes, focal, distance_mm),
        layout=lattice(size, pitch, radius, wishes.marker_height_mm),
        sheet=sheet,
        provenance={"origin": "designed", "material": f"{material.name} (nominal stiffness; calibrate it)"},
    )
    found = Design(wishes=wishes, sensor=sensor, material=material, curve=curve, stand_off=off)
    return replace(found, reasons=tuple(_reasons(found)))


def _stand_off(wishes: Requirements, size: tuple[float, float]) -> StandOff:
    camera = wishes.camera
    hfov = math.radians(camera.hfov_deg)
    off = stand_off(
        view_mm=(VIEW_MARGIN * size[0], VIEW_MARGIN * size[1]),
        hfov_rad=hfov,
        vfov_rad=vfov_rad(camera.width_px, camera.height_px, hfov),
        least_focus_mm=camera.least_focus_mm + wishes.deepest_mm,
    )
    if off.distance_mm < 3 * wishes.deepest_mm:
        raise DesignError(
            f"a press of {wishes.deepest_mm:g} mm comes too near to a camera {off.distance_mm:.0f} mm "
            "away: allow a less deep press, or take a camera with a narrower field of view"
        )
    return off


def rim_mm(wishes: Requirements, thickness_mm: float) -> float:
    """What the clamped outline has beside the area that can be touched."""
    reach_mm = RIM_THICKNESSES * thickness_mm + RIM_PITCHES * _pitch_mm(wishes)
    return max(LEAST_RIM_MM, math.ceil(2 * reach_mm) / 2)


def _pitch_mm(wishes: Requirements) -> float:
    return min(wishes.separation_mm / PITCHES_APART, WIDEST_PITCH_MM)


def _markers(wishes: Requirements, mm_per_px: float) -> tuple[float, float]:
    """Pitch and radius, mm."""
    pitch = _pitch_mm(wishes)
    least = max(LEAST_RADIUS_PX * mm_per_px, wishes.printer.nozzle_mm)
    radius = max(RADIUS_PER_PITCH * pitch, least)
    if pitch - 2 * radius < max(2 * wishes.printer.nozzle_mm, LEAST_GAP_PX * mm_per_px):
        raise DesignError(
            f"contacts {wishes.separation_mm:g} mm apart need markers every {pitch:.2g} mm, but one that "
            f"the camera sees ({mm_per_px:.3f} mm per px) and the printer prints "
            f"({wishes.printer.nozzle_mm:g} mm lines) is {2 * radius:.2g} mm wide: ask for a larger "
            "separation, a smaller area, or a camera with more pixels"
        )
    return pitch, radius


def _sheet(wishes: Requirements, say: Callable[[str], object] | None) -> tuple[Material, DeflectionCurve]:
    """The softest material, on the thinnest sheet, that holds the largest force."""
    materials = [item for item in MATERIALS if wishes.material in (None, item.name)]
    if not materials:
        raise DesignError(
            f"there is no material {wishes.material!r}; there are: "
            f"{', '.join(repr(item.name) for item in MATERIALS)}"
        )
    thicknesses = THICKNESSES_MM if wishes.thickness_mm is None else (wishes.thickness_mm,)
    found: list[tuple[float, Material, DeflectionCurve]] = []
    stiffest = (math.inf, "")
    for thickness in thicknesses:
        if say is not None:
            say(f"pressing a sheet of {thickness:g} mm")
        rim = rim_mm(wishes, thickness)
        size = (wishes.area_mm[0] + 2 * rim, wishes.area_mm[1] + 2 * rim)
        curve = deflection_curve(
            size_mm=size, thickness_mm=thickness, poisson=POISSON, deepest_mm=wishes.deepest_mm
        )
        for material in materials:
            depth = curve.depth_at(wishes.force_N[1] / material.young_MPa)
            stress_MPa = material.young_MPa * curve.strain_at(depth)
            stiffest = min(stiffest, (depth, f"{material.name}, {thickness:g} mm thick"))
            if depth <= wishes.deepest_mm and stress_MPa <= STRENGTH_SHARE * material.strength_MPa:
                found.append((depth, material, curve))
    if not found:
        raise DesignError(
            f"no sheet holds {wishes.force_N[1]:g} N on 1 cm² within {wishes.deepest_mm:g} mm: the stiffest, "
            f"{stiffest[1]}, gives {stiffest[0]:.1f} mm; allow a deeper press, a smaller force or area, or a "
            "thicker sheet"
        )
    _, material, curve = max(found, key=lambda item: item[0])
    return material, curve


def _check_gaps(
    wishes: Requirements, curve: DeflectionCurve, pitch: float, radius: float, least_mm: float
) -> None:
    gap = curve.least_gap_mm(
        pitch_mm=pitch, radius_mm=radius, height_mm=wishes.marker_height_mm, depth_mm=wishes.deepest_mm
    )
    if gap < least_mm:
        height = min(
            most_height_mm(pitch_mm=pitch, radius_mm=radius, gap_mm=least_mm, slope_rad=slope, turn_rad=turn)
            for slope, turn in curve.pairs_rad(pitch, wishes.deepest_mm)
        )
        raise DesignError(
            f"markers {wishes.marker_height_mm:g} mm high close up to {max(gap, 0):.2f} mm under a press of "
            f"{wishes.deepest_mm:g} mm, less than the {least_mm:.2f} mm that the camera can part: make "
            f"them at most {height:.1f} mm high, or ask for a larger separation"
        )


def _camera(wishes: Requirements, focal: float, distance_mm: float) -> Camera:
    camera = wishes.camera
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
    """As many light markers as a sheet holds, mm."""
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
    """Equation 1 where markers come nearest, and solved for pitch, radius and height in turn."""
    deepest_mm, least_mm = found.wishes.deepest_mm, LEAST_GAP_PX * found.mm_per_px
    d, r, h = float(layout.pitch_mm[0]), float(layout.radius_mm[0]), layout.height_mm
    gap = found.curve.least_gap_mm(pitch_mm=d, radius_mm=r, height_mm=h, depth_mm=deepest_mm)
    pairs = [
        {"gap_mm": least_mm, "slope_rad": slope, "turn_rad": turn}
        for slope, turn in found.curve.pairs_rad(d, deepest_mm)
    ]
    pitch = max(least_pitch_mm(radius_mm=r, height_mm=h, **pair) for pair in pairs)
    radius = min(most_radius_mm(pitch_mm=d, height_mm=h, **pair) for pair in pairs)
    height = min(most_height_mm(pitch_mm=d, radius_mm=r, **pair) for pair in pairs)
    steepest = max(abs(pair["slope_rad"]) for pair in pairs)
    turn = max(pair["turn_rad"] for pair in pairs)
    return Reason(
        about="room between markers",
        chosen=f"{gap:.2f} mm ({gap / found.mm_per_px:.1f} px) at a press of {deepest_mm:g} mm",
        why=f"equation 1 at every pair of a row; the steepest slope is {math.degrees(steepest):.0f} "
        f"degrees and turns by {math.degrees(turn):.0f} degrees within a pitch. {LEAST_GAP_PX:g} px would be "
        f"left with markers every {pitch:.1f} mm, or of a radius of {radius:.1f} mm, or {height:.0f} mm high",
    )


def _reasons(found: Design) -> Iterator[Reason]:
    wishes, sensor, off = found.wishes, found.sensor, found.stand_off
    sheet, layout, camera = sensor.sheet, sensor.layout, wishes.camera
    assert sheet is not None and layout is not None and layout.shape is not None  # noqa: PT018
    x, y = (float(side) for side in sheet.size_mm)
    yield Reason(
        about="clamped outline",
        chosen=f"{x:g} x {y:g} mm",
        why=f"the area of {wishes.area_mm[0]:g} x {wishes.area_mm[1]:g} mm and a rim of "
        f"{rim_mm(wishes, sheet.thickness_mm):g} mm: {RIM_THICKNESSES:g} thicknesses, since forces next to "
        f"the clamp cannot be told from its own, and {RIM_PITCHES:g} pitches that a press reaches",
    )
    yield Reason(
        about="stand-off of the camera",
        chosen=f"{sensor.camera.translation_mm[2]:.1f} mm",
        why=f"the outline fills the width of the picture at {off.width_mm:.1f} mm, the height at "
        f"{off.height_mm:.1f} mm (equations 2 and 3), and the deepest press is in focus from "
        f"{off.focus_mm:.1f} mm on (equation 4, read as d > F); the {off.limit} decides. One pixel is "
        f"{found.mm_per_px:.4f} mm",
    )
    yield Reason(
        about="markers",
        chosen=f"{layout.shape[0]} x {layout.shape[1]}, every {layout.pitch_mm[0]:g} mm, radius "
        f"{layout.radius_mm[0]:.2f} mm ({layout.radius_mm[0] / found.mm_per_px:.1f} px)",
        why=f"contacts {wishes.separation_mm:g} mm apart are told apart with {PITCHES_APART:g} pitches "
        f"between them; a radius of a quarter of the pitch, at least {LEAST_RADIUS_PX:g} px and a line of "
        "the printer",
    )
    yield _room(found, layout)
    stress = found.material.young_MPa * found.curve.strain_at(found.depth_at_most_mm)
    yield Reason(
        about="sheet",
        chosen=f"{found.material.name}, {sheet.thickness_mm:g} mm thick, E about "
        f"{found.material.young_MPa:.2g} MPa",
        why=f"the softest that holds {wishes.force_N[1]:g} N on 1 cm² within {wishes.deepest_mm:g} mm: "
        f"{found.depth_at_most_mm:.1f} mm, and {1e3 * found.depth_at_least_mm:.0f} µm under "
        f"{wishes.force_N[0]:g} N; it is stretched by "
        f"{100 * found.curve.strain_at(found.depth_at_most_mm):.0f} %, about {stress:.1f} of the "
        f"{found.material.strength_MPa:g} MPa at which it breaks",
    )
    yield Reason(about="frame rate", chosen=f"{camera.fps:g} per second", why="the camera's own at this size")
