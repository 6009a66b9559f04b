"""Writes a design.

`write_design`: sensor file, reasons, scenes, parts, patterns, bill of materials, assembly guide;
`write_sensor`: only the first three; `write_prediction`: accuracy.csv and plots.
"""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from manytouch.design.accuracy import PredictedAccuracy, predicted_accuracy, typical_force_N
from manytouch.design.dimensions import Design
from manytouch.design.parts.bill import bill_of_materials, screw_length_mm
from manytouch.design.parts.boards import PATTERNS, fitting_board
from manytouch.design.parts.casing import CasingChoices, Part, make_parts
from manytouch.design.parts.exploded import draw_exploded
from manytouch.design.parts.guide import assembly
from manytouch.design.parts.meshing import PartMesh, make_mesh, write_3mf, write_stl
from manytouch.design.parts.patterns import write_board, write_marker_pattern
from manytouch.design.parts.pictures import draw_parts
from manytouch.design.parts.printability import printability_warnings
from manytouch.design.parts.scenes import write_scenes
from manytouch.design.parts.step import write_step
from manytouch.design.plots import draw_accuracy, draw_tradeoff
from manytouch.errors import MissingExtraError, OutputError
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.values.sensor_file.write import save_sensor

PART_PACKAGES = ("manifold3d", "trimesh", "lxml", "networkx", "matplotlib")


def require_part_packages(*, step: bool) -> None:
    """Check, before anything is computed or written, that parts can be written.

    Raises:
        MissingExtraError: a package of the extra `parts` is missing.
    """
    for package in (*PART_PACKAGES, *(("build123d",) if step else ())):
        if find_spec(package) is None:
            raise MissingExtraError("writing the parts", package, "parts")


def write_design(
    found: Design,
    folder: Path,
    *,
    choices: CasingChoices | None = None,
    step: bool = False,
    on_message: Callable[[str], object] | None = None,
) -> tuple[str, ...]:
    """Write what `write_sensor` does, parts/ with pictures, patterns/, bill_of_materials.csv and assembly.md.

    Args:
        found: from `design_sensor`.
        folder: is created if it does not exist.
        choices: dimensions of the casing.
        step: also write STEP files of casing and clamp (extra `parts`; takes some seconds).
        on_message: receives progress messages.

    Returns:
        Problems of printing the parts, one message each.

    Raises:
        OutputError: a file cannot be written.
        MissingExtraError: a package of the extras `lab` or `parts` is missing.
    """
    choices = choices or CasingChoices()
    parts = make_parts(found.sensor, found.material.name, choices)
    try:
        for name in ("parts", "patterns"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        write_sensor(found, folder)
        meshes = _write_parts(parts, folder / "parts", step=step, on_message=on_message)
        draw_parts(parts, meshes, folder / "parts.png")
        screw_mm = screw_length_mm(found, choices)
        draw_exploded(found.sensor, parts, meshes, choices, folder / "assembly.png", screw_mm=screw_mm)
        write_marker_pattern(found.sensor, folder / "patterns" / "markers")
        for pattern in PATTERNS:
            board = fitting_board(pattern, found.sensor.camera)
            write_board(board, folder / "patterns" / pattern.replace(":", "-"))
        bill = bill_of_materials(found, parts, meshes, choices)
        (folder / "bill_of_materials.csv").write_text(bill, encoding="utf-8")
        (folder / "assembly.md").write_text(assembly(found, choices), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot write the design into {folder}: {error.strerror}") from None
    return printability_warnings(found.sensor, found.requirements.printer, choices, meshes)


def write_sensor(found: Design, folder: Path) -> None:
    """Write sensor.toml, design.md and the scenes that simulate the design, scenes/.

    Raises:
        OutputError: a file cannot be written.
    """
    with output_errors(folder):
        (folder / "scenes").mkdir(parents=True, exist_ok=True)
        save_sensor(found.sensor, folder / "sensor.toml")
        (folder / "design.md").write_text(explain_design(found), encoding="utf-8")
        write_scenes(found, fitting_board(PATTERNS[0], found.sensor.camera), folder / "scenes")


def write_prediction(
    found: Design, folder: Path, *, on_message: Callable[[str], object] | None = None
) -> PredictedAccuracy:
    """Write accuracy.csv, accuracy.png and tradeoff.png: predicted accuracy of the method `mechanics`.

    Raises:
        OutputError: a file cannot be written.
        MissingExtraError: matplotlib is not installed.
    """
    predicted = predicted_accuracy(
        found.sensor,
        area_mm=found.requirements.area_mm,
        force_N=typical_force_N(found),
        on_message=on_message,
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
        draw_tradeoff(found, folder / "tradeoff.png", on_message=on_message)
    except OSError as error:
        raise OutputError(f"cannot write the prediction into {folder}: {error.strerror}") from None
    return predicted


def explain_design(found: Design) -> str:
    """The choices with their reasons, as Markdown."""
    lines = [f"# {found.sensor.name}", "", "| dimension | value | reason |", "|---|---|---|"]
    lines += [f"| {item.about} | {item.chosen} | {item.why} |" for item in found.reasons]
    return "\n".join([*lines, ""])


def _write_parts(
    parts: tuple[Part, ...], folder: Path, *, step: bool, on_message: Callable[[str], object] | None
) -> dict[str, PartMesh]:
    meshes = {}
    for part in parts:
        if on_message is not None:
            on_message(f"making the {part.name}")
        meshes[part.name] = make_mesh(part.solid)
        write_stl(meshes[part.name], folder / f"{part.name}.stl")
        if step and part.name in ("casing", "clamp"):
            write_step(part.solid, folder / f"{part.name}.step")
    two = [part for part in parts if part.name in ("sheet", "markers")]
    write_3mf([(part.name, meshes[part.name], part.colour) for part in two], folder / "sheet.3mf")
    return meshes
