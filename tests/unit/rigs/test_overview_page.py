"""The page of a rig: what it serves, and what it must not contain."""

import re
import urllib.request
from collections.abc import Iterator
from importlib.resources import files

import pytest

from manytouch.rigs.overview_page import OverviewPage, page_html


@pytest.fixture
def page() -> Iterator[OverviewPage]:
    page = OverviewPage("hand", {})
    yield page
    page.close()


def test_everything_that_the_page_needs_is_served_under_a_strict_policy(page: OverviewPage) -> None:
    wanted = re.findall(r"(?:href|src)=/(\S+?)>", page_html("hand"))
    assert sorted(wanted) == ["overview_page.css", "overview_page.js"]
    for path in ("", *wanted):
        with urllib.request.urlopen(page.url + path, timeout=5) as answer:
            assert answer.status == 200
            assert "unsafe" not in answer.headers["Content-Security-Policy"]
            assert answer.read()


def test_names_are_text() -> None:
    assert "<img" not in page_html("<img src=x>")
    script = (files("manytouch.rigs") / "overview_page.js").read_text(encoding="utf-8")
    assert not re.search("innerHTML|outerHTML|insertAdjacentHTML|document.write", script)
