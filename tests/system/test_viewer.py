"""The viewer in a real browser: Debian's chromium, driven by Playwright, with WebGL in software."""

import math
import shutil
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("nicegui")
pytest.importorskip("playwright")

from playwright.sync_api import Browser, Page, sync_playwright

from manytouch.geometry.sampling import sampling_at
from manytouch.session import Live, Playback, prepare
from manytouch.sinks.latest_only import LatestOnly
from manytouch.sinks.viewer import Viewer
from manytouch.sources.pressed import PressedSource
from manytouch.values import Reading

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    "--js-flags=--expose-gc",
]
PATIENCE_MS = 60_000
AT_MM = (-20.0, 10.0)

pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="there is no chromium (Debian: apt install chromium)"
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


class Session:
    """A session with a viewer in a thread of its own."""

    def __init__(self, controls: Any, recordings: Path = Path()) -> None:
        self.recordings = recordings
        self.controls, self.latest, self._over = controls, Latest(), threading.Event()
        self.viewer = Viewer(controls)
        self._thread = threading.Thread(
            target=lambda: controls.run([self.latest, LatestOnly(self.viewer)], stop=self._over.is_set)
        )
        self._thread.start()

    def end(self) -> None:
        self._over.set()
        self._thread.join(60)
        assert not self._thread.is_alive()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    """The simulated sensor, at rest until somebody presses it."""
    job = prepare(PressedSource("rest"), method="perimeter")
    folder = tmp_path_factory.mktemp("recordings")
    running = Session(Live(job, recordings=folder), folder)
    yield running
    running.end()


@pytest.fixture
def opened(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Opens pages, and complains of every error and of every request that leaves the machine's viewer."""
    complaints: list[str] = []
    pages: list[Page] = []

    def open_page(url: str, **more: Any) -> Page:
        page = browser.new_page(**{"viewport": {"width": 1440, "height": 900}, **more})
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", lambda line: complaints.append(line.text) if line.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("requestfailed", lambda request: complaints.append(f"failed: {request.url}"))
        page.on("request", lambda request: complaints.extend(foreign(request.url, url)))
        page.goto(url)
        wait(page, "manytouch.state.count > 1 && manytouch.state.scenery")
        pages.append(page)
        return page

    yield open_page
    for page in pages:
        page.close()
    assert complaints == []


def foreign(request: str, url: str) -> list[str]:
    return [] if request.startswith((url, f"blob:{url}", "data:")) else [request]


def wait(page: Page, condition: str) -> None:
    """Until something is true in the page; its own rules forbid Playwright's waiting."""
    for _ in range(PATIENCE_MS // 50):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"not within {PATIENCE_MS // 1000} s: {condition}; {page.inner_text('#state')}")


def wait_for_words(page: Page, selector: str, *words: str) -> None:
    """Until an element says them: the panes are drawn with the screen's next frame, not at once."""
    found = f"document.querySelector('{selector}').innerText"
    wait(page, f"{list(words)}.every((word) => {found}.includes(word))")


def press(page: Page, at_mm: tuple[float, float], depth_mm: float = 2.5) -> None:
    """Press with the mouse, and leave the finger there."""
    page.click("[data-mode=press]")
    page.fill("#press-depth", str(depth_mm))
    page.check("#press-stay")
    x, y = page.evaluate("(at) => manytouch.pane.onScreen(...at)", list(at_mm))
    page.mouse.click(x, y)
    wait(page, "manytouch.state.update.head.contacts.length > 0")
    page.wait_for_timeout(800)


def lift(page: Page) -> None:
    page.click("[data-mode=press]")
    page.click("#lift-all")
    page.click("[data-mode=look]")
    wait(page, "manytouch.state.update.head.contacts.length === 0")


def choose(page: Page, at_mm: tuple[float, float]) -> None:
    """Click a point of the surface."""
    page.click("[data-mode=look]")
    x, y = page.evaluate("(at) => manytouch.pane.onScreen(...at)", list(at_mm))
    page.mouse.click(x, y)


def test_the_mouse_presses_the_surface_moves_and_a_click_reads_the_estimate(
    session: Session, opened: Callable[..., Page]
) -> None:
    page = opened(session.viewer.url)
    press(page, AT_MM)
    (truth, *_) = page.evaluate("manytouch.state.update.head.beside.contacts")
    assert math.dist((truth["x_mm"], truth["y_mm"]), AT_MM) < 1.5
    deepest = page.evaluate("Math.max(...manytouch.state.update.parts.depth)")
    assert deepest > 1.0
    choose(page, AT_MM)
    wait(page, "manytouch.state.measured?.points.length === 1")
    compare_with_estimate(page, session)
    wait_for_words(page, "#measure", "depth", "±")
    choose(page, (25.0, -5.0))
    wait(page, "manytouch.state.measured?.points.length === 2")
    measured = compare_with_estimate(page, session)
    chosen = np.array(page.evaluate("manytouch.state.points"))
    assert measured["rest_distance_mm"] == pytest.approx(np.linalg.norm(chosen[1] - chosen[0]), abs=1e-3)
    assert len([depth for depth in measured["profile"]["depth_mm"] if depth is not None]) > 100
    wait_for_words(page, "#measure", "distance now")
    assert page.is_visible("#profile")
    page.keyboard.press("Escape")
    assert page.evaluate("manytouch.state.points") == []
    lift(page)


def compare_with_estimate(page: Page, session: Session) -> dict[str, Any]:
    """What the page shows at the chosen points is what the estimator said of the same frame."""
    measured: dict[str, Any] = page.evaluate("manytouch.state.measured")
    point_mm = np.array(page.evaluate("manytouch.state.points"), dtype=np.float64)
    reading = session.latest.readings[measured["frame"]]
    layout = session.controls.sensor.layout
    own = sampling_at(layout, point_mm)(-reading.surface.displacement_mm[:, 2])
    shown = [point["depth_mm"] for point in measured["points"]]
    np.testing.assert_allclose(shown, own, atol=0.05)
    assert all(point["std_mm"] > 0 for point in measured["points"])
    return measured


def test_stop_tare_record_and_method(session: Session, opened: Callable[..., Page]) -> None:
    page = opened(session.viewer.url)
    page.click("#run")
    wait(page, "!manytouch.state.health.is_running")
    page.wait_for_timeout(500)
    before = page.evaluate("manytouch.state.update.head.frame")
    page.wait_for_timeout(700)
    assert page.evaluate("manytouch.state.update.head.frame") == before
    assert "held" in page.inner_text("#state")
    page.click("#run")
    wait(page, f"manytouch.state.update.head.frame > {before}")
    press(page, (10.0, 5.0))
    page.click("[data-mode=look]")
    page.click("#tare")
    wait(page, "manytouch.state.health.notes.at(-1)?.startsWith('tared')")
    wait(page, "Math.max(...manytouch.state.update.parts.depth) < 0.3")
    lift_after_tare(page)
    page.click("#settings-open")
    page.select_option("#method", "paper")
    wait(page, "manytouch.state.health.method === 'paper'")
    page.select_option("#method", "perimeter")
    wait(page, "manytouch.state.health.method === 'perimeter'")
    page.select_option("#length-unit", "µm")
    assert "µm" in page.inner_text("#press-depth-words")
    wait_for_words(page, "#health", "µm")
    page.click("#settings .close")


def lift_after_tare(page: Page) -> None:
    """The sheet comes back beyond what now counts as untouched; tare once more."""
    page.click("[data-mode=press]")
    page.click("#lift-all")
    page.click("[data-mode=look]")
    page.wait_for_timeout(600)
    page.click("#tare")
    wait(page, "manytouch.state.health.notes.filter((n) => n.startsWith('tared')).length > 1")
    wait(page, "manytouch.state.update.head.contacts.length === 0")


def test_record_and_replay_with_a_timeline(
    session: Session, opened: Callable[..., Page], tmp_path: Path
) -> None:
    page = opened(session.viewer.url)
    page.click("#record")
    wait(page, "manytouch.state.health.recording")
    name = page.evaluate("manytouch.state.health.recording")
    press(page, AT_MM)
    begun = page.evaluate("manytouch.state.update.head.frame")
    wait(page, f"manytouch.state.update.head.frame > {begun + 25}")
    lift(page)
    page.click("#record")
    wait(page, "!manytouch.state.health.recording")
    replay = Session(Playback(session.recordings / name, stays=True))
    again = opened(replay.viewer.url)
    try:
        assert again.is_visible("#timeline")
        total = again.evaluate("manytouch.state.health.frame_count")
        assert total > 20
        again.click("#run")
        wait(again, "!manytouch.state.health.is_running")
        for share in (0.8, 0.2, 0.5):
            frame = round(share * total)
            again.evaluate(
                "(frame) => { const bar = document.getElementById('seek'); bar.value = frame;"
                "bar.dispatchEvent(new Event('change')); }",
                frame,
            )
            wait(again, f"Math.abs(manytouch.state.health.frame - {frame}) <= 1")
        wait_for_words(again, "#seek-words", "frame", "of")
        assert again.evaluate("manytouch.state.update.head.beside") is None
        again.keyboard.press("s")
        again.select_option("#method", "paper")
        again.keyboard.press("Escape")
        wait(again, "manytouch.state.update.head.beside?.name === 'recorded'")
        wait_for_words(again, "#beside-name", "recorded")
        assert again.evaluate("manytouch.state.health.method") == "paper"
        assert "difference" in again.evaluate("manytouch.state.update.head.layers")
    finally:
        again.close()
        replay.end()


def test_two_browsers_and_one_that_is_gone(
    session: Session, opened: Callable[..., Page], browser: Browser
) -> None:
    first = opened(session.viewer.url)
    context = browser.new_context()
    second = context.new_page()
    second.goto(session.viewer.url)
    wait(second, "manytouch.state.count > 1")
    wait(first, "manytouch.state.health.browsers === 2")
    context.close()
    wait(first, "manytouch.state.health.browsers === 1")
    before = first.evaluate("manytouch.state.count")
    wait(first, f"manytouch.state.count > {before + 3}")


@pytest.mark.parametrize(
    ("theme", "size"),
    [("light", (1600, 950)), ("dark", (1600, 950)), ("light", (1024, 1366)), ("light", (400, 800))],
)
def test_it_looks_right(
    session: Session, opened: Callable[..., Page], tmp_path: Path, theme: str, size: tuple[int, int]
) -> None:
    page = opened(
        session.viewer.url,
        viewport={"width": size[0], "height": size[1]},
        color_scheme=theme,
    )
    wait(page, "manytouch.state.paints > 1")
    shot = tmp_path / "viewer.png"
    page.screenshot(path=shot)
    picture = cv2.imread(str(shot))
    assert picture.shape[:2] == (size[1], size[0])
    is_dark = float(np.median(picture)) < 90
    assert is_dark is (theme == "dark")
    box = page.locator("#scene").bounding_box()
    assert box is not None
    assert box["width"] > 0.4 * size[0]
    x, y, wide, high = (int(box[name]) for name in ("x", "y", "width", "height"))
    scene = picture[y : y + high, x : x + wide]
    assert len(np.unique(scene.reshape(-1, 3), axis=0)) > 100
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")


def growth_of_heap(page: Page, seconds: float) -> float:
    """Bytes per second that the page keeps, from collected heaps after a time to settle."""
    page.wait_for_timeout(5000)
    before = page.evaluate("gc(), performance.memory.usedJSHeapSize")
    page.wait_for_timeout(1000 * seconds)
    after = page.evaluate("gc(), performance.memory.usedJSHeapSize")
    return float(after - before) / seconds


@pytest.mark.parametrize("seconds", [15.0, pytest.param(120.0, marks=pytest.mark.slow)])
def test_memory_stays_flat(session: Session, opened: Callable[..., Page], seconds: float) -> None:
    page = opened(session.viewer.url)
    press(page, AT_MM)
    assert growth_of_heap(page, seconds) < 2_000_000 / seconds
    lift(page)
