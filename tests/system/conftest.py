"""Real recordings, where they are present next to the repository, and a browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from measured_once import layouts_measured_once

if TYPE_CHECKING:
    from playwright.sync_api import Browser

RECORDINGS = Path(__file__).parents[3] / "shared" / "data"


@pytest.fixture(scope="session", autouse=True)
def layouts() -> Iterator[None]:
    """Runs of the program in this process measure each layout once; the first of them does."""
    with layouts_measured_once():
        yield


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of the real recordings; the test is skipped where they are absent."""
    if not RECORDINGS.is_dir():
        pytest.skip(f"the real recordings are not here ({RECORDINGS.parent.name}/{RECORDINGS.name})")
    return RECORDINGS


@pytest.fixture(scope="module")
def browser() -> "Iterator[Browser]":
    """Closed after each module: its event loop would be in the way of other tests."""
    from browser import launched

    with launched() as opened:
        yield opened
