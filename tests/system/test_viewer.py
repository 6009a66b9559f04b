"""The viewer in a browser: Chromium, controlled by Playwright, with WebGL in software."""

import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("nicegui")
pytest.importorskip("playwright")

from playwright.sync_api import Browser, Page

import manytouch
from browser import CHROMIUM, TIMEOUT_MS, wait, wait_for_text
from manytouch.session import Live, Playback, prepare, run
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.latest_only import LatestOnly
from manytouch.sinks.viewer import Viewer
from manytouch.sources.pressed.pressed_source import PressedSource
from manytouch.values import Comparison, Pause, Reading, Sensor
from manytouch.values.sensor_file.write import save_sensor
from part_of_sheet import part_of_sheet
from viewer_session import FakeSession, reading_of

AT_MM = (-20.0, 10.0)
SCENE = """schema = 1
name = "rest"
seconds = 5.0
fps = {fps}
sensor = "sensor.toml"
mechanics = "shell"
"""

pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="chromium is not installed (Debian: apt install chromium)"
)


class Latest:
    """Keeps the last reading of each frame for comparison."""

    def __init__(self) -> None:
        self.readings: dict[int, Reading] = {}

    def write(self, reading: Reading) -> None:
        self.readings[reading.frame.index] = reading
        self.readings.pop(reading.frame.index - 3000, None)

    def close(self) -> None:
        pass


class ServedSession:
    """A session with a viewer, in its own thread."""

    def __init__(self, controls: Any, recordings: Path = Path()) -> None:
        self.recordings = recordings
        self.controls, self.latest, self._over = controls, Latest(), threading.Event()
        self.viewer = Viewer(controls)
        self._thread = threading.Thread(
            target=lambda: run(controls, [self.latest, LatestOnly(self.viewer)], stop=self._over.is_set)
        )
        self._thread.start()

    def end(self) -> None:
        self._over.set()
        self._thread.join(60)
        assert not self._thread.is_alive()


def served(folder: Path, sensor: Sensor, fps: float) -> Iterator[ServedSession]:
    """The simulated sensor, at rest until it is pressed; small and slow, as the browser draws in software."""
    save_sensor(sensor, folder / "sensor.toml")
    (folder / "rest.toml").write_text(SCENE.format(fps=fps), encoding="utf-8")
    job = prepare(PressedSource(str(folder / "rest.toml")), method="perimeter")
    running = ServedSession(Live(job, recordings=folder), folder)
    yield running
    running.end()


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedSession]:
    """With a part of the sheet."""
    sensor = part_of_sheet(demo_sensor(640), (72.0, 48.0))
    yield from served(tmp_path_factory.mktemp("recordings"), sensor, fps=8.0)


@pytest.fixture(scope="module")
def whole_session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedSession]:
    """With the whole sheet."""
    yield from served(tmp_path_factory.mktemp("recordings"), demo_sensor(640), fps=15.0)


@pytest.fixture
def opened(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Opens pages with few pixels, drawn in software; fails on every error and request to another server."""
    problems: list[str] = []
    pages: list[Page] = []

    def open_page(url: str, *, minimum_updates: int = 2, **more: Any) -> Page:
        screen = {"viewport": {"width": 1120, "height": 720}, "device_scale_factor": 0.5}
        page = browser.new_page(**(screen | more))
        page.set_default_timeout(TIMEOUT_MS)
        page.on("console", lambda line: problems.append(line.text) if line.type == "error" else None)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("requestfailed", lambda request: problems.append(f"failed: {request.url}"))
        page.on("request", lambda request: problems.extend(foreign(request.url, url)))
        page.goto(url)
        wait(page, f"manytouch.state.count >= {minimum_updates} && manytouch.state.sceneInfo")
        pages.append(page)
        return page

    yield open_page
    for page in pages:
        page.close()
    assert problems == []


def foreign(request: str, url: str) -> list[str]:
    return [] if request.startswith((url, f"blob:{url}", "data:")) else [request]


def press(page: Page, at_mm: tuple[float, float], depth_mm: float = 2.5) -> None:
    """Press with the mouse, and keep the finger on the sheet."""
    page.click("[data-mode=press]")
    page.fill("#press-depth", str(depth_mm))
    page.check("#press-stay")
    x, y = page.evaluate("(at) => manytouch.pane.onScreen(...at)", list(at_mm))
    page.mouse.click(x, y)
    deepest = "Math.max(...manytouch.state.update.parts.depth)"
    wait(page, f"manytouch.state.update.head.contacts.length > 0 && {deepest} > {0.4 * depth_mm}")


def lift(page: Page) -> None:
    page.click("[data-mode=press]")
    page.click("#lift-all")
    page.click("[data-mode=view]")
    wait(page, "manytouch.state.update.head.contacts.length === 0")


def choose(page: Page, at_mm: tuple[float, float]) -> None:
    """Click a point of the surface."""
    page.click("[data-mode=view]")
    x, y = page.evaluate("(at) => manytouch.pane.onScreen(...at)", list(at_mm))
    page.mouse.click(x, y)


def test_the_mouse_presses_and_a_click_measures_the_surface_that_is_drawn(
    session: ServedSession, opened: Callable[..., Page]
) -> None:
    page = opened(session.viewer.url)
    press(page, AT_MM)
    (truth, *_) = page.evaluate("manytouch.state.update.head.comparison.contacts")
    assert math.dist((truth["x_mm"], truth["y_mm"]), AT_MM) < 1.5
    deepest = page.evaluate("Math.max(...manytouch.state.update.parts.depth)")
    assert deepest > 1.0
    choose(page, AT_MM)
    wait(page, "manytouch.state.measured?.points.length === 1")
    compare_with_estimate(page, session)
    wait_for_text(page, "#measure", "depth", "±")
    choose(page, (25.0, -5.0))
    wait(page, "manytouch.state.measured?.points.length === 2")
    measured = compare_with_estimate(page, session)
    chosen = np.array(page.evaluate("manytouch.state.points"))
    assert measured["rest_distance_mm"] == pytest.approx(np.linalg.norm(chosen[1] - chosen[0]), abs=1e-3)
    assert len([depth for depth in measured["profile"]["depth_mm"] if depth is not None]) > 100
    wait_for_text(page, "#measure", "distance now")
    assert page.is_visible("#profile")
    page.keyboard.press("Escape")
    assert page.evaluate("manytouch.state.points") == []
    lift(page)


def compare_with_estimate(page: Page, session: ServedSession) -> dict[str, Any]:
    """The page shows the depth that `manytouch.sample` gives for the same frame and points."""
    measured: dict[str, Any] = page.evaluate("manytouch.state.measured")
    point_mm = np.array(page.evaluate("manytouch.state.points"), dtype=np.float64)
    reading = session.latest.readings[measured["frame"]]
    expected = manytouch.sample(reading.surface, *point_mm.T)
    shown = [point["depth_mm"] for point in measured["points"]]
    np.testing.assert_allclose(shown, expected.depth_mm, atol=1e-6)
    assert all(point["std_mm"] > 0 for point in measured["points"])
    return measured


@pytest.mark.slow
def test_pause_tare_method_and_units(whole_session: ServedSession, opened: Callable[..., Page]) -> None:
    page = opened(whole_session.viewer.url)
    page.click("#run")
    wait(page, "!manytouch.state.health.is_running")
    page.wait_for_timeout(300)
    before = page.evaluate("manytouch.state.update.head.frame")
    page.wait_for_timeout(400)
    assert page.evaluate("manytouch.state.update.head.frame") == before
    assert "paused" in page.inner_text("#state")
    page.click("#run")
    wait(page, f"manytouch.state.update.head.frame > {before}")
    press(page, (10.0, 5.0))
    page.click("[data-mode=view]")
    page.click("#tare")
    page.click("#tare-yes")
    wait(page, "manytouch.state.health.notes.some((note) => note.startsWith('tared'))")
    wait(page, "manytouch.state.health.notes.some((note) => note.includes('touched the sheet when it was'))")
    wait(page, "Math.max(...manytouch.state.update.parts.depth) < 0.3")
    lift_after_tare(page)
    page.click("#settings-open")
    page.select_option("#method", "paper")
    wait(page, "manytouch.state.health.method === 'paper'")
    change_parameters(page)
    page.select_option("#method", "perimeter")
    wait(page, "manytouch.state.health.method === 'perimeter'")
    page.select_option("#length-unit", "µm")
    assert "µm" in page.inner_text("#press-depth-label")
    wait_for_text(page, "#health", "µm")
    page.click("#settings .close")


def change_parameters(page: Page) -> None:
    """Parameters of the paper's method and of its surface, also where they are automatic or a choice."""
    page.click("#advanced summary")
    page.fill("[name='interpolation.iterations']", "30")
    page.press("[name='interpolation.iterations']", "Tab")
    wait(page, "manytouch.state.health.parameters['interpolation.iterations'] === 30")
    assert page.get_attribute("[name='detect.threshold']", "placeholder") == "automatic"
    assert page.input_value("[name='detect.threshold']") == ""
    page.fill("[name='detect.threshold']", "120")
    page.press("[name='detect.threshold']", "Tab")
    wait(page, "manytouch.state.health.parameters['detect.threshold'] === 120")
    assert page.locator("#essential .parameter").count() == 12
    assert "Grey level" in page.inner_text("#essential")
    page.click("[data-parameter='detect.threshold']")
    wait(page, "manytouch.state.health.parameters['detect.threshold'] === null")
    page.select_option("[name='estimate.formula']", "printed")
    wait(page, "manytouch.state.health.parameters['estimate.formula'] === 'printed'")
    page.select_option("[name='interpolation.kind']", "spline")
    wait(page, "manytouch.state.health.parameters['interpolation.kind'] === 'spline'")


def lift_after_tare(page: Page) -> None:
    """The sheet returns to above its new rest position; tare again."""
    page.click("[data-mode=press]")
    page.click("#lift-all")
    page.click("[data-mode=view]")
    wait(page, "Math.min(...manytouch.state.update.parts.depth) < -0.5")
    wait(page, "manytouch.state.update.head.contacts.length === 0")
    page.click("#tare")
    wait(page, "manytouch.state.health.notes.filter((n) => n.startsWith('tared')).length > 1")
    wait(page, "manytouch.state.update.head.contacts.length === 0")


@pytest.mark.slow
def test_record_and_replay_with_a_timeline(
    whole_session: ServedSession, opened: Callable[..., Page], tmp_path: Path
) -> None:
    page = opened(whole_session.viewer.url)
    page.click("#record")
    wait(page, "manytouch.state.health.recording")
    name = page.evaluate("manytouch.state.health.recording")
    press(page, AT_MM)
    begun = page.evaluate("manytouch.state.update.head.frame")
    wait(page, f"manytouch.state.update.head.frame > {begun + 25}")
    lift(page)
    page.click("#record")
    wait(page, "!manytouch.state.health.recording")
    playback = Playback(whole_session.recordings / name, stays=True)
    playback.send(Pause())  # before it has reached its end
    replay = ServedSession(playback)
    again = opened(replay.viewer.url, minimum_updates=1)
    try:
        assert again.is_visible("#timeline")
        total = again.evaluate("manytouch.state.health.frame_count")
        assert total > 20
        wait(again, "!manytouch.state.health.is_running")
        for share in (0.8, 0.2, 0.5):
            frame = round(share * total)
            again.evaluate(
                "(frame) => { const bar = document.getElementById('seek'); bar.value = frame;"
                "bar.dispatchEvent(new Event('change')); }",
                frame,
            )
            wait(again, f"Math.abs(manytouch.state.health.frame - {frame}) <= 1")
        wait_for_text(again, "#seek-label", "frame", "of")
        assert again.evaluate("manytouch.state.update.head.comparison") is None
        again.keyboard.press("s")
        again.select_option("#method", "paper")
        again.keyboard.press("Escape")
        wait(again, "manytouch.state.update.head.comparison?.name === 'recorded'")
        wait_for_text(again, "#comparison-name", "recorded")
        wait(again, "manytouch.state.health.method === 'paper'")
        assert "difference" in again.evaluate("manytouch.state.update.head.layers")
    finally:
        again.close()
        replay.end()


def test_a_second_client_comes_and_goes(
    session: ServedSession, opened: Callable[..., Page], browser: Browser
) -> None:
    first = opened(session.viewer.url)
    context = browser.new_context()
    second = context.new_page()
    second.goto(session.viewer.url)
    wait(second, "manytouch.state.count > 1")
    wait(first, "manytouch.state.health.clients === 2")
    context.close()
    wait(first, "manytouch.state.health.clients === 1")
    before = first.evaluate("manytouch.state.count")
    wait(first, f"manytouch.state.count > {before + 3}")


@pytest.mark.parametrize(
    ("theme", "sizes"),
    [
        ("light", ((1366, 768), (1024, 1366), (390, 844))),
        pytest.param("dark", ((1600, 950),), marks=pytest.mark.slow),
    ],
)
def test_layout_and_theme_suit_the_screen(
    session: ServedSession,
    opened: Callable[..., Page],
    tmp_path: Path,
    theme: str,
    sizes: tuple[tuple[int, int], ...],
) -> None:
    page = opened(session.viewer.url, color_scheme=theme, device_scale_factor=1)
    for width, height in sizes:
        page.set_viewport_size({"width": width, "height": height})
        painted = page.evaluate("manytouch.state.paints")
        wait(page, f"manytouch.state.paints > {painted + 1}")
        image_path = tmp_path / f"{theme}-{width}.png"
        page.screenshot(path=image_path, caret="initial")
        image = cv2.imread(str(image_path))
        assert image.shape[:2] == (height, width)
        assert (float(np.median(image)) < 90) is (theme == "dark")
        box = page.locator("#scene").bounding_box()
        assert box is not None
        assert box["width"] > 0.4 * width
        x, y, box_width, box_height = (int(box[name]) for name in ("x", "y", "width", "height"))
        scene = image[y : y + box_height, x : x + box_width]
        assert len(np.unique(scene @ np.array([1, 256, 65536]))) > 100  # colours
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")


def test_recorded_names_are_shown_as_text(opened: Callable[..., Page]) -> None:
    hostile = "<img src=x onerror='window.injected = true'>"
    session = FakeSession()
    session.sensor = replace(session.sensor, name=hostile)
    session.now = replace(
        session.now, method=hostile, methods=(hostile,), notes=(hostile,), source_state=hostile
    )
    reading = reading_of(1)
    session.other = Comparison(name=hostile, surface=None, contacts=reading.contacts)
    viewer = Viewer(session)
    try:
        viewer.write(reading)
        page = opened(viewer.url, minimum_updates=1)
        for selector in ("#sensor", "#health", "#notes", "#contacts", "#comparison-name", "#state-label"):
            wait(page, f"document.querySelector('{selector}').textContent.includes('<img src=x')")
        page.evaluate(
            "(id) => { manytouch.state.update.head.contacts[0].id = id; manytouch.state.isDirty = true; }",
            hostile,
        )
        wait_for_text(page, "#contacts b", "<img src=x")
        wait_for_text(page, ".labels", "#<img src=x")
        assert page.locator("main img, header #sensor img").count() == 0
        assert page.evaluate("window.injected") is None
    finally:
        viewer.close()


def retained_heap(page: Page) -> float:
    """Bytes of the page's heap after garbage collection: the least of several, without updates in flight."""
    samples = []
    for _ in range(4):
        samples.append(page.evaluate("gc(), performance.memory.usedJSHeapSize"))
        page.wait_for_timeout(350)
    return float(min(samples))


def growth_of_heap(page: Page, seconds: float) -> float:
    """Bytes per second that the heap of the page grows after garbage collection, once it is warm."""
    page.wait_for_timeout(1000)
    before = retained_heap(page)
    page.wait_for_timeout(1000 * seconds)
    return (retained_heap(page) - before) / seconds


@pytest.mark.parametrize(
    "seconds", [pytest.param(seconds, marks=pytest.mark.slow) for seconds in (4.0, 120.0)]
)
def test_memory_stays_flat(session: ServedSession, opened: Callable[..., Page], seconds: float) -> None:
    page = opened(session.viewer.url)
    press(page, AT_MM)
    assert growth_of_heap(page, seconds) < 2_000_000 / max(seconds, 15.0)
    lift(page)
