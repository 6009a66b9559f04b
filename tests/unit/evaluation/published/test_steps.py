"""The paper, step by step: what is shown is what the method computes, and the page states its numbers."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from drawn_source import DrawnSource
from manytouch.errors import ManytouchError
from manytouch.evaluation.published.steps import page as page_of_steps
from manytouch.evaluation.published.steps.collect import PaperSteps, collect_steps
from manytouch.evaluation.published.steps.page import figures, write_steps
from manytouch.geometry.surface_sampling import sample
from manytouch.session import prepare
from manytouch.session.run import NoObserver
from manytouch.values import Reading, Sensor
from measured_once import layouts_measured_once

pytest.importorskip("matplotlib")
pytest.importorskip("jinja2")

ALL = {"1-camera", "2-grey", "3-threshold", "4-opened", "5-contours", "6-centres", "7-identities"}
DEPTHS = {"8-perimeters", "9-padded-grid", "10-surface"}


@pytest.fixture(scope="module", autouse=True)
def layouts() -> Iterator[None]:
    with layouts_measured_once():
        yield


@pytest.fixture(scope="module")
def steps() -> PaperSteps:
    return collect_steps(prepare(DrawnSource(frames=45), method="paper"))


def test_the_deepest_frame_is_explained_with_the_bits_of_the_method(steps: PaperSteps) -> None:
    readings = list(prepare(DrawnSource(frames=45), method="paper").readings())
    deepest = max(
        readings, key=lambda one: max((each.depth_mm for each in one.contacts.touching), default=0.0)
    )
    assert len(steps.reading.contacts.touching) == max(len(one.contacts.touching) for one in readings)
    same = readings[steps.reading.frame.index]
    assert 20 <= deepest.frame.index <= 40
    np.testing.assert_array_equal(same.surface.displacement_mm, steps.reading.surface.displacement_mm)
    kept = steps.stages.midpoint_px[steps.stages.is_marker]
    np.testing.assert_array_equal(steps.view.view.image_px(kept), same.detections.centre_px)
    assert set(np.unique(steps.stages.binary)) <= {0, 255}
    assert (steps.stages.opened <= steps.stages.binary).all()
    np.testing.assert_array_equal(steps.stages.binary > 0, steps.stages.grey > steps.stages.level)


def test_the_numbers_of_the_perimeter_give_the_depth_of_the_deepest_marker(steps: PaperSteps) -> None:
    found = figures(steps)
    perimeter = found["perimeter"]
    depth = perimeter["distance"] * (1.0 - perimeter["before"] / perimeter["after"])
    assert depth == pytest.approx(perimeter["depth"])
    assert depth == pytest.approx(steps.depth_by_formula_mm["corrected"])
    assert depth == pytest.approx(np.nanmax(-steps.reading.surface.displacement_mm[:, 2]))
    assert len(set(np.round(list(steps.depth_by_formula_mm.values()), 9))) == 5


def test_the_sample_calculation_is_the_surface_at_its_point(steps: PaperSteps) -> None:
    sampled = steps.sample
    assert sampled is not None
    assert sum(sampled.share) == pytest.approx(1.0)
    assert np.dot(sampled.share, sampled.depth_mm) == pytest.approx(sampled.result_mm)
    here = sample(steps.reading.surface, *sampled.point_mm[:, None])
    assert here.depth_mm == pytest.approx(sampled.result_mm)


def test_the_page_shows_every_step_and_its_numbers(steps: PaperSteps, tmp_path: Path) -> None:
    page = write_steps(steps, tmp_path / "explained")
    text = page.read_text(encoding="utf-8")
    shown = re.findall(r'src="([^"]+)\.png"', text)
    assert set(shown) == ALL | DEPTHS
    for name in shown:
        picture = cv2.imread(str(page.parent / f"{name}.png"))
        assert picture is not None
        assert picture.std() > 5.0
    assert f"<b>{steps.depth_by_formula_mm['corrected']:.2f} pitch</b>" in text
    assert f"grey level <b>{figures(steps)['level']}</b>" in text
    for contact in steps.reading.contacts.touching:
        assert f"#{contact.id}" in text


def test_a_frame_can_be_chosen_and_one_that_does_not_exist_is_refused() -> None:
    job = prepare(DrawnSource(frames=30), method="paper")
    watch = Counting()
    assert collect_steps(job, frame=7, observer=watch).reading.frame.index == 7
    assert (watch.frame_count, watch.readings) == (30, 8)
    with pytest.raises(ManytouchError, match="has no frame 99 with an image: 30 frames were read"):
        collect_steps(prepare(DrawnSource(frames=30), method="paper"), frame=99)


class Counting(NoObserver):
    """Counts what it is notified of."""

    frame_count, readings = None, 0

    def on_begin(self, sensor: Sensor, frame_count: int | None) -> None:
        self.frame_count = frame_count

    def on_reading(self, reading: Reading) -> None:
        self.readings += 1


def test_a_frame_with_contacts_and_all_markers_goes_before_one_with_lost_markers() -> None:
    def hidden(index: int, image: np.ndarray) -> np.ndarray:
        if index not in range(25, 36):
            return image
        shown = image.copy()
        shown[:60, :80] = 190  # two rows of dots, far from the press
        return shown

    readings = list(prepare(DrawnSource(frames=45, change=hidden), method="paper").readings())
    lost = {reading.frame.index for reading in readings if not reading.grid.is_seen.all()}
    assert set(range(25, 36)) <= lost
    steps = collect_steps(prepare(DrawnSource(frames=45, change=hidden), method="paper"))
    assert steps.reading.contacts.touching
    assert steps.reading.frame.index not in lost


@pytest.mark.parametrize("is_drawn", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_where_markers_are_never_numbered_the_page_says_why(
    is_drawn: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not is_drawn:
        monkeypatch.setattr(page_of_steps, "draw_steps", lambda *_: [])
    job = prepare(
        DrawnSource(frames=20, is_touched=False), method="paper", parameters={"detect.threshold": 1}
    )
    steps = collect_steps(job)
    page = write_steps(steps, tmp_path)
    text = page.read_text(encoding="utf-8")
    assert steps.rest is None
    assert "nan" not in re.sub(r"<[^>]*>", " ", text[text.index("<main>") :]).split()
    assert "none has an identity and there is no depth" in text
    assert set(re.findall(r'src="([^"]+)\.png"', text)) == (ALL if is_drawn else set())


@pytest.mark.parametrize("is_drawn", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_unit_quads_are_explained_by_one_of_them(
    is_drawn: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not is_drawn:
        monkeypatch.setattr(page_of_steps, "draw_steps", lambda *_: [])
    job = prepare(DrawnSource(frames=30), method="paper", parameters={"estimate.formula": "unit_quads"})
    steps = replace(collect_steps(job, frame=29), true_depth_mm=1.25)
    text = write_steps(steps, tmp_path).read_text(encoding="utf-8")
    depth = -float(steps.reading.surface.displacement_mm[steps.marker, 2])
    assert f"the mean of all is <b>{depth:.2f} pitch</b>" in text
    assert "<b>1.25</b>" in text
