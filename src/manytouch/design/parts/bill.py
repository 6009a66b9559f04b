"""Bill of materials of a design: what to print and what to buy, with a generic example of each."""

import csv
import io
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from manytouch.calibration.sheet.press_plan import TIP_RADIUS_MM, WEIGHTS_G
from manytouch.design.dimensions import Design
from manytouch.design.parts.casing import CasingChoices, Part, ledge_mm, screw_places
from manytouch.design.parts.meshing import PartMesh

PRINTED_DENSITY_G_PER_CM3 = 1.2
SCREW_LENGTHS_MM = (8, 10, 12, 16, 20, 25, 30)
COLUMNS = ("item", "count", "what", "remark", "example", "price_range_EUR_rough_estimate")
LEAST_F_NUMBER, LARGEST_F_NUMBER = 1.8, 8.0
"""Range of the f-numbers of common small lenses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraType:
    """A common kind of camera module.

    Attributes:
        width_px: of its largest image.
        name: pixels and optical format.
        sensor_mm: width of its image sensor.
        price_EUR: rough range for one piece.
    """

    width_px: int
    name: str
    sensor_mm: float
    price_EUR: str


CAMERAS = (
    CameraType(width_px=1280, name="1 MP, 1/4 inch, pixels of 3.0 µm", sensor_mm=3.84, price_EUR="20-50"),
    CameraType(width_px=1920, name="2 MP, 1/2.8 inch, pixels of 2.9 µm", sensor_mm=5.57, price_EUR="25-70"),
    CameraType(width_px=2688, name="4 MP, 1/3 inch, pixels of 2.0 µm", sensor_mm=5.38, price_EUR="35-80"),
    CameraType(width_px=3840, name="8 MP, 1/2.8 inch, pixels of 1.45 µm", sensor_mm=5.57, price_EUR="45-110"),
    CameraType(
        width_px=4656, name="16 MP, 1/2.8 inch, pixels of 1.12 µm", sensor_mm=5.21, price_EUR="60-150"
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BillItem:
    """A line of the bill.

    Attributes:
        item, count, what, remark: what is needed.
        example: a generic type that is sold, with the numbers that matter.
        price: rough range of all pieces together in euro; empty for what is printed.
    """

    item: str
    count: int
    what: str
    remark: str
    example: str = ""
    price: str = ""


def bill_of_materials(
    found: Design, parts: tuple[Part, ...], meshes: Mapping[str, PartMesh], choices: CasingChoices
) -> str:
    """CSV text with the columns `COLUMNS`. Masses are those of solid prints; prices are not offers."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(COLUMNS)
    for one in (*_printed(parts, meshes), *_materials(found, parts, meshes), *_bought(found, choices)):
        writer.writerow([one.item, one.count, one.what, one.remark, one.example, one.price])
    return table.getvalue()


def screw_length_mm(found: Design, choices: CasingChoices) -> int:
    """The shortest standard M3 screw that reaches through clamp, sheet and flange into the nut.

    The nut is inside the flange, of which only the part above the nut counts.
    """
    assert found.sensor.sheet is not None
    through = choices.clamp_mm + found.sensor.sheet.thickness_mm + choices.clamp_mm
    return next(length for length in SCREW_LENGTHS_MM if length >= through)


def strip_mm(found: Design, choices: CasingChoices) -> float:
    """Length of the LED strip."""
    assert found.sensor.sheet is not None
    width = ledge_mm(found.sensor, choices)
    x, y = (float(side) - width for side in found.sensor.sheet.size_mm)
    return float(math.floor(2 * (x + y)))


def camera_type(found: Design) -> CameraType:
    """The smallest common camera that has the pixels of the design."""
    wanted_px = found.requirements.camera.width_px
    return next((one for one in CAMERAS if one.width_px >= wanted_px), CAMERAS[-1])


def focal_length_mm(found: Design) -> float:
    """Focal length of the lens on `camera_type`, if the whole width of its sensor is read."""
    return camera_type(found).sensor_mm / (2 * math.tan(math.radians(found.requirements.camera.hfov_deg) / 2))


def least_f_number(found: Design) -> float:
    """F-number from which on the deepest press is blurred by at most a pixel, if the sheet is in focus.

    A lens of focal length f and aperture f / N in focus at d spreads a point at d - p over a disc of
    f² / N |1 / (d - p) - 1 / d| in the image (thin lens, f much smaller than d).
    """
    camera = found.requirements.camera
    far_mm = float(found.sensor.camera.translation_mm[2])
    near_mm = far_mm - found.requirements.deepest_mm
    pixel_mm = camera_type(found).sensor_mm / camera.width_px
    return focal_length_mm(found) ** 2 / pixel_mm * (1 / near_mm - 1 / far_mm)


def _printed(parts: tuple[Part, ...], meshes: Mapping[str, PartMesh]) -> Iterator[BillItem]:
    for part in parts:
        volume = meshes[part.name].volume_mm3 / 1000
        mass = volume * PRINTED_DENSITY_G_PER_CM3
        remark = f"{volume:.1f} cm³, {mass:.0f} g, {part.name}.stl"
        yield BillItem(item=part.name, count=1, what=part.material, remark=remark)


def _materials(found: Design, parts: tuple[Part, ...], meshes: Mapping[str, PartMesh]) -> Iterator[BillItem]:
    volume = {part.name: meshes[part.name].volume_mm3 / 1000 for part in parts}
    soft_cm3, material = volume["sheet"] + volume["markers"], found.material
    is_cast = material.process == "cast"
    kind = (
        "two-component silicone, platinum-cure, pot life of 20 min or more, with black and white "
        "silicone pigment"
        if is_cast
        else "flexible filament, 1.75 mm, for an extruder with direct drive, one spool black, one white"
    )
    yield BillItem(
        item="material of the sheet",
        count=1,
        what=material.name,
        remark=f"{soft_cm3:.0f} cm³ and a quarter more for losses",
        example=f"{kind}, Shore A {material.shore_A:g}, tensile strength of "
        f"{material.strength_MPa:g} MPa or more",
        price="25-50" if is_cast else "50-100",
    )
    mass = (volume["casing"] + volume["clamp"]) * PRINTED_DENSITY_G_PER_CM3
    yield BillItem(
        item="material of casing and clamp",
        count=1,
        what="PLA or PETG",
        remark=f"{mass:.0f} g if solid",
        example="filament, 1.75 mm, black and matt",
        price="15-30",
    )


def _bought(found: Design, choices: CasingChoices) -> Iterator[BillItem]:
    camera, kind = found.requirements.camera, camera_type(found)
    screws = len(screw_places(found.sensor, choices))
    holes = f"{choices.board_holes_mm[0]:g} x {choices.board_holes_mm[1]:g} mm"
    yield BillItem(
        item="camera",
        count=1,
        what=f"{camera.width_px} x {camera.height_px} px, {camera.hfov_deg:g} degrees horizontal field of "
        f"view, focus from {camera.least_focus_mm:g} mm",
        remark=f"board holes {holes}; exposure, white balance and focus must be fixed by software or by hand",
        example=f"USB camera module (UVC), {kind.name}, {camera.fps:g} frames per second or more at this "
        "size, M12 lens mount, board of 32 x 32 mm or 38 x 38 mm",
        price=kind.price_EUR,
    )
    least = least_f_number(found)
    stop = (
        f"F/{max(least, LEAST_F_NUMBER):.1f} or a higher F-number (the deepest press is then "
        "blurred by at most a pixel)"
        if least <= LARGEST_F_NUMBER
        else f"F/{LARGEST_F_NUMBER:g} (the deepest press is then blurred by "
        f"{least / LARGEST_F_NUMBER:.1f} px)"
    )
    yield BillItem(
        item="lens",
        count=1,
        what=f"M12, focal length about {focal_length_mm(found):.1f} mm on that camera",
        remark=f"turned into focus at {found.sensor.camera.translation_mm[2]:.0f} mm and locked; not needed "
        "if the module has one of this field of view",
        example=f"M12 lens, {stop}, distortion below 5 %, with an infrared filter, locking ring",
        price="8-25",
    )
    yield BillItem(
        item="LED strip",
        count=1,
        what=f"{strip_mm(found, choices):.0f} mm, white, 5 V",
        remark=f"at most {ledge_mm(found.sensor, choices):.0f} mm wide",
        example="type 2835 or 3528, 60 to 120 LEDs per metre, 5 to 10 W per metre, neutral white, "
        "without dimmer (pulsed light flickers in the image)",
        price="5-15",
    )
    length = screw_length_mm(found, choices)
    grams = ", ".join(f"{each:g}" for each in WEIGHTS_G)
    scale = "kitchen or pocket scale with a resolution of 0.1 g to 1 g"
    hole = f"through a hole of {2 * choices.cable_radius_mm:g} mm"
    tip = f"{2 * TIP_RADIUS_MM:g} mm, a marble"
    for item, count, what, remark, example, price in (
        ("screw", screws, f"M3 x {length}", "clamp", "", "2-5"),
        ("nut", screws, "M3", "in the flange of the casing", "", "1-3"),
        ("screw", 4, "M2 x 6, self-tapping", "camera board", "", "1-2"),
        ("matt black paint", 1, "spray, or black flock", "for the inside of the casing", "", "5-12"),
        ("ball", 1, tip, "under the weights, or as the tip on a printer", "", "1-3"),
        ("weights", 1, f"{grams} g", "or a kitchen scale", scale, "10-20"),
        ("USB cable", 1, "of the camera", hole, "", "0-8"),
    ):
        yield BillItem(item=item, count=count, what=what, remark=remark, example=example, price=price)
