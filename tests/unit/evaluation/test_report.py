"""The page and its JSON: complete and self-contained."""

import json
import re
from collections.abc import Callable
from dataclasses import asdict, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from manytouch.errors import MissingExtraError, OutputError
from manytouch.evaluation.evaluated_recordings.evaluated_recording import ContactRows, EvaluatedRecording
from manytouch.evaluation.metrics.comparison import compare
from manytouch.evaluation.metrics.metric_specs import METRICS, MetricSpec, rating, written
from manytouch.evaluation.metrics.metric_specs import plain as number
from manytouch.evaluation.report import goals, svg_theme
from manytouch.evaluation.report import page as report
from manytouch.evaluation.report.ratings import cell, limits, rate_methods, table
from manytouch.evaluation.report.report_data import contents, forces_in_short, in_short, plain
from manytouch.evaluation.suite.cases import Case, Touch
from manytouch.evaluation.suite.runner import Evaluation, Trial
from manytouch.evaluation.suite.suite import cases

Sheet = Callable[..., EvaluatedRecording]
Table = Callable[..., ContactRows]
FRAMES = 20
VOID = {"meta", "img", "br", "hr", "link", "input", "path", "use", "image", "rect", "stop"}


def rising(
    sheet: Sheet, contact_table: Table, method: str, wrong: float, *, gives: bool = True
) -> EvaluatedRecording:
    """A dent that deepens under two contacts; `wrong` is the relative error of everything."""
    depth = np.outer(np.linspace(0.5, 4.0, FRAMES), np.hypot(*np.indices((3, 5)).reshape(2, -1)) / 4)
    contacts = [
        (frame, n, x + 2 * wrong, wrong, 2.0 * (1 + wrong), force * (1 + wrong), 0.3, 0.1)
        for frame in range(FRAMES)
        for n, (x, force) in enumerate(((-8.0, 2.0), (8.0, 2.0 if frame % 2 else 0.6)))
    ]
    deviations = dict.fromkeys(("x_std", "y_std", "depth_std", "force_std"), 0.2) if gives else {}
    table_ = contact_table([c if gives else c[:5] for c in contacts], **deviations)
    one = replace(sheet(frames=FRAMES, method=method), contacts=table_)
    return replace(
        one,
        depth_mm=depth * (1 + wrong),
        centre_px=one.centre_px + wrong,
        depth_std_mm=np.full(depth.shape, 0.1 if gives else np.nan),
        milliseconds=np.linspace(3, 9, FRAMES),
    )


@pytest.fixture(scope="module")
def evaluation(sheet: Sheet, contact_table: Table) -> Evaluation:
    truth = rising(sheet, contact_table, "", 0.0)
    picture = np.tile(np.arange(64, dtype=np.uint8), (40, 1))
    good = compare(truth, rising(sheet, contact_table, "careful", 0.02), picture=lambda _: picture)
    bad = compare(truth, rising(sheet, contact_table, "rash & <odd>", 0.6, gives=False))
    case = Case(
        group="nominal",
        name="one",
        seed=1,
        looked_at=True,
        touches=(Touch(at_mm=(0.0, 0.0), radius_mm=3.0, strength=1.0),),
        deepest_mm=1.0,
    )
    trials = tuple(
        Trial(
            title=f"{group}/{name}",
            case=replace(case, group=group, name=name, looked_at=looked_at),
            comparisons=(good, bad),
        )
        for group, name, looked_at in (
            ("nominal", "one", True),
            ("separation", "two", False),
            ("stress", "three", True),
        )
    )
    return Evaluation(
        title="Accuracy suite",
        truth_description="A made-up dent",
        methods=("careful", "rash & <odd>"),
        trials=trials,
        left_out={"stress/slippery": "nobody can play it"},
        settings={"versions": {"manytouch": "0.0"}},
        seconds=66.0,
    )


@pytest.fixture(scope="module")
def written_page(evaluation: Evaluation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return report.write_report(evaluation, tmp_path_factory.mktemp("report") / "out")


@pytest.fixture(scope="module")
def page(written_page: Path) -> str:
    return written_page.read_text(encoding="utf-8")


class Outline(HTMLParser):
    """What a page is made of, and whether it is well formed."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.inner: list[str] = []
        self.addresses: list[str] = []
        self.counts: dict[str, int] = {}
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag] = self.counts.get(tag, 0) + 1
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in {"src", "href", "data", "action", "poster", "srcset"}:
                self.addresses.append(value or "")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


def outline(page: str) -> Outline:
    found = Outline()
    found.feed(page)
    assert found.open == []
    return found


def test_a_part_without_contacts_has_no_line_of_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = tuple(("", None) for _ in goals.GOALS)
    without = goals.GoalRow(
        part="varied, may be looked at",
        method="mechanics",
        recordings=1,
        cells=cells,
        coverage=tuple(("", None) for _ in goals.COVERED),
        missed=0,
    )
    whole = Evaluation(title="suite", truth_description="", methods=("mechanics",), trials=())
    shown = replace(without, coverage=(("40 / 80 / 90", True), *without.coverage[1:]))
    for row, count in ((without, 0), (shown, 1)):
        monkeypatch.setattr(goals, "goal_table", lambda _, row=row: [row])
        lines = goals.goal_lines(whole)
        assert sum("intervals" in line for line in lines) == count


def test_the_page_has_every_section(page: str) -> None:
    found = outline(page)
    sections = ("summary", "detection", "depth", "contacts", "force", "separation", "uncertainty")
    for section in (*sections, "worst", "latency", "cases", "settings"):
        assert section in found.ids, section
    assert found.counts["svg"] >= 2 + 2 + 2 + 1 + 2 + 3 + 1 + 4
    assert found.counts["img"] == 2  # of the worst worst that have a picture


def test_the_page_needs_nothing_from_outside(page: str) -> None:
    for address in outline(page).addresses:
        assert address.startswith(("#", "data:image/")), address
    assert "http" not in page
    assert "@import" not in page
    assert "<script" not in page
    assert all(inner.startswith("#") for inner in re.findall(r"url\(([^)]*)\)", page))


def test_names_within_the_page_are_unique_and_lead_somewhere(page: str) -> None:
    found = outline(page)
    assert len(found.ids) == len(set(found.ids))
    inner = [a[1:] for a in found.addresses if a.startswith("#")] + re.findall(r"url\(#([^)]*)\)", page)
    assert set(inner) <= set(found.ids)


def test_the_page_has_both_colours_and_no_stand_in_for_one(page: str) -> None:
    assert "prefers-color-scheme: dark" in page
    assert "@media print" in page
    assert not re.search(r"#0102\d\d", page)
    assert "var(--method-1)" in page


def test_names_of_methods_are_text_not_markup(page: str) -> None:
    assert "<odd>" not in page
    assert "rash &amp; &lt;odd&gt;" in page


def test_the_page_states_what_the_truth_is_and_what_was_left_out(page: str) -> None:
    assert "A made-up dent." in page
    assert "stress/slippery: nobody can play it" in page
    assert "It took 1.1 minutes" in page


def test_json_survives_its_round_trip_and_agrees_with_the_page(
    evaluation: Evaluation, written_page: Path
) -> None:
    read = json.loads((written_page.parent / "report.json").read_text())
    assert read == contents(evaluation)
    assert written_page.name == "report.html"
    assert read["figures"]["careful"]["all"]["depth"]["peak_percent"] == pytest.approx(2)
    assert read["figures"]["rash & <odd>"]["all"]["force"]["normal_median_N"] is None
    assert set(read["figures"]["careful"]) == {
        *("all", "nominal", "separation", "stress", "looked_at", "held_out")
    }
    assert read["cases"][1]["case"]["looked_at"] is False
    assert sorted(path.name for path in written_page.parent.iterdir()) == ["report.html", "report.json"]


@pytest.mark.slow
def test_a_single_recording_makes_a_page_too(evaluation: Evaluation, monkeypatch: pytest.MonkeyPatch) -> None:
    (method, *_), (trial, *_) = evaluation.methods, evaluation.trials
    trial = replace(trial, case=None, comparisons=trial.comparisons[:1])
    monkeypatch.setattr(report, "WORST_PER_METHOD", 1)
    single = replace(evaluation, methods=(method,), trials=(trial,), seconds=float("nan"), left_out={})
    page = report.rendered(single, contents(single))
    outline(page)
    assert "1 recording" in page
    assert "By group" not in page
    assert "It took" not in page


def test_nothing_that_touches_makes_a_page_too(sheet: Sheet) -> None:
    still = sheet(method="idle")
    trial = Trial(title="rest", case=None, comparisons=(compare(sheet(), still),))
    quiet = Evaluation(title="rest", truth_description="Rest", methods=("idle",), trials=(trial,))
    page = report.rendered(quiet, contents(quiet))
    outline(page)
    assert "In no frame does anything touch" in page
    assert "No method gives a force here" in page
    assert "1 recording" in page
    assert "By group" not in page
    assert "It took" not in page


def test_a_folder_that_cannot_be_written_is_one_sentence(evaluation: Evaluation, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write"):
        report.write_report(evaluation, tmp_path / "file")


@pytest.mark.parametrize("package", ["jinja2", "matplotlib"])
def test_a_missing_package_is_named_with_its_extra(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def found(name: str) -> object | None:
        return None if name == package else object()

    monkeypatch.setattr(report, "find_spec", found)
    monkeypatch.setattr(svg_theme, "find_spec", found)
    with pytest.raises(MissingExtraError, match=rf"{package}.*manytouch\[lab\]"):
        report.require_packages()


# words and ratings

LESS = MetricSpec(section="depth", key="a", label="a", unit="mm", good=0.1, poor=1.0)
MORE = MetricSpec(section="depth", key="b", label="b", unit="%", good=98.0, poor=80.0)
FACTOR = MetricSpec(section="depth", key="e", label="e", good=1.5, poor=3.0, aim=1.0, is_factor=True)
AIM = MetricSpec(section="calibration", key="c", label="c", unit="share", good=0.03, poor=0.1, aim=0.95)


@pytest.mark.parametrize(
    ("line", "value", "word"),
    [
        *((LESS, 0.1, "good"), (LESS, 0.11, "fair"), (LESS, 1.0, "fair"), (LESS, 1.01, "poor")),
        *((MORE, 98.0, "good"), (MORE, 97.0, "fair"), (MORE, 80.0, "fair"), (MORE, 79.0, "poor")),
        *((AIM, 0.97, "good"), (AIM, 0.93, "good"), (AIM, 0.87, "fair"), (AIM, 0.5, "poor")),
        *((FACTOR, 1.4, "good"), (FACTOR, 0.7, "good"), (FACTOR, 0.5, "fair"), (FACTOR, 0.03, "poor")),
        *((FACTOR, 3.1, "poor"), (FACTOR, 0.0, "poor")),
        (LESS, float("nan"), "none"),
        (MetricSpec(section="depth", key="d", label="d"), 5.0, "none"),
    ],
)
def test_ratings(line: MetricSpec, value: float, word: str) -> None:
    assert rating(line, value) == word


def test_limits_of_lengths_shrink_with_the_pitch() -> None:
    assert rating(LESS, 0.09, "mm") == "good"
    assert rating(LESS, 0.09, "pitch") == "fair"
    assert limits(LESS, "pitch") == "≤ 0.025, poor > 0.25"
    assert limits(MORE, "pitch") == "≥ 98, poor < 80"
    assert limits(FACTOR, "mm") == "1 within × 1.5, poor beyond × 3"
    assert limits(AIM, "mm") == "95 ± 3, poor beyond ± 10"


def test_figures_are_written_with_unit_and_no_exponent() -> None:
    assert written(LESS, 0.01234, "mm") == "0.0123 mm"
    assert written(LESS, 0.01234, "pitch") == "0.0123 pitch"
    assert written(AIM, 0.123) == "12.3 %"
    assert written(LESS, float("nan")) == "not given"
    assert [number(value) for value in (12345.6, 1.0, -0.5, 0.0)] == ["12346", "1.00", "−0.500", "0"]


def test_every_line_of_the_tables_is_a_figure_that_exists(evaluation: Evaluation) -> None:
    figured = contents(evaluation)["figures"]["careful"]["all"]
    for line in METRICS:
        place: Any = figured[line.section]
        if line.section != "calibration":
            assert line.key in place, line
        elif place[line.key.split(".")[0]] is not None:
            assert line.key.split(".")[1] in place[line.key.split(".")[0]], line


def test_the_careful_method_is_best_and_the_rash_one_poor(evaluation: Evaluation) -> None:
    data = contents(evaluation)
    rows = {row.label: row for row in table(data, "summary")}
    assert [one.is_best for one in rows["depth RMSE over the sheet, median frame"].cells] == [True, False]
    careful, rash = rate_methods(data)
    assert ("peak depth error, median", "2.00 %") in careful.good
    assert ("peak depth error, median", "60.0 %") in rash.poor
    assert "normal force error, relative, median" in rash.missing


def test_a_separation_never_reached_is_poor_and_without_pairs_is_not_given() -> None:
    line = next(line for line in METRICS if line.section == "separation")
    of_ratio = line.key.replace("from_mm", "pairs")
    never = cell(line, {"separation": {"pairs": 4, of_ratio: 4, line.key: None}}, "mm")
    none = cell(line, {"separation": {"pairs": 4, of_ratio: 0, line.key: None}}, "mm")  # of another ratio
    assert (never.text, never.rating) == ("never", "poor")
    assert (none.text, none.rating) == ("not given", "none")


def test_errors_are_not_ranked_when_different_shares_are_given(evaluation: Evaluation) -> None:
    data = contents(evaluation)
    data["figures"]["rash & <odd>"]["all"]["depth"]["given_percent"] = 50.0
    rows = {row.label: row for row in table(data, "depth")}
    assert not any(one.is_best for one in rows["depth RMSE over the sheet, median frame"].cells)
    assert rows["markers whose depth is given"].cells[0].is_best


def test_nan_becomes_null_and_keys_become_text() -> None:
    assert plain({1: [float("nan"), np.float64(2.0), float("inf"), True, "x"]}) == {
        "1": [None, 2.0, None, True, "x"]
    }


def test_every_case_of_the_suite_can_be_part_of_the_json_report() -> None:
    for case in cases():
        assert json.dumps(plain(asdict(case)), allow_nan=False)


def test_the_line_of_forces_has_error_and_coverage_where_there_are_forces(evaluation: Evaluation) -> None:
    line = forces_in_short(evaluation, "careful")
    assert line is not None
    assert "normal force error, relative, median" in line
    assert "normal force: within the 95 % interval" in line
    assert forces_in_short(evaluation, "rash & <odd>") is None
    assert forces_in_short(evaluation, "nobody") is None


def test_in_short_names_the_main_figures(evaluation: Evaluation) -> None:
    assert "peak depth error, median 2.00 %" in in_short(evaluation, "careful")
    assert in_short(evaluation, "nobody") == "no recording"
