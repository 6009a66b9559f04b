"""The parts of a sensor: the sheet with its markers, the clamp, the casing with camera plate and light ledge.

The sheet lies between the upper flange of the casing and the clamp; screws go through all three. The casing
is printed with the camera plate down, so that its only overhangs are chamfers of 45 degrees.
"""

from dataclasses import dataclass

import numpy as np

from manytouch.design.parts.solids import CrossHole, Solid, Taper, block, pins
from manytouch.values import Sensor
from manytouch.values.arrays import Points2

SCREW_RADIUS_MM = 1.7  # M3, loose
NUT_RADIUS_MM = 3.3  # M3, across corners
LEFT_ABOVE_NUT_MM = 2.4
FREE_SHARE = 0.9  # of the space outside the view of the camera, for the ledge
BLACK, WHITE, GREY = "#1a1a1a", "#f2f2f2", "#4d4d4d"


@dataclass(frozen=True, slots=True, kw_only=True)
class CasingChoices:
    """Dimensions of the casing that depend on taste, the camera board or the printer.

    Attributes:
        wall_mm: of the casing.
        flange_mm: width of the flange that clamps the sheet, on every side.
        clamp_mm: thickness of the clamp, and of the casing's flange.
        screw_every_mm: largest distance between screws.
        floor_mm: thickness of the camera plate.
        lens_radius_mm: of the hole for the lens.
        board_holes_mm: (x, y) distance of the camera board's four screw holes.
        board_screw_radius_mm: of these holes.
        board_depth_mm: from the camera's centre of projection (in the lens) down to its board, which is
            screwed on from outside, the lens through the hole.
        ledge_mm: width of the ledge for an LED strip below the sheet; reduced where it would hide the sheet.
        ledge_drop_mm: from the sheet down to the ledge.
        cable_radius_mm: of the hole in one wall.
        flush_mm: depth of markers printed flush in a second colour.
    """

    wall_mm: float = 2.4
    flange_mm: float = 10.0
    clamp_mm: float = 4.0
    screw_every_mm: float = 30.0
    floor_mm: float = 3.0
    lens_radius_mm: float = 8.0
    board_holes_mm: tuple[float, float] = (28.0, 28.0)
    board_screw_radius_mm: float = 1.1
    board_depth_mm: float = 15.0
    ledge_mm: float = 10.0
    ledge_drop_mm: float = 30.0
    cable_radius_mm: float = 4.0
    flush_mm: float = 0.6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Part:
    """A part to print.

    Attributes:
        name: of its files, without suffix.
        solid: its shape, in the position on the bed.
        colour: #RRGGBB.
        material: description.
    """

    name: str
    solid: Solid
    colour: str
    material: str


def make_parts(sensor: Sensor, sheet_material: str, choices: CasingChoices | None = None) -> tuple[Part, ...]:
    """All parts to print for a rectangular sheet with the camera perpendicular to it."""
    choices = choices or CasingChoices()
    return (
        *sheet_parts(sensor, sheet_material, choices),
        Part(name="clamp", solid=clamp(sensor, choices), colour=GREY, material="PLA or PETG, dark"),
        Part(
            name="casing", solid=casing(sensor, choices), colour=BLACK, material="PLA or PETG, black and matt"
        ),
    )


def sheet_parts(sensor: Sensor, material: str, choices: CasingChoices) -> tuple[Part, Part]:
    """The sheet and its markers, two bodies that are printed together with the camera side up.

    Markers of height 0 are flush: their tops are part of the face, and they reach `flush_mm` deep. The camera
    views the sheet from below, therefore y of the part is -y of the sensor.
    """
    sheet, layout = sensor.sheet, sensor.layout
    assert sheet is not None and layout is not None  # noqa: PT018 - a design has both
    t = sheet.thickness_mm
    centre = on_part(layout.rest_mm[~layout.is_missing, :2])
    radius = float(layout.radius_mm[0])
    plate = block(_outer(sensor, choices), (0.0, t))
    holes = pins(screw_places(sensor, choices), SCREW_RADIUS_MM, (-1.0, t + 1.0))
    light = layout.polarity == "light"
    sunk = pins(centre, radius, (t - choices.flush_mm, t))
    if layout.height_mm == 0.0:
        body = Solid(joined=(plate,), removed=(holes, pins(centre, radius, (t - choices.flush_mm, t + 1.0))))
        dots = Solid(joined=(sunk,))
    else:
        body = Solid(joined=(plate,), removed=(holes,))
        dots = Solid(joined=(pins(centre, radius, (t, t + layout.height_mm)),))
    return (
        Part(
            name="sheet",
            solid=body,
            colour=BLACK if light else WHITE,
            material=f"{material}, {_shade(not light)}",
        ),
        Part(
            name="markers",
            solid=dots,
            colour=WHITE if light else BLACK,
            material=f"{material}, {_shade(light)}",
        ),
    )


def clamp(sensor: Sensor, choices: CasingChoices) -> Solid:
    """The frame that presses the sheet onto the casing's flange."""
    inner = _inner(sensor)
    return Solid(
        joined=(block(_outer(sensor, choices), (0.0, choices.clamp_mm)),),
        removed=(
            block(inner, (-1.0, choices.clamp_mm + 1.0)),
            pins(screw_places(sensor, choices), SCREW_RADIUS_MM, (-1.0, choices.clamp_mm + 1.0)),
        ),
    )


def casing(sensor: Sensor, choices: CasingChoices) -> Solid:
    """A box that supports the sheet at the stand-off above the camera.

    z = 0 is the outside of the camera plate; the camera-side face of the sheet lies on top of the flange.
    """
    inner, outer = _inner(sensor), _outer(sensor, choices)
    top = height_mm(sensor, choices)
    tube = (inner[0] + 2 * choices.wall_mm, inner[1] + 2 * choices.wall_mm)
    overhang = (outer[0] - tube[0]) / 2
    flange = top - choices.clamp_mm
    ledge_top = top - choices.ledge_drop_mm
    ledge = ledge_mm(sensor, choices)
    within = (inner[0] - 2 * ledge, inner[1] - 2 * ledge)
    joined = (
        block(tube, (0.0, top)),
        Taper(lower_mm=tube, upper_mm=outer, z_mm=(flange - overhang, flange)),
        block(outer, (flange, top)),
    )
    removed = (
        block(inner, (ledge_top, top + 1.0)),
        block(within, (ledge_top - choices.clamp_mm, ledge_top + 1.0)),
        Taper(
            lower_mm=inner,
            upper_mm=within,
            z_mm=(ledge_top - choices.clamp_mm - ledge, ledge_top - choices.clamp_mm),
        ),
        block(inner, (choices.floor_mm, ledge_top - choices.clamp_mm - ledge)),
        pins(np.zeros((1, 2)), choices.lens_radius_mm, (-1.0, choices.floor_mm + 1.0)),
        pins(_corners(choices.board_holes_mm), choices.board_screw_radius_mm, (-1.0, choices.floor_mm + 1.0)),
        pins(screw_places(sensor, choices), SCREW_RADIUS_MM, (flange - overhang - 1.0, top + 1.0)),
        pins(
            screw_places(sensor, choices), NUT_RADIUS_MM, (flange - overhang - 1.0, top - LEFT_ABOVE_NUT_MM)
        ),
        CrossHole(
            x_mm=0.0,
            z_mm=choices.floor_mm + choices.cable_radius_mm + 4.0,
            y_mm=(inner[1] / 2 - 1.0, tube[1] / 2 + 1.0),
            radius_mm=choices.cable_radius_mm,
        ),
    )
    return Solid(joined=joined, removed=removed)


def ledge_mm(sensor: Sensor, choices: CasingChoices) -> float:
    """Width of the ledge, limited to the space outside the camera's view of the sheet."""
    share = (choices.ledge_drop_mm + choices.clamp_mm) / float(sensor.camera.translation_mm[2])
    free = 0.5 * min(_inner(sensor)) * share
    return min(choices.ledge_mm, FREE_SHARE * free)


def height_mm(sensor: Sensor, choices: CasingChoices) -> float:
    """Height from the outside of the camera plate to the sheet; the camera board is below the plate."""
    return float(sensor.camera.translation_mm[2]) + choices.board_depth_mm


def screw_places(sensor: Sensor, choices: CasingChoices) -> Points2:
    """(n, 2) centres of the screws, at equal distances along the middle of the flange, one in each corner."""
    inner = _inner(sensor)
    half_x, half_y = (0.5 * (size + choices.flange_mm) for size in inner)
    along_x = np.linspace(-half_x, half_x, int(np.ceil(2 * half_x / choices.screw_every_mm)) + 1)
    along_y = np.linspace(-half_y, half_y, int(np.ceil(2 * half_y / choices.screw_every_mm)) + 1)[1:-1]
    sides = [[x, y] for x in along_x for y in (-half_y, half_y)]
    sides += [[x, y] for y in along_y for x in (-half_x, half_x)]
    return np.array(sides)


def on_part(place_mm: Points2) -> Points2:
    """Sheet coordinates on the printed sheet with the camera side up: y changes its sign."""
    return np.asarray(place_mm * np.array([1.0, -1.0]))


def _inner(sensor: Sensor) -> tuple[float, float]:
    assert sensor.sheet is not None
    return float(sensor.sheet.size_mm[0]), float(sensor.sheet.size_mm[1])


def _outer(sensor: Sensor, choices: CasingChoices) -> tuple[float, float]:
    x, y = _inner(sensor)
    return x + 2 * choices.flange_mm, y + 2 * choices.flange_mm


def _corners(size_mm: tuple[float, float]) -> Points2:
    return np.array([[sx * size_mm[0] / 2, sy * size_mm[1] / 2] for sx in (-1, 1) for sy in (-1, 1)])


def _shade(is_light: bool) -> str:
    return "white" if is_light else "black"
