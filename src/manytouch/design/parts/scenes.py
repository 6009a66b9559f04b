"""Scenes that simulate a design: its camera before a board, the sheet at rest, known presses, touches.

With them, everything from the calibration to the first contacts can be tried before a part is printed.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from manytouch.calibration.camera.board import Board
from manytouch.calibration.sheet.press_plan import TIP_RADIUS_MM, places_mm
from manytouch.design.dimensions import Design

FINGER_RADIUS_MM = 6.0
CENTRE_SHARE, QUARTER_SHARE = 0.375, 0.25
"""Depth of the known presses over the depth of the deepest one, in the centre and in the quarters."""
TOUCHES = ((-0.4, 0.25, 0.3), (0.45, -0.2, 0.25))
"""x and y over half the touchable area, and depth over that of the deepest press."""
REST_S, HELD_S, RAMP_S, PAUSE_S = 1.0, 0.4, 0.2, 0.25
LIGHT = """
[light]
vignetting = 0.25
read_noise = 1.5
shot_noise = 0.02
"""


def write_scenes(found: Design, board: Board, folder: Path) -> None:
    """Write board.toml, rest.toml, presses.toml and touches.toml, which refer to ../sensor.toml.

    Args:
        found: from `design_sensor`.
        board: for the calibration of the camera.
        folder: must exist.

    Raises:
        OSError: a file cannot be written.
    """
    for name, text in scenes(found, board).items():
        (folder / name).write_text(text, encoding="utf-8")


def scenes(found: Design, board: Board) -> dict[str, str]:
    """The texts of the scenes by the names of their files."""
    deepest_mm, area_mm = found.requirements.deepest_mm, found.requirements.area_mm
    shares = (CENTRE_SHARE, *[QUARTER_SHARE] * 4)
    known = [
        (x, y, share * deepest_mm)
        for (x, y), share in zip(places_mm(found.sensor).tolist(), shares, strict=True)
    ]
    touched = [(x * area_mm[0] / 2, y * area_mm[1] / 2, share * deepest_mm) for x, y, share in TOUCHES]
    return {
        "board.toml": f"# The camera without the sheet, before the printed board.\n{_head('board')}"
        f'\n[board]\npattern = "{board}"\nsquare_mm = {board.square_mm:g}\nviews = 20\n{LIGHT}',
        "rest.toml": f"# The mounted sheet, untouched.\n{_head('untouched', REST_S)}{LIGHT}",
        "presses.toml": f"# A ball presses five places, one after the other.\n"
        f"{_pressed('presses', known, TIP_RADIUS_MM)}",
        "touches.toml": f"# Two touches, one after the other.\n"
        f"{_pressed('touches', touched, FINGER_RADIUS_MM)}",
    }


def _head(name: str, seconds: float | None = None) -> str:
    lines = ["schema = 1", f'name = "{name}"', 'sensor = "../sensor.toml"']
    if seconds is not None:
        lines.append(f"seconds = {seconds:g}")
    return "\n".join([*lines, ""])


def _pressed(name: str, places: Sequence[tuple[float, float, float]], radius_mm: float) -> str:
    every_s = HELD_S + 2 * RAMP_S + PAUSE_S
    head = _head(name, REST_S + every_s * len(places))
    body = f'\n[[bodies]]\nshape = {{ kind = "sphere", radius_mm = {radius_mm:g} }}\nmotions = [\n'
    solver = 'mechanics = "shell"  # solved in seconds; "solid": 3-D finite elements, in minutes\n'
    return f"{head}{solver}{LIGHT}{body}{''.join(_motions(places, every_s))}]\n"


def _motions(places: Sequence[tuple[float, float, float]], every_s: float) -> Iterator[str]:
    for number, (x, y, depth) in enumerate(places):
        start_s = REST_S + every_s * number
        end_s = start_s + HELD_S + 2 * RAMP_S
        yield (
            f'    {{ kind = "press", at_mm = [{x:.3g}, {y:.3g}], depth_mm = {depth:.3g}, '
            f"start_s = {start_s:.4g}, end_s = {end_s:.4g}, ramp_s = {RAMP_S:g} }},\n"
        )
