"""Writes the design of the published sensor: numbers, curve of Figure 2, parts of Figures 4 and 6."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from manytouch.design.plots import new_figure
from manytouch.design.published.numbers import (
    DEPTH_MM,
    FORCE_N,
    GPA_MPA,
    PITCH_MM,
    RADIUS_MM,
    ModulusReading,
    PaperDesign,
    SmallestGap,
)
from manytouch.design.write import write_design
from manytouch.errors import OutputError
from manytouch.values.sensor_file.write import save_sensor

POINTS = 60
LINES = (("#0072B2", "-"), ("#D55E00", "--"))


def write_paper_design(
    found: PaperDesign,
    folder: Path,
    *,
    step: bool = False,
    on_message: Callable[[str], object] | None = None,
) -> tuple[str, ...]:
    """Write paper.md, figure-2.csv, figure-2.png, and what `write_design` writes.

    Returns:
        Problems of printing the parts, one message each.

    Raises:
        OutputError: a file cannot be written.
        MissingExtraError: a package of the extras `lab` or `parts` is missing.
    """
    against = write_design(found.design, folder, step=step, on_message=on_message)
    write_numbers(found, folder)
    return against


def write_numbers(found: PaperDesign, folder: Path) -> None:
    """Write paper.md, figure-2.csv, figure-2.png and sensor.toml.

    Raises:
        OutputError: a file cannot be written.
        MissingExtraError: matplotlib is not installed.
    """
    try:
        save_sensor(found.design.sensor, folder / "sensor.toml")
        (folder / "paper.md").write_text(as_markdown(found), encoding="utf-8")
        (folder / "figure-2.csv").write_text(figure_2_table(found), encoding="utf-8")
        draw_figure_2(found, folder / "figure-2.png")
    except OSError as error:
        raise OutputError(f"cannot write the design into {folder}: {error.strerror}") from None


def as_markdown(found: PaperDesign) -> str:
    """All numbers as Markdown."""
    lines = ["# The design numbers of the paper", "", "| what | value | how |", "|---|---|---|"]
    lines += [f"| {one.about} | {one.chosen} | {one.why} |" for one in found.design.reasons]
    lines += ["", f"## Table 1: {FORCE_N:g} N on 1 cm², printed {DEPTH_MM:g} mm deep", ""]
    lines += table_1(found.moduli)
    lines += ["", f"## Equation 1: markers every {PITCH_MM:g} mm, radius {RADIUS_MM:g} mm (assumed)", ""]
    lines += equation_1(found.spacings)
    lines += [
        "",
        "The fourth term is printed - h cos(θ + Δθ), where it must be - h sin(θ + Δθ): the gap of a flat "
        "sheet is d - 2 r.",
        "",
        "figure-2.csv and figure-2.png have the depth against the force (Figure 2), parts/ and parts.png the "
        "parts (Figures 4 and 6).",
    ]
    return "\n".join([*lines, ""])


def table_1(moduli: tuple[ModulusReading, ...]) -> list[str]:
    """Both readings of the elastic modulus, as lines of a Markdown table."""
    lines = [
        "| sheet, mm | E as read, N/mm² | linear model, mm | large deflection, mm | "
        "E for 10.1 mm: linear, large |",
        "|---|---|---|---|---|",
    ]
    for one in moduli:
        depth = "beyond 15" if one.depth_mm is None else f"{one.depth_mm:.2f}"
        size = f"{one.size_mm[0]:g} x {one.size_mm[1]:g}"
        lines.append(
            f"| {size} | {one.young_MPa:g} | {one.linear_mm:.1f} | {depth} | "
            f"{one.linear_young_MPa:.1f}, {one.large_young_MPa:.2f} |"
        )
    return lines


def equation_1(spacings: tuple[SmallestGap, ...]) -> list[str]:
    """Gaps for each height of the markers, as lines of a Markdown table."""
    lines = [
        "| height h, mm | θ, Δθ, degrees | gap corrected, mm | gap as printed, mm | smallest pitch, mm | "
        "largest radius, mm |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {one.height_mm:g} | {one.slope_deg:.1f}, {one.turn_deg:.1f} | {one.corrected_mm:.2f} | "
        f"{one.printed_mm:.2f} | {one.smallest_pitch_mm:.2f} | {one.largest_radius_mm:.2f} |"
        for one in spacings
    ]
    return lines


def figure_2_table(found: PaperDesign) -> str:
    """CSV text: force for the modulus that gives the printed depth, and depth with and without stretching."""
    lines = ["size_x_mm,size_y_mm,young_MPa,force_N,depth_mm,linear_depth_mm"]
    for curve, one in zip(found.curves, found.moduli[::2], strict=True):
        for force_N in np.linspace(0.0, FORCE_N, POINTS + 1)[1:]:
            ratio_mm2 = float(force_N) / one.large_young_MPa
            linear_mm = float(curve.depth_mm[0] / curve.force_over_E_mm2[0]) * ratio_mm2
            values = (*curve.size_mm, one.large_young_MPa, force_N, curve.depth_at(ratio_mm2), linear_mm)
            lines.append(",".join(f"{value:.6g}" for value in values))
    return "\n".join([*lines, ""])


def draw_figure_2(found: PaperDesign, path: Path) -> None:
    """Draw the deformed section of the sheet, and depth against force.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure((11.0, 4.0))
    left, right = figure.subplots(1, 2)
    for curve, one, (colour, line) in zip(found.curves, found.moduli[::2], LINES, strict=True):
        label = f"{curve.size_mm[0]:g} x {curve.size_mm[1]:g} mm, E = {one.large_young_MPa:.2f} MPa"
        level = int(np.argmin(np.abs(curve.depth_mm - DEPTH_MM)))
        x_mm = np.linspace(-0.5, 0.5, 201) * curve.size_mm[0]
        basis = curve.shell.patch.at(np.column_stack([x_mm, np.zeros(len(x_mm))]))
        shape_mm = np.einsum("kj,kj->k", basis.value, curve.coefficient_mm[level, :, 2][basis.node])
        left.plot(x_mm, shape_mm * DEPTH_MM / -shape_mm.min(), line, color=colour, label=label)
        force_N = np.linspace(0.01, FORCE_N, POINTS)
        right.plot(force_N, [curve.depth_at(f / one.large_young_MPa) for f in force_N], line, color=colour)
        linear = float(curve.depth_mm[0] / curve.force_over_E_mm2[0]) / GPA_MPA
        right.plot(force_N, linear * force_N, ":", color=colour)
    left.set(title=f"section through a press of {DEPTH_MM:g} mm", xlabel="x, mm", ylabel="deflection, mm")
    left.legend(frameon=False, fontsize=8)
    right.axhline(DEPTH_MM, color="0.5", linewidth=0.8)
    right.set(
        title=f"large deflection; dotted: linear model, {GPA_MPA:g} N/mm²",
        xlabel="force on 1 cm², N",
        ylabel="depth, mm",
    )
    figure.savefig(path, dpi=110)
