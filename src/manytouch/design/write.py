"""Everything of a design as files: sensor, reasons, parts, patterns, what to buy, how to put it together."""

from collections.abc import Callable
from pathlib import Path

from manytouch.calibration.camera.board import parse_board
from manytouch.design.accuracy import PredictedAccuracy, predicted_accuracy, usual_force_N
from manytouch.design.choose import Design
from manytouch.design.parts.casing import CasingChoices, Part, parts_of
from manytouch.design.parts.guide import assembly, bill_of_materials
from manytouch.design.parts.meshing import PartMesh, mesh_of, write_3mf, write_stl
from manytouch.design.parts.patterns import write_board, write_pattern
from manytouch.design.parts.pictures import draw_parts
from manytouch.design.parts.printability import objections
from manytouch.design.parts.step import write_step
from manytouch.design.plots import draw_accuracy, draw_tradeoff
from manytouch.errors import OutputError
from manytouch.values.sensor_file import save_sensor

BOARDS = {"chessboard:9x6": 25.0, "charuco:10x7": 25.0, "circles-asymmetric:4x11": 16.0}
"""Boards that come with a design, and their squares in mm."""


def write_design(
    found: Design,
    folder: Path,
    *,
    choices: CasingChoices | None = None,
    step: bool = False,
    say: Callable[[str], object] | None = None,
) -> tuple[str, ...]:
    """Write sensor.toml, design.md, parts/, parts.png, patterns/, bill_of_materials.csv and assembly.md.

    Args:
        found: from `design`.
        folder: where to.
        choices: measures of the casing.
        step: write STEP files of casing and clamp too (extra `step`; takes some seconds).
        say: told what is being made.

    Returns:
        What stands against printing the parts.

    Raises:
        OutputError: something cannot be written.
        MissingExtraError: a package of the extras `parts`, `plot` or `step` is missing.
    """
    choices = choices or CasingChoices()
    parts = parts_of(found.sensor, found.material.name, choices)
    try:
        for name in ("parts", "patterns"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        save_sensor(found.sensor, folder / "sensor.toml")
        (folder / "design.md").write_text(explained(found), encoding="utf-8")
        meshes = _write_parts(parts, folder / "parts", step=step, say=say)
        draw_parts(parts, meshes, folder / "parts.png")
        write_pattern(found.sensor, folder / "patterns" / "markers")
        for text, square_mm in BOARDS.items():
            write_board(parse_board(text, square_mm), folder / "patterns" / text.replace(":", "-"))
        bill = bill_of_materials(found, parts, meshes, choices)
        (folder / "bill_of_materials.csv").write_text(bill, encoding="utf-8")
        (folder / "assembly.md").write_text(assembly(found, choices), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot write the design into {folder}: {error.strerror}") from None
    return objections(found.sensor, found.wishes.printer, choices, meshes)


def write_prediction(
    found: Design, folder: Path, *, say: Callable[[str], object] | None = None
) -> PredictedAccuracy:
    """Write accuracy.csv, accuracy.png and tradeoff.png: what the method `mechanics` will tell how well.

    Raises:
        OutputError: something cannot be written.
        MissingExtraError: matplotlib is not installed.
    """
    predicted = predicted_accuracy(
        found.sensor, area_mm=found.wishes.area_mm, force_N=usual_force_N(found), say=say
    )
    columns = {
        "x_mm": predicted.place_mm[:, 0],
        "y_mm": predicted.place_mm[:, 1],
        "force_N": predicted.force_N,
        "depth_mm": predicted.depth_mm,
        "position_std_mm": predicted.position_std_mm,
        "depth_std_mm": predicted.depth_std_mm,
        "force_std_N": predicted.force_std_N,
    }
    lines = [",".join(columns)]
    lines += [",".join(f"{value:.5g}" for value in row) for row in zip(*columns.values(), strict=True)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "accuracy.csv").write_text("\n".join([*lines, ""]), encoding="utf-8")
        draw_accuracy(found, predicted, folder / "accuracy.png")
        draw_tradeoff(found, folder / "tradeoff.png", say=say)
    except OSError as error:
        raise OutputError(f"cannot write the prediction into {folder}: {error.strerror}") from None
    return predicted


def explained(found: Design) -> str:
    """The choices and their reasons, as Markdown."""
    lines = [f"# {found.sensor.name}", "", "| what | chosen | why |", "|---|---|---|"]
    lines += [f"| {item.about} | {item.chosen} | {item.why} |" for item in found.reasons]
    return "\n".join([*lines, ""])


def _write_parts(
    parts: tuple[Part, ...], folder: Path, *, step: bool, say: Callable[[str], object] | None
) -> dict[str, PartMesh]:
    meshes = {}
    for part in parts:
        if say is not None:
            say(f"making the {part.name}")
        meshes[part.name] = mesh_of(part.solid)
        write_stl(meshes[part.name], folder / f"{part.name}.stl")
        if step and part.name in ("casing", "clamp"):
            write_step(part.solid, folder / f"{part.name}.step")
    two = [part for part in parts if part.name in ("sheet", "markers")]
    write_3mf([(part.name, meshes[part.name], part.colour) for part in two], folder / "sheet.3mf")
    return meshes
