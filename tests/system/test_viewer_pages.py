"""The page of the viewer with given readings: without WebGL, at two sizes, labels, questions, downloads."""

import csv
import io
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nicegui")
pytest.importorskip("playwright")

from playwright.sync_api import Browser, Page

from browser import CHROMIUM, FLAGS, launched, wait, wait_for_paint, wait_for_text, wait_until
from manytouch.sinks.files.tables import contact_column_names
from manytouch.sinks.viewer import Viewer
from manytouch.values import Reading, Status, Tare, UndoTare
from viewer_session import FakeSession, reading_of

PIXEL = """([x, y]) => {
  const canvas = document.querySelector('#scene > canvas'), box = canvas.getBoundingClientRect();
  const [left, top] = manytouch.pane.onScreen(x, y);
  return [...canvas.getContext('2d').getImageData(left - box.left, top - box.top, 1, 1).data];
}"""
DEPTH_AXIS = """(() => {
  const { children } = manytouch.pane.axes.tower, isShown = ({ style }) => style.visibility !== 'hidden';
  const labels = children.map(({ element }) => element).filter((element) => element && isShown(element));
  const boxes = (found) => found.map((e) => e.getBoundingClientRect())
    .map(({ left, top, right, bottom }) => [left, top, right, bottom]);
  const points = children.find(({ geometry }) => geometry)?.geometry.attributes.position.count ?? 0;
  return { ticks: points ? points / 2 - 1 : 0,
    numbers: boxes(labels.filter(({ className }) => !className.includes('name'))),
    names: boxes(labels.filter(({ className }) => className.includes('name'))),
    colours: boxes([document.getElementById('scale')])[0] };
})()"""
NO_WEBGL = [*(flag for flag in FLAGS if "gl" not in flag), "--disable-3d-apis"]
IN_TIME = "manytouch.state.count >= 1 && manytouch.state.sceneInfo && manytouch.state.paints > 0"
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")


@pytest.fixture(
    scope="module", params=[True, pytest.param(False, marks=pytest.mark.slow)], ids=["webgl", "flat"]
)
def browser(request: pytest.FixtureRequest) -> Iterator[Browser]:
    with launched(FLAGS if request.param else NO_WEBGL) as opened:
        yield opened


@pytest.fixture
def shown() -> Iterator[tuple[FakeSession, Viewer]]:
    session = FakeSession()
    viewer = Viewer(session)
    viewer.write(reading_of(0))
    yield session, viewer
    viewer.close()


def opened_page(browser: Browser, viewer: Viewer, size: tuple[int, int] = (1366, 768), **more: Any) -> Page:
    screen = {"viewport": {"width": size[0], "height": size[1]}, "device_scale_factor": 0.5}
    page = browser.new_page(**(screen | more))
    page.goto(viewer.url)
    wait(page, IN_TIME)
    return page


def crowded(index: int = 0, count: int = 12) -> Reading:
    """Contacts with ids of three digits, all close together."""
    reading = reading_of(index)
    (one,) = reading.contacts.contacts
    contacts = tuple(
        replace(
            one,
            id=100 + k,
            centre_mm=np.array([-20.0 + 2.0 * k, 8.0]),
            centre_px=np.array([90.0 + 4 * k, 90.0]),
        )
        for k in range(count)
    )
    return replace(reading, contacts=replace(reading.contacts, contacts=contacts))


@pytest.mark.parametrize("size", [(1366, 768), (390, 844)])
def test_surface_contacts_and_plots_are_shown_and_nothing_is_cut_off(
    browser: Browser, shown: tuple[FakeSession, Viewer], size: tuple[int, int]
) -> None:
    page = opened_page(browser, shown[1], size, device_scale_factor=1)
    assert page.inner_text("#state-label") == "live"
    wait_for_text(page, "#contacts tbody", "7", "1.50")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.evaluate("((box) => box.scrollWidth <= box.clientWidth)(document.querySelector('.scroll'))")
    assert page.is_visible("#flat-note") == page.evaluate("Boolean(manytouch.pane.isFlat)")
    if page.evaluate("Boolean(manytouch.pane.isFlat)"):
        dent, sheet = (page.evaluate(PIXEL, at_mm) for at_mm in ([-17.0, 8.0], [50.0, -30.0]))
        assert np.abs(np.subtract(dent, sheet)).max() > 50
    page.close()


def test_the_timeline_and_the_buttons_fit_a_phone(
    browser: Browser, shown: tuple[FakeSession, Viewer]
) -> None:
    session, viewer = shown
    session.now = replace(session.now, frame=1000, frame_count=12000)
    page = opened_page(browser, viewer, (390, 844))
    page.wait_for_selector("#timeline:not([hidden])")
    card = page.locator(".card.surface").bounding_box()
    speed = page.locator("#speed").bounding_box()
    assert card is not None
    assert speed is not None
    assert speed["x"] + speed["width"] <= card["x"] + card["width"]
    assert page.evaluate("document.getElementById('seek').clientWidth") > 200
    tops = page.evaluate(
        """[...document.querySelectorAll('.bar .buttons button:not([hidden])')]
        .map((e) => e.getBoundingClientRect().top)"""
    )
    assert max(tops) - min(tops) < 10, "the buttons are in one row"
    page.close()


def test_a_click_measures_with_and_without_webgl(browser: Browser, shown: tuple[FakeSession, Viewer]) -> None:
    page = opened_page(browser, shown[1])
    page.mouse.click(*page.evaluate("manytouch.pane.onScreen(-20, 8)"))
    wait(page, "manytouch.state.points.length === 1")
    assert page.evaluate("manytouch.state.points[0]") == pytest.approx([-20.0, 8.0], abs=1.5)
    page.close()


@pytest.mark.parametrize("size", [(1366, 768), (390, 844)])
def test_labels_cover_neither_each_other_nor_the_colour_bar(
    browser: Browser, shown: tuple[FakeSession, Viewer], size: tuple[int, int]
) -> None:
    shown[1].write(crowded(count=8))
    page = opened_page(browser, shown[1], size)
    if page.evaluate("Boolean(manytouch.pane.isFlat)"):
        pytest.skip("labels are painted on the map; their places are those of label_places.js too")
    wait(page, "document.querySelectorAll('#scene .tag').length === 8")
    wait_for_paint(page)
    boxes = page.evaluate(
        """[...document.querySelectorAll('#scene .tag, #scene .scale, #scene .axis')]
        .filter((e) => e.style.visibility !== 'hidden').map((e) => e.getBoundingClientRect())
        .map(({ left, top, right, bottom }) => [left, top, right, bottom])"""
    )
    for k, (left, top, right, bottom) in enumerate(boxes):
        for other in boxes[k + 1 :]:
            apart = (
                left >= other[2] - 1 or other[0] >= right - 1 or top >= other[3] - 1 or other[1] >= bottom - 1
            )
            assert apart, (boxes[k], other)
    page.close()


def is_apart(one: list[float], other: list[float]) -> bool:
    """Whether two rectangles (left, top, right, bottom) do not overlap."""
    return one[0] >= other[2] or other[0] >= one[2] or one[1] >= other[3] or other[1] >= one[3]


@pytest.mark.parametrize("depth_mm", [0.0, 5.5])
@pytest.mark.parametrize("size", [(360, 640), (400, 800), (560, 800), (1366, 768)])
def test_the_depth_axis_has_a_number_at_each_tick_and_nothing_covers_it(
    browser: Browser, shown: tuple[FakeSession, Viewer], size: tuple[int, int], depth_mm: float
) -> None:
    session, viewer = shown
    session.now = replace(session.now, frame=10, frame_count=100)
    reading = reading_of(1, depth_mm)
    viewer.write(replace(reading, contacts=replace(reading.contacts, contacts=())))
    page = opened_page(browser, viewer, size)
    if page.evaluate("Boolean(manytouch.pane.isFlat)"):
        pytest.skip("the map has no depth axis")
    page.wait_for_selector("#timeline:not([hidden])")
    page.click("#home")
    wait_for_paint(page)
    axis = page.evaluate(DEPTH_AXIS)
    left, top = page.evaluate("manytouch.pane.onScreen(manytouch.pane.x[0], manytouch.pane.y[0])")
    page.close()
    assert len(axis["numbers"]) == axis["ticks"] >= 1
    assert len(axis["names"]) == 1, "the name of the axis has the unit"
    assert all(is_apart(box, axis["colours"]) for box in (*axis["numbers"], *axis["names"]))
    assert is_apart([left, top, left + 1, top + 1], axis["colours"]), "the corner of the sheet is seen"
    assert min(top - box[3] for box in axis["numbers"]) > 0, "the lowest number is above the sheet"


def test_a_depth_axis_that_is_seen_from_its_end_or_behind_the_sheet_is_not_drawn(
    browser: Browser, shown: tuple[FakeSession, Viewer]
) -> None:
    page = opened_page(browser, shown[1])
    if page.evaluate("Boolean(manytouch.pane.isFlat)"):
        pytest.skip("the map has no depth axis")
    wait_for_paint(page)
    assert page.evaluate(DEPTH_AXIS)["ticks"]
    page.click("#side")
    wait_for_paint(page)
    assert not page.evaluate(DEPTH_AXIS)["ticks"]
    page.click("#side")
    wait_for_paint(page)
    assert page.evaluate(DEPTH_AXIS)["ticks"]
    page.evaluate(
        """(({ camera, controls, axes }) => {
        camera.position.set(axes.low[0] + 0.1, camera.position.length(), axes.low[1] + 0.1);
        controls.target.set(axes.low[0], 0, axes.low[1]); controls.update(); })(manytouch.pane)"""
    )
    wait_for_paint(page)
    axis = page.evaluate(DEPTH_AXIS)
    page.close()
    assert (axis["ticks"], axis["numbers"], axis["names"]) == (0, [], [])


@pytest.mark.parametrize("size", [(1280, 800), pytest.param((390, 844), marks=pytest.mark.slow)])
def test_the_tools_for_pressing_do_not_cover_the_colour_bar(
    browser: Browser, shown: tuple[FakeSession, Viewer], size: tuple[int, int]
) -> None:
    session, viewer = shown
    session.now = replace(session.now, can_press=True)
    viewer.write(reading_of(1))
    page = opened_page(browser, viewer, size)
    page.evaluate("document.querySelector('[data-mode=press]').click()")
    wait(page, "!document.getElementById('press-tools').hidden && !document.getElementById('scale').hidden")
    tools, scale, pane = page.evaluate(
        "['press-tools', 'scale', 'scene'].map((id) => document.getElementById(id).getBoundingClientRect())"
        ".map(({ left, top, right, bottom }) => [left, top, right, bottom])"
    )
    assert tools[3] <= scale[1] or tools[0] >= scale[2], (tools, scale)
    assert pane[0] <= tools[0] < tools[2] <= pane[2], (tools, pane)
    page.close()


@pytest.mark.parametrize(
    "size",
    [
        pytest.param((640, 560), marks=pytest.mark.slow),
        (340, 560),
        pytest.param((390, 844), marks=pytest.mark.slow),
    ],
)
def test_head_and_tools_of_the_surface_are_whole_in_the_tile_of_a_rig(
    browser: Browser, shown: tuple[FakeSession, Viewer], size: tuple[int, int]
) -> None:
    page = opened_page(browser, shown[1], size)
    card, head, scene = (
        page.evaluate(
            "((e) => [e.getBoundingClientRect().top, e.getBoundingClientRect().bottom, e.scrollHeight])"
            f"(document.querySelector('{selector}'))"
        )
        for selector in (".card.surface", ".card.surface h2", "#scene")
    )
    assert head[2] <= head[1] - head[0] + 1
    assert scene[1] <= card[1] + 1
    page.close()


def test_the_view_fits_after_a_change_of_size_and_names_of_axes_are_whole(
    browser: Browser, shown: tuple[FakeSession, Viewer]
) -> None:
    page = opened_page(browser, shown[1])
    if page.evaluate("Boolean(manytouch.pane.isFlat)"):
        pytest.skip("the map has no view to fit")
    page.set_viewport_size({"width": 390, "height": 844})
    wait(page, "innerWidth === 390")
    wait_for_paint(page)
    corners = [page.evaluate(f"manytouch.pane.onScreen({x}, {y})") for x in (-60, 60) for y in (-40, 40)]
    stage = page.locator("#scene").bounding_box()
    assert stage is not None
    assert all(stage["x"] <= x <= stage["x"] + stage["width"] for x, _ in corners)
    names = page.evaluate(
        """[...document.querySelectorAll('.axis.name')].filter((e) => e.style.visibility !== 'hidden')
        .map((e) => e.getBoundingClientRect()).map(({ left, right }) => [left, right])"""
    )
    assert len(names) >= 2
    assert all(left >= stage["x"] and right <= stage["x"] + stage["width"] for left, right in names)
    page.close()


def test_a_pane_is_enlarged_and_reduced(browser: Browser, shown: tuple[FakeSession, Viewer]) -> None:
    page = opened_page(browser, shown[1])
    for pane in ("camera", "surface", "contacts", "time", "measure", "health"):
        page.click(f"[data-pane={pane}]")
        box = page.locator(f".card.{pane}").bounding_box()
        assert box is not None
        assert (box["width"], box["height"]) == pytest.approx((1342, 744), abs=2)
        page.keyboard.press("Escape")
        assert page.locator(".card.big").count() == 0
    page.close()


def test_tare_while_touched_asks_first_and_can_be_undone(
    browser: Browser, shown: tuple[FakeSession, Viewer]
) -> None:
    session, viewer = shown
    page = opened_page(browser, viewer)
    page.click("#tare")
    assert "1 contact touches" in page.inner_text("#tare-question")
    page.click("#tare-no")
    assert session.commands == []
    page.click("#tare")
    page.click("#tare-yes")
    wait_until(page, lambda: session.commands == [Tare()])
    assert not page.is_visible("#untare")
    session.now = replace(session.now, can_untare=True)
    page.wait_for_selector("#untare:not([hidden])")
    page.click("#untare")
    wait_until(page, lambda: session.commands[-1] == UndoTare())
    page.close()


def test_a_contact_is_followed_and_its_history_saved(
    browser: Browser, shown: tuple[FakeSession, Viewer]
) -> None:
    _, viewer = shown
    page = opened_page(browser, viewer)
    for index in range(1, 4):
        viewer.write(crowded(index, count=3))
        wait(page, f"manytouch.state.update.head.frame === {index}")
    page.click("#contacts tr[data-id='101']")
    wait_for_text(page, "#plotted", "#101")
    with page.expect_download() as saved:
        page.click("#download")
    assert saved.value.suggested_filename == "contact-101.csv"
    rows = list(csv.DictReader(io.StringIO(saved.value.path().read_text(encoding="utf-8"))))
    assert [row["contact"] for row in rows] == ["101"] * 3
    assert [float(row["depth_mm"]) for row in rows] == pytest.approx([2.0] * 3)
    assert [float(row["normal_force_N"]) for row in rows] == pytest.approx([1.5] * 3)
    assert rows[0]["shear_x_N"] == ""
    assert tuple(rows[0]) == contact_column_names("mm")
    assert [row["frame"] for row in rows] == ["1", "2", "3"]
    assert rows[0]["phase"] in ("start", "move")
    page.click("#unpin")
    assert page.inner_text("#plotted") == "last 20 s"
    page.close()


def test_a_frame_that_is_not_valid_is_not_called_untouched(
    browser: Browser, shown: tuple[FakeSession, Viewer]
) -> None:
    _, viewer = shown
    page = opened_page(browser, viewer)
    bad = reading_of(1)
    grid = replace(bad.grid, status=Status.FEW_MARKERS)
    surface = replace(bad.surface, displacement_mm=np.full_like(bad.surface.displacement_mm, np.nan))
    viewer.write(replace(bad, grid=grid, surface=surface, contacts=replace(bad.contacts, contacts=())))
    wait_for_text(page, ".contacts", "Not valid: few markers")
    assert "in contact" not in page.inner_text("#health")
    viewer.write(replace(reading_of(2), contacts=replace(bad.contacts, contacts=())))
    wait_for_text(page, ".contacts", "No contacts.")
    page.close()


def test_the_surface_is_hatched_where_no_marker_is_seen_and_marked_as_qualitative(browser: Browser) -> None:
    session = FakeSession()
    sheet = session.sensor.sheet
    assert sheet is not None
    session.sensor = replace(session.sensor, sheet=replace(sheet, is_assumed=True))
    viewer = Viewer(session)
    reading = reading_of(0)
    is_seen = reading.grid.is_seen.copy()
    is_seen[[310, 311, 312, 340, 341, 342]] = False
    viewer.write(replace(reading, grid=replace(reading.grid, is_seen=is_seen)))
    page = opened_page(browser, viewer)
    share = page.evaluate(
        "((all) => 1 - all.reduce((a, b) => a + b, 0) / all.length)(manytouch.state.update.parts.support)"
    )
    assert 0.0005 < share < 0.01
    page.wait_for_selector("#qualitative:not([hidden])")
    page.close()
    viewer.close()


def test_nothing_stays_clickable_after_the_end(browser: Browser) -> None:
    viewer = Viewer(FakeSession())
    viewer.write(reading_of(0))
    page = opened_page(browser, viewer)
    assert page.is_enabled("#run")
    viewer.close()
    wait(page, "manytouch.state.ended || !manytouch.state.connected")
    for control in ("#run", "#tare", "#record", "#layer", "[data-mode=press]"):
        assert page.is_disabled(control)
    assert "measure" not in page.inner_text("#hint")
    page.mouse.click(*page.evaluate("manytouch.pane.onScreen(-20, 8)"))
    page.keyboard.press("m")
    assert page.evaluate("manytouch.state.points") == []
    assert page.evaluate("manytouch.pointer.mode") == "view"
    page.close()
