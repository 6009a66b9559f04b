"""The figures of sheets by group, shape, sheet and property, each with its goal."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from manytouch.evaluation.metrics.comparison import figures, pooled
from manytouch.evaluation.metrics.coverage import COVERED, Coverage
from manytouch.evaluation.metrics.metric_specs import plain
from manytouch.evaluation.suite.cases import GROUPS, PAD_GROUPS, VARIED_GROUPS
from manytouch.evaluation.suite.runner import Evaluation, Trial
from manytouch.evaluation.suite.varied.cases import VariedCase

CALIBRATED = 1.5
"""Errors with a sensor that was calibrated may be so many times those with an exact one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A figure and its goal with an exact sensor file.

    Attributes:
        label: in the head of the table.
        section, key: where the figure stands in `comparison.figures`.
        limit: at most, or with `is_least` at least; of a figure with a sign the most on both sides.
        unit: of figure and limit.
        is_least: whether more is better.
        is_error: whether it is an error: with a calibrated sensor `CALIBRATED` times as much is allowed, and
            there is no goal where the file has errors. Other goals hold with every file.
    """

    label: str
    section: str
    key: str
    limit: float
    unit: str = "%"
    is_least: bool = False
    is_error: bool = True

    def of(self, group: str) -> "Goal | None":
        """The goal of a group of cases; None if it has none."""
        if not self.is_error or group not in {"drawn", "calibrated"}:
            return self
        return None if group == "drawn" else replace(self, limit=CALIBRATED * self.limit)

    @property
    def text(self) -> str:
        """The limit with its unit."""
        return f"{'≥' if self.is_least else '≤'} {self.limit:g} {self.unit}"

    def is_reached(self, value: float) -> bool:
        """Whether a figure is within the limit."""
        return value >= self.limit if self.is_least else abs(value) <= self.limit


GOALS = (
    Goal(
        label="precision",
        section="contacts",
        key="precision_percent",
        limit=98,
        is_least=True,
        is_error=False,
    ),
    Goal(label="recall", section="contacts", key="recall_percent", limit=97, is_least=True, is_error=False),
    Goal(label="split", section="contacts", key="split_percent", limit=1, is_error=False),
    Goal(
        label="faint found",
        section="contacts",
        key="faint_recall_percent",
        limit=95,
        is_least=True,
        is_error=False,
    ),
    Goal(label="faint depth, bias", section="contacts", key="faint_depth_bias_percent", limit=2),
    Goal(label="position", section="contacts", key="position_median_mm", limit=0.2, unit="mm"),
    Goal(label="position, 95 %", section="contacts", key="position_p95_mm", limit=0.9, unit="mm"),
    Goal(label="force", section="force", key="normal_median_percent", limit=4),
    Goal(label="force, 95 %", section="force", key="normal_p95_percent", limit=12),
    Goal(label="force, bias", section="force", key="normal_bias_percent", limit=1.5),
    Goal(label="shear", section="force", key="shear_median_percent", limit=8),
    Goal(label="shear, friction", section="force", key="friction_shear_median_percent", limit=8),
    Goal(label="area", section="region", key="area_median_percent", limit=15),
    Goal(label="depth RMSE", section="depth", key="rmse_median_mm", limit=0.010, unit="mm"),
    Goal(label="peak", section="depth", key="peak_percent", limit=1),
    Goal(label="peak, 95 %", section="depth", key="peak_p95_percent", limit=3),
)
COVERAGE_KEYS = ("coverage_50", "coverage_90", "coverage_95")
PROPERTIES: dict[str, Callable[[VariedCase], bool]] = {
    "friction": lambda case: case.friction > 0.0,
    "Yeoh's law": lambda case: any(case.stiffening),
    "sag": lambda case: case.is_sagging,
    "relaxation": lambda case: case.relaxing_share > 0.0,
    "uneven thickness": lambda case: case.uneven_share > 0.0,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalRow:
    """The figures of a part of the recordings with one method.

    Attributes:
        part, method: which.
        recordings: in it.
        cells: (text, is reached) of each of `GOALS`; None where there is no figure or no goal.
        coverage: texts of `COVERAGE_KEYS` of each of `COVERED`, "" where not given, and whether the share
            within the 95 % interval is within its bounds.
        missed: goals and bounds that are not reached.
    """

    part: str
    method: str
    recordings: int
    cells: tuple[tuple[str, bool | None], ...]
    coverage: tuple[tuple[str, bool | None], ...]
    missed: int


def goal_table(evaluation: Evaluation) -> list[GoalRow]:
    """A row for each part and method that gives forces."""
    return [
        row
        for name, trials in parts(evaluation)
        for method in evaluation.methods
        if (row := _row(name, trials, method)) is not None
    ]


def parts(evaluation: Evaluation) -> Iterator[tuple[str, list[Trial]]]:
    """Parts of the recordings of sheets, if any: groups and halves, then the varied ones in detail."""
    sheets = [(trial.case, trial) for trial in evaluation.trials if trial.case is not None]
    for group in (name for name in GROUPS if name not in PAD_GROUPS):
        for looked_at, word in ((True, "may be looked at"), (False, "held out")):
            some = [each for case, each in sheets if (case.group, case.looked_at) == (group, looked_at)]
            if some:
                yield f"{group}, {word}", some
    for name in VARIED_GROUPS:
        detailed: dict[str, list[Trial]] = {}
        for case, each in sheets:
            if isinstance(case, VariedCase) and case.group == name:
                for words in _properties(case):
                    detailed.setdefault(words, []).append(each)
        yield from ((f"{name}, {words}", detailed[words]) for words in sorted(detailed))


def _properties(case: VariedCase) -> Iterator[str]:
    """The parts to which a varied case belongs."""
    yield f"shape {case.shape}"
    yield f"sheet {case.sheet}"
    yield from (words for words, belongs in PROPERTIES.items() if belongs(case))


def _row(name: str, trials: list[Trial], method: str) -> GoalRow | None:
    comparisons = [one for trial in trials for one in trial.comparisons if one.method == method]
    if not comparisons:
        return None
    found = figures(pooled(comparisons, name))
    if (
        not math.isfinite(found["force"]["normal_given_percent"])
        or not found["force"]["normal_given_percent"]
    ):
        return None
    cells: list[tuple[str, bool | None]] = []
    for usual in GOALS:
        value, goal = float(found[usual.section][usual.key]), usual.of(group_of(name))
        if not math.isfinite(value):
            cells.append(("", None))
            continue
        cells.append((f"{plain(value)} {usual.unit}", None if goal is None else goal.is_reached(value)))
    coverage: list[tuple[str, bool | None]] = []
    for quantity in COVERED:
        one = found["coverage"][quantity]
        if one is None:
            coverage.append(("", None))
            continue
        texts = " / ".join(f"{100 * one[level]:.0f}" for level in COVERAGE_KEYS)
        text = f"{texts} (n {one['contacts']}, chi² {plain(one['chi2_per_dof'])})"
        coverage.append((text, Coverage(**one).is_right))
    return GoalRow(
        part=name,
        method=method,
        recordings=len(trials),
        cells=tuple(cells),
        coverage=tuple(coverage),
        missed=sum(reached is False for _, reached in (*cells, *coverage)),
    )


def group_of(part: str) -> str:
    """The group of a part of `parts`."""
    return part.partition(",")[0]


def goal_lines(evaluation: Evaluation) -> list[str]:
    """The table as text, of the groups; then the parts of the varied cases that miss most goals."""
    rows = goal_table(evaluation)
    lines = []
    for row in rows:
        if row.part.endswith(("looked at", "held out")):
            lines.append(f"{row.part} ({row.recordings} recordings), {row.method}:")
            goals = [goal.of(group_of(row.part)) or goal for goal in GOALS]
            cells = zip(goals, row.cells, strict=True)
            lines.append("  " + ", ".join(_text(goal, *cell) for goal, cell in cells if cell[0]))
            covered = [
                f"{name} {text}{_mark(right)}"
                for name, (text, right) in zip(COVERED, row.coverage, strict=True)
                if text
            ]
            if covered:
                lines.append("  within 50 / 90 / 95 % intervals: " + ", ".join(covered))
    details = [row for row in rows if not row.part.endswith(("looked at", "held out"))]
    worst = sorted(details, key=lambda row: -row.missed)[:5]
    if worst and worst[0].missed:
        names = "; ".join(f"{row.part} ({row.method}): {row.missed} goals missed" for row in worst)
        lines.append(f"worst parts: {names}")
    return lines


def _text(goal: Goal, text: str, reached: bool | None) -> str:
    return f"{goal.label} {text}" + ("" if reached is None else f" (goal {goal.text}){_mark(reached)}")


def _mark(reached: bool | None) -> str:
    return " MISSED" if reached is False else ""
