"""Bill of materials and assembly guide of a design."""

import csv
import io
import math
from collections.abc import Iterator, Mapping

from manytouch.calibration.sheet.protocol import TIP_RADIUS_MM, WEIGHTS_G
from manytouch.design.dimensions import Design
from manytouch.design.parts.boards import PATTERNS, fitting_board
from manytouch.design.parts.casing import CasingChoices, Part, height_mm, ledge_mm, screw_places
from manytouch.design.parts.meshing import PartMesh

PRINTED_DENSITY_G_PER_CM3 = 1.2
SCREW_LENGTHS_MM = (8, 10, 12, 16, 20, 25, 30)


def bill_of_materials(
    found: Design, parts: tuple[Part, ...], meshes: Mapping[str, PartMesh], choices: CasingChoices
) -> str:
    """CSV text with the columns item, count, what, remark. Masses are those of solid prints."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(["item", "count", "what", "remark"])
    for part in parts:
        volume = meshes[part.name].volume_mm3 / 1000
        mass = volume * PRINTED_DENSITY_G_PER_CM3
        writer.writerow([part.name, 1, part.material, f"{volume:.1f} cm³, {mass:.0f} g, {part.name}.stl"])
    writer.writerows(_bought(found, choices))
    return table.getvalue()


def screw_length_mm(found: Design, choices: CasingChoices) -> int:
    """The shortest standard M3 screw that reaches through clamp, sheet and flange into the nut.

    The nut is inside the flange, of which only the part above the nut counts.
    """
    assert found.sensor.sheet is not None
    through = choices.clamp_mm + found.sensor.sheet.thickness_mm + choices.clamp_mm
    return next(length for length in SCREW_LENGTHS_MM if length >= through)


def assembly(found: Design, choices: CasingChoices) -> str:
    """The assembly guide, as Markdown."""
    sensor = found.sensor
    sheet, layout = sensor.sheet, sensor.layout
    assert sheet is not None and layout is not None  # noqa: PT018 - a design has both
    screws = len(screw_places(sensor, choices))
    board = fitting_board(PATTERNS[0], sensor.camera)
    how = (
        f"Print `sheet.3mf` in two colours, with the camera side up. The markers reach "
        f"{choices.flush_mm:g} mm deep into the face."
        if layout.height_mm == 0
        else f"Print `sheet.3mf` with the camera side up; change to the light filament for the markers "
        f"({layout.height_mm:g} mm high)."
    )
    steps = (
        f"{how} Use 100 % infill with lines alternating by 45°: forces are calibrated only on a homogeneous "
        "sheet.",
        "Print `casing.stl` with the camera plate down, in matt black filament. Print `clamp.stl`.",
        f"Screw the camera board under the plate, with its lens through the hole. The centre of the lens "
        f"should be {sensor.camera.translation_mm[2]:.1f} mm below the sheet "
        f"({height_mm(sensor, choices):.1f} mm from the outside of the plate to the rim). A difference of "
        "one "
        "millimetre is acceptable, because the distance is calibrated.",
        f"Lay an LED strip on the ledge, all around ({_strip_mm(found, choices):.0f} mm). Lead its cable "
        "and that "
        "of the camera through the hole. Cover the strip with white paper to diffuse the light.",
        "Paint the inside matt black, or line it with black flock, so that only the markers are bright.",
        "Lay the printed marker pattern on the rim, markers down, and focus the camera on it. Lock focus, "
        "exposure and white balance. Remove the pattern and run `manytouch calibrate camera --board "
        f"{board} --square-mm {board.square_mm:g}` with images of the printed "
        f"`patterns/{str(board).replace(':', '-')}.pdf`; "
        "this is not possible after the sheet is mounted.",
        f"Insert {screws} M3 nuts into the flange from below. Lay the sheet on the rim, markers down, "
        "without "
        "stretching it. Lay the clamp on it and tighten the screws crosswise, a little at a time.",
        "Run `manytouch calibrate rest`, then `manytouch calibrate sheet` with presses of known force. "
        "Forces are calibrated only after this step.",
    )
    picture = "![parts in the orientation in which they are printed](parts.png)"
    lines = [
        f"# {sensor.name}",
        "",
        picture,
        "",
        *(f"{place}. {step}" for place, step in enumerate(steps, 1)),
        "",
    ]
    return "\n".join(lines)


def _bought(found: Design, choices: CasingChoices) -> Iterator[list[object]]:
    camera = found.requirements.camera
    screws = len(screw_places(found.sensor, choices))
    yield [
        "camera",
        1,
        f"{camera.width_px} x {camera.height_px} px, {camera.hfov_deg:g} degrees horizontal field of view, "
        f"focus from {camera.least_focus_mm:g} mm",
        f"board holes {choices.board_holes_mm[0]:g} x {choices.board_holes_mm[1]:g} mm",
    ]
    yield ["screw", screws, f"M3 x {screw_length_mm(found, choices)}", "clamp"]
    yield ["nut", screws, "M3", "in the flange of the casing"]
    yield ["screw", 4, "M2 x 6, self-tapping", "camera board"]
    yield [
        "LED strip",
        1,
        f"{_strip_mm(found, choices):.0f} mm, white, 5 V",
        f"at most {ledge_mm(found.sensor, choices):.0f} mm wide",
    ]
    yield ["matt black paint", 1, "spray, or black flock", "for the inside of the casing"]
    yield ["ball", 1, f"{2 * TIP_RADIUS_MM:g} mm, a marble", "under the weights, or as the tip on a printer"]
    yield ["weights", 1, f"{', '.join(f'{grams:g}' for grams in WEIGHTS_G)} g", "or a kitchen scale"]
    yield ["USB cable", 1, "of the camera", f"through a hole of {2 * choices.cable_radius_mm:g} mm"]


def _strip_mm(found: Design, choices: CasingChoices) -> float:
    assert found.sensor.sheet is not None
    width = ledge_mm(found.sensor, choices)
    x, y = (float(side) - width for side in found.sensor.sheet.size_mm)
    return float(math.floor(2 * (x + y)))
