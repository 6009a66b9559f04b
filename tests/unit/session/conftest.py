"""Layouts are measured once: these tests are of what follows."""

from collections.abc import Iterator

import pytest

from measured_once import layouts_measured_once


@pytest.fixture(scope="session", autouse=True)
def layouts() -> Iterator[None]:
    with layouts_measured_once():
        yield
