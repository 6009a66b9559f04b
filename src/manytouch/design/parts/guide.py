"""Assembly guide of a design."""

from manytouch.design.dimensions import Design
from manytouch.design.parts.bill import strip_mm
from manytouch.design.parts.boards import PATTERNS, fitting_board
from manytouch.design.parts.casing import CasingChoices, height_mm, screw_places


def assembly(found: Design, choices: CasingChoices) -> str:
    """The assembly guide, as Markdown."""
    sensor = found.sensor
    screws = len(screw_places(sensor, choices))
    board = fitting_board(PATTERNS[0], sensor.camera)
    steps = (
        _sheet_step(found, choices),
        "Print `casing.stl` with the camera plate down, in matt black filament. Print `clamp.stl`.",
        "Screw the camera board under the plate, with its lens through the hole. The centre of the lens "
        f"should be {sensor.camera.translation_mm[2]:.1f} mm below the sheet "
        f"({height_mm(sensor, choices):.1f} mm from the outside of the plate to the rim). A difference of "
        "one millimetre is acceptable, because the distance is calibrated.",
        f"Lay an LED strip on the ledge, all around ({strip_mm(found, choices):.0f} mm). Lead its cable and "
        "that of the camera through the hole. Cover the strip with white paper to diffuse the light.",
        "Paint the inside matt black, or line it with black flock, so that only the markers are bright.",
        "Lay the printed marker pattern on the rim, markers down, and focus the camera on it. Lock focus, "
        "exposure and white balance. Remove the pattern, take 15 or more images of the printed "
        f"`patterns/{str(board).replace(':', '-')}.pdf` into a folder `views`, and run `manytouch calibrate "
        f"camera views --board {board} --square-mm {board.square_mm:g} --out camera.toml`; this is not "
        "possible after the sheet is mounted.",
        f"Insert {screws} M3 nuts into the flange from below. Lay the sheet on the rim, markers down, "
        "without stretching it. Lay the clamp on it and tighten the screws crosswise, a little at a time.",
        f"Record two seconds without contact and run `{_rest_command(found)}`. Then `manytouch calibrate "
        "sheet --sensor rested.toml --plan plan` writes a plan of known presses, and `manytouch calibrate "
        "sheet presses.csv --sensor rested.toml --out sensor.toml` calibrates with them. Forces are "
        "calibrated only after this step.",
    )
    lines = [
        f"# {sensor.name}",
        "",
        "![the assembly, exploded: camera, casing, LED strip, sheet, clamp and screws](assembly.png)",
        "",
        "![parts in the orientation in which they are printed](parts.png)",
        "",
        "`bill_of_materials.csv` lists what to print and to buy, with a generic example of each. Its price "
        "ranges are rough estimates for single pieces, not offers.",
        "",
        *(f"{place}. {step}" for place, step in enumerate(steps, 1)),
        "",
    ]
    return "\n".join(lines)


def _rest_command(found: Design) -> str:
    sheet, layout = found.sensor.sheet, found.sensor.layout
    assert sheet is not None and layout is not None  # noqa: PT018 - a design has both
    (wide_mm, high_mm), (x_mm, y_mm) = sheet.size_mm, layout.pitch_mm
    pitch = f"{x_mm:g}" if abs(x_mm - y_mm) < 1e-6 else f"{x_mm:g},{y_mm:g}"
    return (
        f"manytouch calibrate rest rest.mp4 --sensor camera.toml --pitch-mm {pitch} --sheet-mm "
        f"{wide_mm:g},{high_mm:g} --thickness-mm {sheet.thickness_mm:g} --out rested.toml"
    )


def _sheet_step(found: Design, choices: CasingChoices) -> str:
    layout = found.sensor.layout
    sheet = found.sensor.sheet
    assert sheet is not None and layout is not None  # noqa: PT018 - a design has both
    if found.material.process == "cast":
        light, dark = ("white", "black") if layout.polarity == "light" else ("black", "white")
        return (
            f"Cast the sheet: pour {dark} {found.material.name} between two flat plates "
            f"{sheet.thickness_mm:g} mm apart (degas it, or let bubbles rise), and cut outline and screw "
            "holes after `parts/sheet.stl`. For the markers cut `patterns/markers.svg` out of a thin "
            f"adhesive foil at 100 %, stick it on the camera side, spread {light} silicone of the same kind "
            "over it, remove the foil and let it cure."
        )
    printing = (
        f"Print `sheet.3mf` in two colours, with the camera side up. The markers reach "
        f"{choices.flush_mm:g} mm deep into the face."
        if layout.height_mm == 0
        else f"Print `sheet.3mf` with the camera side up; change to the light filament for the markers "
        f"({layout.height_mm:g} mm high)."
    )
    return (
        f"{printing} Use 100 % infill with lines alternating by 45°: forces are calibrated only on a "
        "homogeneous sheet."
    )
