"""`manytouch design`: from requirements to a sensor file and its parts."""

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from manytouch.cli.terminal import options

Pair = Annotated[
    Any,
    Parameter(
        converter=options.pair("X,Y"),
        n_tokens=1,
        metavar="X,Y",
        show_default=options.as_typed,
        negative=(),
        allow_leading_hyphen=True,
    ),
]


def _positive(what: str, words: str, metavar: str = "MM") -> Parameter:
    return Parameter(metavar=metavar, converter=options.positive(what), n_tokens=1, help=words)


def design(
    *,
    out: Annotated[Path, options.folder("Folder for the design.")],
    area_mm: Annotated[Pair, Parameter(help="Size of the area to be touched.")] = (100.0, 60.0),
    deepest_mm: Annotated[Any, _positive("a depth in mm", "Depth of the deepest press.")] = 10.0,
    force_N: Annotated[
        Pair, Parameter(name="--force-N", help="Smallest and largest normal force of a fingertip.")
    ] = (0.1, 10.0),
    separation_mm: Annotated[
        Any,
        _positive(
            "a distance in mm", "Two-point resolution: distance at which two contacts are found as two."
        ),
    ] = 8.0,
    resolution_px: Annotated[Pair, Parameter(help="Image size of the camera.")] = (2560.0, 1440.0),
    hfov_deg: Annotated[
        Any, _positive("an angle in degrees", "Horizontal field of view of the camera.", "A")
    ] = 63.7,
    focus_mm: Annotated[Any, _positive("a distance in mm", "Smallest focus distance of the camera.")] = 100.0,
    fps: Annotated[Any, _positive("a number of frames per second", "Frame rate of the camera.", "F")] = 30.0,
    nozzle_mm: Annotated[Any, _positive("a diameter in mm", "Nozzle diameter of the printer.")] = 0.4,
    bed_mm: Annotated[
        Any,
        Parameter(
            converter=options.numbers(3, "X,Y,Z"),
            n_tokens=1,
            metavar="X,Y,Z",
            show_default=options.as_typed,
            negative=(),
            allow_leading_hyphen=True,
            help="Build volume of the printer.",
        ),
    ] = (220.0, 220.0, 250.0),
    marker_height_mm: Annotated[
        float, Parameter(metavar="MM", help="Height of the markers; 0: flush, in a second colour.")
    ] = 0.0,
    material: Annotated[
        str | None,
        Parameter(help="Material of the sheet, such as 'TPU, Shore A 60'; chosen if not specified."),
    ] = None,
    thickness_mm: Annotated[
        Any, _positive("a thickness in mm", "Thickness of the sheet; chosen if not specified.")
    ] = None,
    parts: Annotated[
        Literal["none", "mesh", "step"], Parameter(help="Parts to write; step: STEP files too.")
    ] = "mesh",
    predict: Annotated[bool, options.switch("Also predict the accuracy and plot it (some minutes).")] = False,
    explain: Annotated[bool, options.switch("Print the reason for each choice.")] = False,
    paper: Annotated[
        bool,
        options.switch(
            "The design numbers and parts of the paper: Table 1, Figure 2, equations 1 to 4. The "
            "requirements are those of the paper; only --out and --parts apply."
        ),
    ] = False,
) -> int:
    """Choose sheet, markers and camera position; write a sensor file and printable parts.

    Writes sensor.toml, design.md with the reason for each choice, scenes/ that
    simulate the design, parts/ (STL, 3MF), parts.png, patterns/ (SVG and PDF in
    true size, calibration boards), bill_of_materials.csv, assembly.md and
    assembly.png; with --predict also accuracy.csv, accuracy.png and tradeoff.png.

    Example: manytouch design --area-mm 100,60 --force-N 0.1,10 --out my-sensor --explain
    """
    if paper:
        return _paper(out, parts)
    from manytouch.cli.terminal.console import Steps
    from manytouch.cli.terminal.failures import usage_errors
    from manytouch.design.choose import design_sensor
    from manytouch.design.plots import require_plots
    from manytouch.design.requirements import CameraSpecification, Printer, Requirements
    from manytouch.design.write import require_part_packages, write_design, write_prediction, write_sensor
    from manytouch.sinks.files.atomic_output import check_writable

    with usage_errors("design"):
        requirements = Requirements(
            area_mm=area_mm,
            deepest_mm=deepest_mm,
            force_N=force_N,
            separation_mm=separation_mm,
            camera=CameraSpecification(
                width_px=round(resolution_px[0]),
                height_px=round(resolution_px[1]),
                hfov_deg=hfov_deg,
                least_focus_mm=focus_mm,
                fps=fps,
            ),
            printer=Printer(nozzle_mm=nozzle_mm, bed_mm=bed_mm),
            marker_height_mm=marker_height_mm,
            material=material,
            thickness_mm=thickness_mm,
        )
    check_writable(out)
    if parts != "none":
        require_part_packages(step=parts == "step")
    if predict:
        require_plots()
    with Steps() as steps:
        found = design_sensor(requirements, on_message=steps.step_reporter())
        for reason in found.reasons:
            steps.print(f"  {reason.about}: {reason.chosen}")
            if explain:
                steps.print(f"      {reason.why}")
        against: tuple[str, ...] = ()
        if parts == "none":
            write_sensor(found, out)
        else:
            against = write_design(found, out, step=parts == "step", on_message=steps.step_reporter())
        if predict:
            predicted = write_prediction(found, out, on_message=steps.step_reporter())
            position_mm, depth_um, force_percent = predicted.rms
            steps.print(
                f"  predicted error after calibration: position {position_mm:.2f} mm, "
                f"depth {depth_um:.0f} µm, force {force_percent:.1f} % (RMS over the area)"
            )
        for sentence in against:
            steps.print(f"  warning: {sentence}")
        guide = "" if parts == "none" else f"; next: print and assemble it as {out / 'assembly.md'} describes"
        steps.print(f"  design in {out}{guide}")
    return 0


def _paper(out: Path, parts: str) -> int:
    from manytouch.cli.terminal.console import Steps
    from manytouch.design.plots import require_plots
    from manytouch.design.published.numbers import paper_design
    from manytouch.design.published.write import equation_1, table_1, write_numbers, write_paper_design
    from manytouch.design.write import require_part_packages
    from manytouch.sinks.files.atomic_output import check_writable

    check_writable(out)
    require_plots()
    if parts != "none":
        require_part_packages(step=parts == "step")
    with Steps() as steps:
        found = paper_design(on_message=steps.step_reporter())
        for reason in found.design.reasons:
            steps.print(f"  {reason.about}: {reason.chosen}")
            steps.print(f"      {reason.why}")
        for line in ("", *table_1(found.moduli), "", *equation_1(found.spacings), ""):
            steps.print(f"  {line}")
        if parts == "none":
            out.mkdir(parents=True, exist_ok=True)
            write_numbers(found, out)
        else:
            for sentence in write_paper_design(
                found, out, step=parts == "step", on_message=steps.step_reporter()
            ):
                steps.print(f"  warning: {sentence}")
        steps.print(f"  design in {out}")
    return 0
