"""Chromium for the tests of the viewer, and waiting in a page whose policy forbids Playwright's own."""

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from playwright.sync_api import Browser, Page, sync_playwright

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    "--js-flags=--expose-gc",
]
TIMEOUT_MS = 60_000


@contextmanager
def launched(flags: Sequence[str] = FLAGS) -> Iterator[Browser]:
    """A browser, with WebGL in software unless the flags forbid it."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=flags)
        yield browser
        browser.close()


def wait(page: Page, condition: str) -> None:
    """Wait for a condition in the page, whose content security policy forbids Playwright's own waiting."""
    for _ in range(TIMEOUT_MS // 50):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"not met within {TIMEOUT_MS // 1000} s: {condition}; {page.inner_text('#state')}")


def wait_for_text(page: Page, selector: str, *texts: str) -> None:
    """Wait until an element contains texts; panes are drawn with the next frame of the display."""
    found = f"document.querySelector('{selector}').innerText"
    wait(page, f"{list(texts)}.every((text) => {found}.includes(text))")


def wait_until(page: Page, is_met: Callable[[], bool]) -> None:
    """Wait for a condition outside the page, such as a command that the session has received."""
    for _ in range(TIMEOUT_MS // 50):
        if is_met():
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"not met within {TIMEOUT_MS // 1000} s; {page.inner_text('#state')}")


def wait_for_paint(page: Page) -> None:
    """Wait for three frames of the display: what changed before is drawn, and labels have their places."""
    page.evaluate(
        "new Promise((done) => { let left = 3;"
        " const next = () => left-- ? requestAnimationFrame(next) : done(); next(); })"
    )
