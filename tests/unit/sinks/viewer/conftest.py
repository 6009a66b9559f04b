"""A viewer that is served, before a session that does nothing by itself."""

from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("nicegui")

from manytouch.sinks.viewer import Viewer
from watched import Desk


@pytest.fixture
def desk() -> Desk:
    return Desk()


@pytest.fixture
def serve(desk: Desk) -> Iterator[Callable[..., Viewer]]:
    """Makes viewers and closes them."""
    made: list[Viewer] = []

    def make(**where: object) -> Viewer:
        made.append(Viewer(desk, **where))
        return made[-1]

    yield make
    for viewer in made:
        viewer.close()


@pytest.fixture
def viewer(serve: Callable[..., Viewer]) -> Viewer:
    return serve()
