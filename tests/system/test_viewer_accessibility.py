"""The viewer for everyone: WCAG 2.1 AA by axe, in both themes; all of it with the keyboard."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("nicegui")
pytest.importorskip("playwright")
pytest.importorskip("axe_playwright_python")

import axe_playwright_python
from playwright.sync_api import Browser, Page

from browser import CHROMIUM, wait
from manytouch.sinks.viewer import Viewer
from viewer_session import FakeSession, reading_of

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed"),
]
SCRIPT = (Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text(encoding="utf-8")
RULES = {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]}
FOCUSED = "(e => e.id || e.dataset.pane || e.dataset.mode || e.tagName)(document.activeElement)"


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    session = FakeSession()
    session.now = replace(session.now, can_press=True)
    viewer = Viewer(session)
    viewer.write(reading_of(0))
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    page.goto(viewer.url)
    wait(page, "manytouch.state.count >= 1 && manytouch.state.paints > 0")
    page.evaluate(SCRIPT)
    yield page
    page.close()
    viewer.close()


def violations(page: Page) -> list[str]:
    found: dict[str, Any] = page.evaluate("(rules) => axe.run(document, { runOnly: rules })", RULES)
    assert len(found["passes"]) > 10
    return [
        f"{each['id']}: {node['html'][:120]} {node['failureSummary'][:300]}"
        for each in found["violations"]
        for node in each["nodes"]
    ]


def test_three_steps_are_shown_on_the_first_visit_only(page: Page) -> None:
    page.wait_for_selector("#tour:not([hidden])")
    for number in (1, 2, 3):
        assert page.inner_text("#tour-title").startswith(f"{number} of 3")
        assert page.evaluate("document.querySelectorAll('.pointed').length") == 1
        assert not violations(page)
        page.focus("#tour-next")
        page.keyboard.press("Enter")
    assert not page.is_visible("#tour")
    assert page.evaluate("document.querySelectorAll('.pointed').length") == 0
    page.reload()
    wait(page, "manytouch.state.health && manytouch.state.count >= 1 && manytouch.state.paints > 0")
    page.evaluate(SCRIPT)
    assert not page.is_visible("#tour")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_no_violation(page: Page, theme: str) -> None:
    if page.evaluate("document.documentElement.dataset.theme || 'light'") != theme:
        page.keyboard.press("d")
        page.wait_for_timeout(400)
    assert not violations(page)
    for key, dialog in (("s", "#settings"), ("?", "#help")):
        page.keyboard.press(key)
        page.wait_for_selector(f"{dialog}[open]")
        page.wait_for_timeout(300)
        assert not violations(page)
        page.keyboard.press("Escape")
        page.wait_for_selector(f"{dialog}:not([open])", state="attached")


def test_axe_finds_a_violation_that_is_made(page: Page) -> None:
    page.evaluate("document.querySelector('#hint').style.setProperty('color', '#bbb')")
    page.evaluate("document.querySelector('#settings-open').removeAttribute('aria-label')")
    page.evaluate("document.querySelector('#settings-open').removeAttribute('title')")
    found = violations(page)
    page.reload()
    wait(page, "manytouch.state.count >= 1 && manytouch.state.paints > 0")
    page.evaluate(SCRIPT)
    assert any(each.startswith("button-name") for each in found)


def test_every_control_is_reached_with_the_tab_key_and_shows_that_it_has_the_focus(page: Page) -> None:
    wanted = page.evaluate(
        """[...document.querySelectorAll('button, select, input')].filter((e) => e.offsetParent && !e.disabled
        && !e.closest('dialog')).map((e) => e.id || e.dataset.pane || e.dataset.mode)"""
    )
    page.evaluate("document.activeElement.blur()")
    reached, outlined = [], []
    for _ in range(2 * len(wanted)):
        page.keyboard.press("Tab")
        reached.append(page.evaluate(FOCUSED))
        outlined.append(page.evaluate("getComputedStyle(document.activeElement).outlineStyle !== 'none'"))
        if reached[-1] == wanted[-1]:
            break
    assert not set(wanted) - set(reached)
    assert all(shown for shown, name in zip(outlined, reached, strict=True) if name in wanted)


def test_dialogs_are_opened_used_and_closed_with_the_keyboard(page: Page) -> None:
    page.focus("#help-open")
    page.keyboard.press("Enter")
    page.wait_for_selector("#help[open]")
    page.keyboard.press("Escape")
    page.wait_for_selector("#help:not([open])", state="attached")
    assert page.evaluate(FOCUSED) == "help-open"


def test_space_presses_the_button_that_has_the_focus(page: Page) -> None:
    before = page.evaluate("document.documentElement.dataset.theme || 'light'")
    page.focus("#settings-open")
    page.keyboard.press("Tab")
    assert page.evaluate(FOCUSED) == "theme"
    page.keyboard.press("Space")
    assert page.evaluate("document.documentElement.dataset.theme || 'light'") != before
    assert page.inner_text("#run-label") == "Pause"
    page.keyboard.press("Space")
