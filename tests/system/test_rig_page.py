"""The page of a rig: a tile with the viewer of each sensor, and none of a viewer that does not allow it."""

from pathlib import Path

import pytest

pytest.importorskip("nicegui")
pytest.importorskip("playwright")

from playwright.sync_api import Browser

from browser import CHROMIUM
from manytouch.rigs.overview_page import OverviewPage
from manytouch.rigs.rig_file import load_rig
from manytouch.rigs.run_rig import SensorState
from manytouch.sinks.viewer import Viewer
from viewer_session import FakeSession, reading_of

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
RIG = """schema = 1
name = "hand"
[[sensors]]
name = "index"
source = "sim:one"
[[sensors]]
name = "thumb"
source = "sim:one"
"""


def test_tiles_show_the_viewers_that_allow_it(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "hand.toml"
    path.write_text(RIG)
    states = {sensor.name: SensorState(sensor) for sensor in load_rig(path).sensors}
    rig_page = OverviewPage("hand", states)
    viewers = [Viewer(FakeSession(), embedded_in=origin) for origin in (rig_page.origin, None)]
    for viewer, state in zip(viewers, states.values(), strict=True):
        viewer.write(reading_of(0))
        state.viewer = viewer.url
    states["thumb"].restarts = 3
    states["index"].sensor_name = "<b>demo sheet</b>"
    page = browser.new_page()
    page.goto(rig_page.url)
    page.frame_locator("iframe[title='viewer of index']").locator("#contacts tbody").wait_for()
    # In one call: the page replaces its rows again and again.
    cells = page.evaluate(
        "[...document.querySelectorAll('#sensors tr')].map(row => [...row.cells].map(one => one.textContent))"
    )
    assert page.frame_locator("iframe[title='viewer of thumb']").locator("#contacts").count() == 0
    titles = page.locator("#tiles section:has(iframe) h2")
    assert titles.all_inner_texts() == ["index <b>demo sheet</b>", "thumb"]
    assert titles.first.is_visible()
    name_px, sensor_px = page.evaluate(
        "['h2', 'h2 small'].map((one) => parseFloat(getComputedStyle(document.querySelector(one)).fontSize))"
    )
    assert sensor_px < name_px
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.locator("meta[name=viewport]").count() == 1
    page.close()
    assert [row[0] for row in cells] == ["index", "thumb"]
    assert [row[-1] for row in cells] == ["0", "3"]
    for viewer in viewers:
        viewer.close()
    rig_page.close()
