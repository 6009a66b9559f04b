"""What an update of the viewer costs until it is drawn, in Chromium, while parameters change.

    python benchmarks/viewer_page.py [--seconds 15] [--method paper] [--change PARAMETER]

A session reads frames of 600 dots from memory, 30 per second, and a page of 1366 x 768 px shows it. Every
second the parameter is changed. For each update: processor time of making its message, its size, time of the
page's own code (taking the message, drawing), and time until the pixels are there, which with a software
renderer is mostly Chromium's. Times are medians and 95th percentiles; the goal for what is ours is 10 ms.
Before that: time from opening the page until camera image and surface are drawn; the goal is 2 s.
"""

import argparse
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from outputs import FORTH, KeptFrames
from playwright.sync_api import Page, sync_playwright

from manytouch.session import Live, prepare, run
from manytouch.sinks.latest_only import LatestOnly
from manytouch.sinks.viewer import Viewer
from manytouch.sinks.viewer.update_encoder import UpdateEncoder
from manytouch.sources.simulated import simulated_source
from manytouch.values import Tune

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from browser import CHROMIUM, FLAGS

FPS, SETTLE_S = 30.0, 4.0
VALUES = (1.5, 2.0, 2.5, 2.0)
FIRST_PICTURE = "window.manytouch?.state.paints > 0 && document.getElementById('camera-empty').hidden"
MEASURE = """
window.measured = { message: [], frame: [], pixels: [] };
const timed = (list, act) => (...given) => {
  const begin = performance.now(), found = act(...given);
  list.push(performance.now() - begin);
  return found;
};
const nextFrame = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (act) => nextFrame((now) => {
  const before = window.manytouch?.state.paints ?? 0, begin = performance.now();
  act(now);
  const spent = performance.now() - begin;
  if ((window.manytouch?.state.paints ?? 0) === before) return;
  window.measured.frame.push(spent);
  const gl = window.manytouch.pane.renderer?.getContext();
  if (gl && window.measured.frame.length % 10 === 0) {
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    window.measured.pixels.push(performance.now() - begin - spent);
  }
});
Object.defineProperty(WebSocket.prototype, "onmessage", { set(act) {
  this.addEventListener("message", (event) => {
    if (typeof event.data === "string") act(event); else timed(window.measured.message, act)(event);
  });
} });
"""


def spread(values: list[float]) -> str:
    if not values:
        return "none"
    return f"{np.median(values):.1f} ms (95 %: {np.percentile(values, 95):.1f} ms)"


def first_picture_s(page: Page, url: str) -> float:
    """Time from opening a page until the camera image and the surface are drawn, s."""
    begin_s = time.monotonic()
    page.goto(url, wait_until="commit")
    while not page.evaluate(FIRST_PICTURE):
        page.wait_for_timeout(10)
    return time.monotonic() - begin_s


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--method", default="paper")
    parser.add_argument("--change", default="interpolation.search_radius_pitch")
    options = parser.parse_args()
    simulator = simulated_source(fps=FPS).simulator
    images = [np.asarray(simulator.frame(number).image) for number in range(FORTH)]
    source = KeptFrames(images=images, fps=FPS, seconds=1e6)
    live = Live(prepare(source, sensor=simulated_source().capabilities.sensor, method=options.method))
    spent_ms: list[float] = []
    sizes: list[int] = []
    encode = UpdateEncoder.__call__

    def timed(encoder: UpdateEncoder, *given: Any) -> Any:
        begin_s = time.thread_time()
        found = encode(encoder, *given)
        spent_ms.append(1e3 * (time.thread_time() - begin_s))
        sizes.append(len(found[0]))
        return found

    UpdateEncoder.__call__ = timed  # type: ignore[method-assign]
    viewer, over = Viewer(live), threading.Event()
    session = threading.Thread(target=lambda: run(live, [LatestOnly(viewer)], stop=over.is_set))
    session.start()
    try:
        show(viewer, live, options, spent_ms, sizes)
    finally:
        over.set()
        session.join()


def show(
    viewer: Viewer, live: Live, options: argparse.Namespace, spent_ms: list[float], sizes: list[int]
) -> None:
    """Open the page, change the parameter, and print the figures."""
    while not live.health().frames:
        time.sleep(0.1)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1366, "height": 768})
        page.add_init_script(MEASURE)
        print(f"page, opened to first picture: {first_picture_s(page, viewer.url):.2f} s")
        page.keyboard.press("Escape")
        page.wait_for_timeout(1e3 * SETTLE_S)
        page.evaluate("Object.values(measured).forEach((list) => { list.length = 0; })")
        spent_ms.clear()
        sizes.clear()
        readings, begin_s = live.health().frames, time.monotonic()
        for count in range(round(options.seconds)):
            live.send(Tune(parameter=options.change, value=VALUES[count % len(VALUES)]))
            page.wait_for_timeout(1000)
        span_s = time.monotonic() - begin_s
        found = page.evaluate("measured")
        print(f"load of the machine {os.getloadavg()[0]:.1f}; {options.change} changed each second")
        counts = (live.health().frames - readings, len(spent_ms), len(found["frame"]))
        rates = [f"{count / span_s:.1f}" for count in counts]
        print(f"per second: {rates[0]} readings, {rates[1]} updates sent, {rates[2]} drawn")
        print(f"making the message:   {spread(spent_ms)}, {np.mean(sizes) / 1e3:.0f} kB")
        print(f"page, taking it:      {spread(found['message'])}")
        print(f"page, drawing:        {spread(found['frame'])}")
        print(f"renderer, until the pixels are there: {spread(found['pixels'])}")
        browser.close()


if __name__ == "__main__":
    main()
