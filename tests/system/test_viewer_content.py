"""What the page draws and how its controls act, with given readings, on one page with WebGL."""

import csv
import io
from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("nicegui")
pytest.importorskip("playwright")

from playwright.sync_api import Browser, Page

from browser import CHROMIUM, wait, wait_for_paint, wait_for_text, wait_until
from manytouch.session.methods import choices_of, parameter_info, parameters_of, pipeline_for
from manytouch.sinks.viewer import Viewer
from manytouch.values import ESTIMATES, Comparison, OutlineRing, Press, Reading, Release, Tune
from viewer_session import HEALTH, FakeSession, reading_of

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

DRAWN = """
window.drawn = {}; window.strokes = {};
const pen = CanvasRenderingContext2D.prototype, { clearRect, fillText, fillRect, stroke } = pen;
pen.clearRect = function (...box) {
  drawn[this.canvas.id] = []; strokes[this.canvas.id] = [];
  return clearRect.apply(this, box);
};
pen.fillText = function (text, x, y) {
  const wide = this.measureText(text).width, share = { left: 0, center: 0.5, right: 1 }[this.textAlign] ?? 0;
  drawn[this.canvas.id]?.push([String(text), x - share * wide, y, wide]);
  return fillText.call(this, text, x, y);
};
pen.fillRect = function (...box) {
  strokes[this.canvas.id]?.push(this.fillStyle);
  return fillRect.apply(this, box);
};
pen.stroke = function (...path) {
  strokes[this.canvas.id]?.push(this.strokeStyle);
  return stroke.apply(this, path);
};
"""
COLOURS_3D = """(() => { const found = new Set();
  const add = ({ color }) => color && found.add(`#${color.getHexString()}`);
  manytouch.pane.sheet.traverse(({ material }) => material && add(material));
  return [...found]; })()"""
VERMILION = "#d55e00"  # of contact 100: the third of seven colours
INDEX = count(1)


@pytest.fixture(scope="module")
def session() -> FakeSession:
    return FakeSession()


@pytest.fixture(scope="module")
def viewer(session: FakeSession) -> Iterator[Viewer]:
    viewer = Viewer(session)
    viewer.write(reading_of(0))
    yield viewer
    viewer.close()


@pytest.fixture(scope="module")
def page(browser: Browser, viewer: Viewer) -> Page:
    return opened_page(browser, viewer)


@pytest.fixture(autouse=True)
def as_at_the_beginning(session: FakeSession) -> None:
    session.now, session.other = HEALTH, None
    session.commands.clear()


def opened_page(browser: Browser, viewer: Viewer) -> Page:
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    page.add_init_script(DRAWN)
    page.goto(viewer.url)
    wait(page, "manytouch.state.count >= 1 && manytouch.state.sceneInfo && manytouch.state.paints > 0")
    return page


def pressed(contacts: int = 1, **known: Any) -> Reading:
    """A new reading with contacts 100, 101, ... in a row, of which more is known."""
    reading = reading_of(next(INDEX))
    (one,) = reading.contacts.contacts
    found = tuple(
        replace(
            one,
            id=100 + k,
            centre_mm=np.array([-40.0 + 15.0 * k, 8.0]),
            centre_px=np.array([60.0 + 40.0 * k, 90.0]),
            **known,
        )
        for k in range(contacts)
    )
    return replace(reading, contacts=replace(reading.contacts, contacts=found))


def show(page: Page, viewer: Viewer, reading: Reading) -> None:
    """Write a reading and wait until it is drawn."""
    viewer.write(reading)
    wait(page, f"manytouch.state.update.head.frame === {reading.frame.index}")
    painted = page.evaluate("manytouch.state.paints")
    wait(page, f"manytouch.state.paints > {painted} || !manytouch.state.isDirty")


def test_three_digits_of_a_number_fit_at_the_end_of_a_curve(page: Page, viewer: Viewer) -> None:
    for _ in range(3):
        show(page, viewer, pressed(5))
    for plot in ("depth-plot", "force-plot"):
        width = page.evaluate(f"document.getElementById('{plot}').clientWidth")
        names = [text for text in page.evaluate(f"drawn['{plot}']") if text[0].startswith("#")]
        assert [name for name, *_ in names] == [f"#{100 + k}" for k in range(5)]
        assert all(x + wide <= width for _, x, _, wide in names)
        heights = sorted(y for _, _, y, _ in names)
        assert min(np.diff(heights)) >= 11


def test_curves_of_contacts_that_are_over_keep_their_numbers(page: Page, viewer: Viewer) -> None:
    for _ in range(3):
        show(page, viewer, pressed(4))
    reading = pressed()
    show(page, viewer, replace(reading, contacts=replace(reading.contacts, contacts=())))
    for plot in ("depth-plot", "force-plot"):
        width = page.evaluate(f"document.getElementById('{plot}').clientWidth")
        names = [text for text in page.evaluate(f"drawn['{plot}']") if text[0].startswith("#")]
        assert {name for name, *_ in names} >= {f"#{100 + k}" for k in range(4)}
        assert all(x >= 46 and x + wide <= width for _, x, _, wide in names)
        for k, (_, x, y, wide) in enumerate(names):
            for _, other_x, other_y, other_wide in names[k + 1 :]:
                assert x + wide <= other_x or other_x + other_wide <= x or abs(y - other_y) >= 13


def test_marker_numbers_are_legible_and_that_of_the_pointed_marker_is_shown(
    page: Page, viewer: Viewer
) -> None:
    reading = pressed()
    rest_px = page.evaluate("manytouch.state.sceneInfo.rest_px")
    grid = replace(reading.grid, position_px=np.array(rest_px, dtype=np.float64))
    page.check("#show-ids")
    show(page, viewer, replace(reading, grid=grid))
    texts = [text for text in page.evaluate("drawn.camera") if text[0].isdigit()]
    assert 20 < len(texts) < len(rest_px)
    for k, (_, x, y, wide) in enumerate(texts):
        for _, other_x, other_y, other_wide in texts[k + 1 :]:
            assert x + wide <= other_x or other_x + other_wide <= x or abs(y - other_y) >= 11
    page.uncheck("#show-ids")
    box = page.locator("#camera").bounding_box()
    assert box is not None
    scale = box["width"] / 320
    page.mouse.move(box["x"] + scale * (rest_px[211][0] + 0.5), box["y"] + scale * (rest_px[211][1] + 0.5))
    wait(page, "drawn.camera.some(([text]) => text === 'marker 211')")


@pytest.mark.parametrize("picture", [16 / 9, 1.0])
def test_the_camera_picture_stays_whole_while_a_profile_is_shown(
    page: Page, viewer: Viewer, picture: float
) -> None:
    show(page, viewer, pressed(5))
    page.evaluate(f"document.documentElement.style.setProperty('--picture', {picture})")
    page.evaluate(f"document.body.classList.toggle('tall-picture', {picture} < 1.5)")
    for place in ((-20, 8), (20, 8)):
        page.mouse.click(*page.evaluate(f"manytouch.pane.onScreen{place}"))
    page.wait_for_selector("#profile")
    for selector in (".camera .stage", "#camera"):
        both = f"['{selector}', '.card.camera']"
        boxes = f"{both}.map((each) => document.querySelector(each).getBoundingClientRect())"
        wait(page, f"(([box, card]) => box.bottom <= card.bottom && box.height > 130)({boxes})")
    page.keyboard.press("Escape")
    page.evaluate("document.documentElement.style.setProperty('--picture', 16 / 9)")
    page.evaluate("document.body.classList.remove('tall-picture')")


def test_a_value_has_the_same_colour_on_every_slope(page: Page, viewer: Viewer) -> None:
    reading = reading_of(next(INDEX), 3.0, at_mm=(0.0, 0.0))
    show(page, viewer, replace(reading, contacts=replace(reading.contacts, contacts=())))
    page.evaluate("document.getElementById('stretch').value = 12")
    page.dispatch_event("#stretch", "input")
    painted = page.evaluate("manytouch.state.paints")
    wait(page, f"manytouch.state.paints > {painted} || !manytouch.state.isDirty")
    page.mouse.move(5, 5)
    image = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    ramp = page.evaluate("[...manytouch.pane.material.uniforms.map.value.image.data]")
    low, high = (page.evaluate(f"manytouch.pane.material.uniforms.{name}.value") for name in ("low", "high"))
    ramp = np.array(ramp).reshape(256, 4)[:, :3]
    errors = []
    for x_mm, y_mm in (
        (-8.3, 3.1),
        (8.3, 3.1),
        (3.2, 8.4),
        (-6.2, -6.4),
        (6.2, 5.7),
        (-11.4, 6.3),
        (11.4, 6.3),
    ):
        depth_mm = page.evaluate(f"manytouch.pane.depthAt({x_mm}, {y_mm})")
        x, y = page.evaluate(f"manytouch.pane.onScreen({x_mm}, {y_mm})")
        expected = ramp[round(255 * np.clip((depth_mm - low) / (high - low), 0, 1))]
        patch = image[round(y) - 2 : round(y) + 3, round(x) - 2 : round(x) + 3].reshape(-1, 3)
        errors.append(np.abs(patch - expected).max(axis=1).min())
    assert sorted(errors)[-3] < 6, errors  # lines of the grid and of equal depth may cross two of the places
    page.evaluate("document.getElementById('stretch').value = 5")
    page.dispatch_event("#stretch", "input")


def test_one_contact_has_one_colour_in_every_pane(page: Page, viewer: Viewer) -> None:
    show(page, viewer, pressed(force_N=np.array([0.4, 0.3, -1.5])))
    assert VERMILION in page.evaluate(COLOURS_3D)
    assert VERMILION in page.evaluate("strokes.camera")
    assert VERMILION in page.evaluate("strokes['depth-plot']")
    tag = "getComputedStyle(document.querySelector('#scene .tag')).borderTopColor"
    dot = "getComputedStyle(document.querySelector('#contacts tr.own i')).backgroundColor"
    assert page.evaluate(tag) == page.evaluate(dot) == "rgb(213, 94, 0)"


def test_shear_torque_slip_and_the_load_on_the_sheet_are_shown(page: Page, viewer: Viewer) -> None:
    force_N = np.array([0.4, 0.3, -1.5])
    show(page, viewer, pressed(2, force_N=force_N, torque_Nmm=6.0, slip=True))
    wait_for_text(page, "#contacts tbody", "shear 0.50 N at 37°", "torque 6.0 N·mm", "slips")
    wait_for_text(page, "#total", "total 3.00 ± 0.07 N", "shear 1.00 N")
    assert "#100 slips" in [text for text, *_ in page.evaluate("drawn.camera")]
    show(page, viewer, pressed(1))
    wait_for_text(page, "#total", "total 1.50 ± 0.05 N")
    assert "shear" not in page.inner_text("section.contacts")
    assert page.locator("#total .weak").count() == 0
    show(page, viewer, pressed(1, force_N=np.array([np.nan, np.nan, -0.09])))
    wait_for_text(page, "#total .weak", "0.09 ± 0.05 N")


def test_a_small_deviation_is_not_shown_as_zero(page: Page, viewer: Viewer) -> None:
    covariance = np.full((len(ESTIMATES), len(ESTIMATES)), np.nan)
    covariance[ESTIMATES.index("normal_force"), ESTIMATES.index("normal_force")] = 0.003**2
    show(page, viewer, pressed(1, force_N=np.array([0.0, 0.0, -0.0123]), covariance=covariance))
    wait_for_text(page, "#total", "0.012 ± 0.003 N")
    wait_for_text(page, "#contacts tbody", "0.012 ± 0.003")


def test_most_of_five_contacts_are_seen_without_scrolling(
    page: Page, viewer: Viewer, session: FakeSession
) -> None:
    reading = pressed(5, force_N=np.array([0.4, 0.3, -1.5]), torque_Nmm=6.0)
    session.other = Comparison(name="truth", surface=reading.surface, contacts=reading.contacts)
    show(page, viewer, reading)
    wait_for_text(page, "#contacts tbody", "#104", "truth")
    seen = page.evaluate(
        """((box) => [...document.querySelectorAll('#contacts tr.own')]
        .filter((row) => row.getBoundingClientRect().bottom <= box.bottom).length)
        (document.querySelector('.contacts .scroll').getBoundingClientRect())"""
    )
    assert seen >= 4
    for pane in ("contacts", "measure", "health"):
        box = page.locator(f"section.{pane}").bounding_box()
        assert box is not None
        assert box["height"] >= 80
        assert box["y"] + box["height"] <= 768


def test_labels_of_contacts_at_one_place_do_not_cover_each_other(page: Page, viewer: Viewer) -> None:
    reading = pressed(12, slip=True)
    at_mm, at_px = np.array([-40.0, -20.0]), np.array([250.0, 90.0])
    contacts = tuple(replace(one, centre_mm=at_mm, centre_px=at_px) for one in reading.contacts.contacts)
    show(page, viewer, replace(reading, contacts=replace(reading.contacts, contacts=contacts)))
    wait(page, "document.querySelectorAll('#scene .tag').length === 12")
    wait_for_paint(page)
    tags = page.evaluate(
        """[...document.querySelectorAll('#scene .tag, #scene .scale')].map((e) => e.getBoundingClientRect())
        .map(({ left, top, width, height }) => [left, top, width, height])"""
    )
    names = [[x, y, wide, 12] for text, x, y, wide in page.evaluate("drawn.camera") if "slips" in text]
    assert (len(tags), len(names)) == (13, 12)
    for boxes in (tags, names):
        for k, (x, y, wide, high) in enumerate(boxes):
            for other_x, other_y, other_wide, other_high in boxes[k + 1 :]:
                is_apart = x + wide <= other_x + 1 or other_x + other_wide <= x + 1
                assert is_apart or y + high <= other_y + 1 or other_y + other_high <= y + 1


def test_long_numbers_and_a_scroll_bar_leave_the_force_column_whole(page: Page, viewer: Viewer) -> None:
    covariance = np.diag([4.0, 4.0, 0.05, 4.0, 4.0, 130.0, 99.0, 9.0])
    force_N = np.array([-3.0, -2.0, -19.22])
    show(page, viewer, pressed(9, force_N=force_N, covariance=covariance, torque_Nmm=-112.3, slip=True))
    wait_for_text(page, "#contacts tbody", "#108", "19.22 ± 11.40")
    needed, room = page.evaluate(
        """((table, box) => { table.style.width = '0'; const needed = table.getBoundingClientRect().width;
        table.style.width = ''; return [needed, box.clientWidth]; })
        (document.getElementById('contacts'), document.querySelector('.scroll'))"""
    )
    assert needed <= room - 8  # the width of a thin scroll bar, which a headless browser does not show


def test_the_profile_between_two_points_is_whole_and_every_pane_stays(page: Page, viewer: Viewer) -> None:
    show(page, viewer, pressed(5, force_N=np.array([0.4, 0.3, -1.5]), torque_Nmm=-12.0, slip=True))
    for at_mm in ((-50, -20), (45, 25)):
        page.mouse.click(*page.evaluate(f"manytouch.pane.onScreen({at_mm[0]}, {at_mm[1]})"))
    wait(page, "manytouch.state.measured?.points.length === 2")
    wait_for_text(page, "#measure", "distance now")
    for pane, least_px in (("#profile", 100), (".contacts", 180), (".measure", 250), (".health", 80)):
        box = page.locator(pane).bounding_box()
        assert box is not None
        assert box["height"] >= least_px, pane
        assert box["y"] + box["height"] <= 768, pane
    profile, card = page.locator("#profile").bounding_box(), page.locator(".measure").bounding_box()
    assert profile is not None
    assert card is not None
    assert profile["y"] + profile["height"] <= card["y"] + card["height"]
    assert page.evaluate("((box) => box.scrollWidth <= box.clientWidth)(document.querySelector('.scroll'))")
    page.keyboard.press("Escape")


def test_an_outline_that_reaches_beyond_the_sheet_is_drawn_on_it(page: Page, viewer: Viewer) -> None:
    corners_mm = 200.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    show(page, viewer, pressed(outline=(OutlineRing(point_mm=corners_mm),), half_major_mm=300.0))
    reach = page.evaluate(
        """(() => { let most = 0;
        manytouch.pane.sheet.traverse(({ isLine, visible, geometry }) => {
          if (!isLine || !visible) return;
          const { array } = geometry.attributes.position;
          for (let i = 0; i < array.length; i += 3) most = Math.max(most, Math.abs(array[i]));
        });
        return most; })()"""
    )
    assert 50 < reach < 75


def pressed_depths_mm(session: FakeSession) -> list[float]:
    return [round(command.depth_mm, 6) for command in session.commands if isinstance(command, Press)]


def test_the_wheel_changes_the_depth_of_fingers_and_zooms_with_control(
    page: Page, viewer: Viewer, session: FakeSession
) -> None:
    session.now = replace(HEALTH, can_press=True)
    page.wait_for_selector("[data-mode=press]:not([hidden])")
    page.evaluate("document.getElementById('tour').hidden = true")
    page.click("[data-mode=press]")
    assert "wheel changes the depth" in page.inner_text("#hint")
    page.fill("#press-depth", "2.5")
    distance = "manytouch.pane.camera.position.length()"
    before = page.evaluate(distance)
    page.mouse.move(*page.evaluate("manytouch.pane.onScreen(20, 5)"))
    page.mouse.down()
    page.mouse.wheel(0, -100)
    wait(page, "document.getElementById('press-depth-label').textContent === '2.70 mm'")
    page.mouse.wheel(0, 100)
    page.mouse.wheel(0, 100)
    wait(page, "document.getElementById('press-depth-label').textContent === '2.30 mm'")
    # of the commands of a finger that wait together only the newest is carried out
    wait_until(page, lambda: pressed_depths_mm(session)[-1:] == [2.3])
    page.mouse.up()
    wait_until(page, lambda: isinstance(session.commands[-1], Release))
    assert page.evaluate(distance) == pytest.approx(before)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -300)
    wait(page, f"{distance} < {0.98 * before}")
    page.keyboard.up("Control")
    page.click("#home")
    page.click("[data-mode=view]")


def test_buttons_name_what_they_do_next(page: Page, viewer: Viewer, session: FakeSession) -> None:
    assert page.inner_text("#run") == "Pause"
    assert page.inner_text("#record") == "Record"
    session.now = replace(HEALTH, is_running=False, recording="a.mcap")
    wait_for_text(page, "#run", "Resume")
    assert page.inner_text("#record") == "Stop recording"
    assert "paused" in page.inner_text("#state")
    session.now = replace(HEALTH, frame=30, frame_count=100)
    wait_for_text(page, "#play", "Pause")
    assert not page.is_visible("#record")
    assert not page.is_visible("#tare")
    session.now = replace(HEALTH, is_running=False, frame=99, frame_count=100)
    wait_for_text(page, "#state", "at the end")
    assert page.inner_text("#play") == "Play"
    assert not page.is_visible("#run")
    page.click("#side")
    assert page.inner_text("#side") == "show camera side"
    page.click("#side")
    assert page.inner_text("#side") == "show finger side"


def test_settings_show_a_few_parameters_with_help_unit_and_reset(
    page: Page, viewer: Viewer, session: FakeSession
) -> None:
    pipeline = pipeline_for("mechanics")
    now = replace(
        HEALTH,
        method="mechanics",
        methods=("mechanics", "paper"),
        parameters=parameters_of(pipeline),
        choices=choices_of(pipeline),
        parameter_info=parameter_info("mechanics"),
    )
    session.now = now
    page.click("#settings-open")
    wait(page, "document.querySelectorAll('#essential .help').length > 4")
    assert page.locator("#essential .parameter").count() <= 7
    assert all(page.locator("#essential .help").all_inner_texts())
    assert not page.is_visible("#others")
    assert page.locator(".reset:visible").count() == 0
    name = "estimate.contact_rules.start_stds"
    assert "standard deviations" in page.inner_text(f".parameter:has([name='{name}'])")
    page.fill(f"[name='{name}']", "5")
    page.press(f"[name='{name}']", "Tab")
    session.now = replace(now, parameters={**now.parameters, name: 5.0})
    page.wait_for_selector(f"[data-parameter='{name}']:visible")
    page.click(f"[data-parameter='{name}']")
    page.click("#advanced summary")
    assert page.locator("#others .parameter:visible").count() > 20
    page.click("#settings .close")
    assert session.commands == [Tune(parameter=name, value=5.0), Tune(parameter=name, value=4.0)]


@pytest.mark.parametrize("has_modulus", [True, False])
def test_before_the_first_contact_a_plot_of_forces_is_there_if_the_modulus_is_known(
    browser: Browser, has_modulus: bool
) -> None:
    session = FakeSession()
    sheet = session.sensor.sheet
    assert sheet is not None
    if not has_modulus:
        session.sensor = replace(session.sensor, sheet=replace(sheet, young_MPa=None))
    viewer = Viewer(session)
    reading = pressed()
    viewer.write(replace(reading, contacts=replace(reading.contacts, contacts=())))
    page = opened_page(browser, viewer)
    wait(page, "drawn['depth-plot']?.some(([text]) => text === 'no contact yet')")
    assert page.is_visible("#force-plot") == has_modulus
    plot_px, pane_px = page.evaluate(
        "['#depth-plot', '.plots'].map((name) => document.querySelector(name).clientHeight)"
    )
    assert (plot_px > 0.9 * pane_px) != has_modulus, "one plot takes the whole pane"
    for force_N in (np.nan, 1.5):  # contacts decide, once there are some
        show(page, viewer, pressed(1, force_N=np.array([np.nan, np.nan, -force_N])))
        wait(page, f"document.getElementById('force-plot').hidden === {str(np.isnan(force_N)).lower()}")
    page.close()
    viewer.close()


def test_a_page_that_is_opened_later_shows_the_last_seconds(browser: Browser) -> None:
    viewer = Viewer(FakeSession())
    for index in range(40):
        viewer.write(reading_of(index))
    page = opened_page(browser, viewer)
    wait(page, "drawn['force-plot']?.some(([text]) => text === '#7')")
    assert "no contact yet" not in [text for text, *_ in page.evaluate("drawn['depth-plot']")]
    page.mouse.click(*page.evaluate("manytouch.pane.onScreen(-20, 8)"))  # the last reading is sent again
    wait(page, "manytouch.state.measured !== null")
    viewer.write(reading_of(40))
    wait(page, "manytouch.state.update.head.frame === 40")
    with page.expect_download() as saved:
        page.click("#download")
    rows = list(csv.DictReader(io.StringIO(saved.value.path().read_text(encoding="utf-8"))))
    assert [float(row["time_s"]) for row in rows] == pytest.approx(np.arange(41) / 30, abs=1e-3)
    assert {row["normal_force_N"] for row in rows} == {"1.5"}
    page.close()
    viewer.close()
