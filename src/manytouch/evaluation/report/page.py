"""The report: one HTML page that needs nothing else, and the same as JSON."""

import base64
import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from manytouch.errors import MissingExtraError
from manytouch.evaluation.metrics.comparison import MethodErrors, uncertainty_calibrations
from manytouch.evaluation.metrics.coverage import COVERED
from manytouch.evaluation.metrics.separation import RATIOS
from manytouch.evaluation.report import charts, maps
from manytouch.evaluation.report.goals import CALIBRATED, GOALS, goal_table
from manytouch.evaluation.report.pad_goals import goal_rows
from manytouch.evaluation.report.ratings import case_rows, halves_rows, rate_methods, table
from manytouch.evaluation.report.report_data import contents, main_trials, part, unit_of
from manytouch.evaluation.report.svg_theme import require_matplotlib
from manytouch.evaluation.suite.runner import Evaluation
from manytouch.sinks.files.atomic_output import atomic_file

PAGE = "page.html.jinja"
QUANTITIES = ("centre", "depth", "position", "force")
WORST_PER_METHOD = 2


def require_packages() -> None:
    """Raises MissingExtraError when the page cannot be made; to be called before a long run."""
    if find_spec("jinja2") is None:
        raise MissingExtraError("the report", "jinja2", "lab")
    require_matplotlib()


def write_report(evaluation: Evaluation, folder: Path) -> Path:
    """Write report.html and report.json; each is complete or absent.

    Returns:
        The page.

    Raises:
        MissingExtraError: jinja2 or matplotlib is not installed.
        OutputError: the folder cannot be written.
    """
    require_packages()
    data = contents(evaluation)
    _write(folder / "report.json", json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    page = folder / "report.html"
    _write(page, rendered(evaluation, data))
    return page


def rendered(evaluation: Evaluation, data: dict[str, Any]) -> str:
    """The page as text."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("manytouch.evaluation", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    compared = {method: one for method in evaluation.methods if (one := part(evaluation, method)) is not None}
    unit = unit_of(evaluation)
    drawn = _drawings(evaluation, compared, unit)
    return environment.get_template(PAGE).render(
        evaluation=evaluation,
        data=data,
        unit=unit,
        compared=compared,
        ratings=rate_methods(data),
        table=lambda section: table(data, section),
        halves=halves_rows(data),
        pads=goal_rows(evaluation),
        goals=GOALS,
        calibrated=CALIBRATED,
        covered=COVERED,
        sheets=goal_table(evaluation),
        cases=case_rows(data),
        drawn={name: [Markup(item) for item in items] for name, items in drawn.items()},
        worst=_worst(evaluation, unit, Markup),
        settings=json.dumps(data["settings"], indent=1, ensure_ascii=False),
        minutes=evaluation.seconds / 60,
    )


def _drawings(evaluation: Evaluation, compared: dict[str, MethodErrors], unit: str) -> dict[str, list[str]]:
    if not compared:
        return {}
    deviations = {method: uncertainty_calibrations(one) for method, one in compared.items()}
    promised = [name for name in QUANTITIES if any(found[name] for found in deviations.values())]
    forces = [one.contacts for one in compared.values()]
    is_force = any(np.isfinite(one.force_N - one.true_force_N).any() for one in forces)
    depth = [charts.depth_error_chart(compared)]
    if len(evaluation.trials) > 1:
        depth.append(charts.rmse_chart(main_trials(evaluation), evaluation.methods))
    return {
        "maps": maps.error_maps(compared),
        "depth": depth,
        "contacts": [charts.position_chart(compared), charts.offset_chart(compared)],
        "force": [charts.force_chart(compared)] if is_force else [],
        "separation": [charts.separation_chart(compared, ratio) for ratio in RATIOS],
        "reliability": [charts.reliability_chart(deviations, name) for name in promised],
        "latency": [charts.latency_chart(compared)],
    }


def _worst(evaluation: Evaluation, unit: str, markup: Any) -> list[dict[str, Any]]:
    shown = []
    for method in evaluation.methods:
        trials = main_trials(evaluation)
        everything = [one for trial in trials for one in trial.comparisons if one.method == method]
        for worst_frame in maps.worst_frames(everything, WORST_PER_METHOD):
            shown.append(
                {
                    "worst_frame": worst_frame,
                    "missed": int((~worst_frame.is_found).sum()),
                    "false": int((~worst_frame.is_right).sum()),
                    "maps": markup(maps.worst_figure(worst_frame, unit)),
                    "picture": None if worst_frame.picture is None else data_address(worst_frame.picture),
                }
            )
    return shown


def data_address(picture: np.ndarray) -> str:
    """A picture as the address of itself."""
    _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 72])
    return "data:image/jpeg;base64," + base64.b64encode(encoded.tobytes()).decode("ascii")


def _write(path: Path, text: str) -> None:
    with atomic_file(path) as partial:
        partial.write_text(text, encoding="utf-8")
