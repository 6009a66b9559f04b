"""The paper's experiments side by side with ours: one HTML page that needs nothing else, and JSON."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from manytouch.evaluation.published import material, places, spacing
from manytouch.evaluation.published.formulas import FormulaError, formula_errors
from manytouch.evaluation.published.speed import Speed, speed
from manytouch.evaluation.published.stall import StallTest, stall_chart, stall_tests
from manytouch.evaluation.report.report_data import plain
from manytouch.evaluation.report.svg_theme import FOREGROUND, METHOD_COLOURS, SOFT, figure, svg
from manytouch.evaluation.suite.recordings import FemSimulation
from manytouch.evaluation.suite.solutions import Solutions, solve_missing
from manytouch.evaluation.suite.workers import RunObserver
from manytouch.pipeline import Pipeline
from manytouch.simulation.fem.cache import StateCache
from manytouch.sinks.files.atomic_output import atomic_file

PAGE = "published.html.jinja"
HEIGHTS_MM = (0.0, 1.0, 2.0)
MODULI_MPA = (0.01, 3.1, 5.0, 10.0)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Experiments:
    """What came out.

    Attributes:
        deflections: Table 1 and Figure 2, one for each sheet.
        sag_mm: of the 120 x 80 mm sheet of the printed modulus under its own weight.
        gaps: Figure 3 and equation 1, for some heights of the markers.
        gap_MPa: modulus of the sheet that they stand on.
        formulas: equations 11 to 13 in their readings, on the demo's scene.
        presses: Table 3 by method; "truth" is the simulated press.
        stalls: fast motion, by method and speed.
        speed: frames per second.
    """

    deflections: tuple[material.Deflection, ...]
    sag_mm: float
    gaps: tuple[spacing.Gaps, ...]
    gap_MPa: float
    formulas: tuple[FormulaError, ...]
    presses: dict[str, tuple[places.PublishedPress, places.PublishedPress]]
    stalls: tuple[StallTest, ...]
    speed: Speed


def experiments(
    methods: Mapping[str, Pipeline],
    folder: Path,
    *,
    observer: RunObserver | None = None,
    stop: Callable[[], bool] | None = None,
    processes: int = 1,
) -> Experiments | None:
    """Do them all; solved states are kept in a folder. None when it was stopped."""
    solutions, cache = Solutions(folder=folder), StateCache(folder=folder)
    solve_missing(places.presses(), solutions, observer=observer, stop=stop, processes=processes)
    if observer is not None:
        observer.begin("solving", len(material.SHEETS_MM))
    deflections = []
    for size_mm in material.SHEETS_MM:
        if stop is not None and stop():
            return None
        deflections.append(material.deflection(size_mm, cache))
        if observer is not None:
            young_MPa = deflections[-1].young_MPa
            observer.done(f"{size_mm[0]:g} x {size_mm[1]:g} mm", f"10.1 mm deep with {young_MPa:.2f} MPa")
    pressed, gap_MPa = material.printed_press(cache)
    simulation = FemSimulation(solutions=solutions)
    return Experiments(
        deflections=tuple(deflections),
        sag_mm=material.sag_mm(cache),
        gaps=tuple(spacing.gaps(pressed, height_mm) for height_mm in HEIGHTS_MM),
        gap_MPa=gap_MPa,
        formulas=formula_errors(),
        presses=places.table(methods, simulation),
        stalls=stall_tests(_tracked_alike_once(methods)),
        speed=speed(simulation.simulate(places.presses()[0])),
    )


def _tracked_alike_once(methods: Mapping[str, Pipeline]) -> dict[str, Pipeline]:
    """Without `mechanics` where there is `perimeter`, which detects and tracks in the same way."""
    return {name: each for name, each in methods.items() if name != "mechanics" or "perimeter" not in methods}


def contents(found: Experiments) -> dict[str, Any]:
    """All figures; None where one is not known."""
    data: dict[str, Any] = plain(
        {
            "material": [
                {
                    "size_mm": one.size_mm,
                    "linear_young_MPa": one.linear_young_MPa,
                    "young_MPa": one.young_MPa,
                    "linear_depth_at_printed_modulus_mm": one.linear_depth_mm(material.PRINTED_MPA),
                    "depth_mm": {f"{young:g}": one.depth_of_10_N_mm(young) for young in MODULI_MPA},
                    "curve": {
                        "force_over_E_mm2": one.force_over_E_mm2.tolist(),
                        "depth_mm": one.depth_mm.tolist(),
                    },
                }
                for one in found.deflections
            ],
            "sag_mm": found.sag_mm,
            "gap_young_MPa": found.gap_MPa,
            "gaps": [asdict(one) for one in found.gaps],
            "formulas": [asdict(one) for one in found.formulas],
            "table_3": {
                **{name: list(values) for name, values in places.PUBLISHED.items()},
                **{name: row(presses) for name, presses in found.presses.items()},
            },
            "table_3_std": {name: deviations(presses) for name, presses in found.presses.items()},
            "stalls": [asdict(one) for one in found.stalls],
            "speed": asdict(found.speed) | {"frames_per_second": found.speed.frames_per_second},
        }
    )
    return data


def row(presses: tuple[places.PublishedPress, places.PublishedPress]) -> list[float]:
    """The three columns of Table 3: both places, and the mean of both depths."""
    return [*(one.along_mm for one in presses), float(np.mean([one.depth_mm for one in presses]))]


def deviations(presses: tuple[places.PublishedPress, places.PublishedPress]) -> list[float]:
    """Standard deviations of the three columns of Table 3; for the depth that of one press."""
    return [*(one.along_std_mm for one in presses), max(one.depth_std_mm for one in presses)]


def write_page(found: Experiments, folder: Path) -> Path:
    """Write paper.html and paper.json; each is complete or absent. Gives the page."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("manytouch.evaluation", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    data = contents(found)
    text = environment.get_template(PAGE).render(
        data=data,
        moduli=[f"{young:g}" for young in MODULI_MPA],
        chart=Markup(deflection_chart(found.deflections)),
        stall_chart=Markup(stall_chart(found.stalls)),
        truth=data["table_3"]["truth"],
    )
    page = folder / "paper.html"
    for path, content in (
        (folder / "paper.json", json.dumps(data, indent=1, allow_nan=False) + "\n"),
        (page, text),
    ):
        with atomic_file(path) as partial:
            partial.write_text(content, encoding="utf-8")
    return page


def deflection_chart(deflections: tuple[material.Deflection, ...]) -> str:
    """Depth of 10 N against the modulus, with large deflection and linear."""
    with figure(7.4, 3.6) as drawn:
        axes = drawn.add_subplot()
        for number, one in enumerate(deflections):
            young_MPa = material.FORCE_N / one.force_over_E_mm2[1:]
            label = f"{one.size_mm[0]:g} × {one.size_mm[1]:g} mm"
            axes.plot(young_MPa, one.depth_mm[1:], color=METHOD_COLOURS[number], label=label)
            dense_MPa = np.geomspace(1.6, 42.0, 80)
            linear = [one.linear_depth_mm(float(young)) for young in dense_MPa]
            axes.plot(dense_MPa, linear, color=METHOD_COLOURS[number], linestyle=":", linewidth=1.2)
        axes.axhline(material.PRINTED_DEPTH_MM, color=FOREGROUND, linewidth=0.8)
        axes.text(
            41, material.PRINTED_DEPTH_MM + 0.2, "printed: 10.1 mm", color=SOFT, ha="right", va="bottom"
        )
        axes.set_xscale("log")
        axes.set_xlim(1.6, 42)
        axes.set_ylim(0, 16)
        axes.set_xticks([2, 5, 10, 20, 40], ["2", "5", "10", "20", "40"])
        axes.minorticks_off()
        axes.set_xlabel("Young's modulus (MPa)")
        axes.set_ylabel("depth under 10 N on 1 cm² (mm)")
        axes.set_title("Large deflection (lines) and that of a linear model (dots)")
        axes.legend(loc="lower left")
        return svg(drawn, "Depth of a pressed sheet against its Young's modulus")
