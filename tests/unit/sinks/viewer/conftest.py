"""A viewer of a session that does nothing by itself."""

from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("nicegui")

from manytouch.sinks.viewer import Viewer
from viewer_session import FakeSession


@pytest.fixture
def session() -> FakeSession:
    return FakeSession()


@pytest.fixture
def serve(session: FakeSession) -> Iterator[Callable[..., Viewer]]:
    """Makes viewers and closes them."""
    made: list[Viewer] = []

    def make(**where: object) -> Viewer:
        made.append(Viewer(session, **where))
        return made[-1]

    yield make
    for viewer in made:
        viewer.close()


@pytest.fixture
def viewer(serve: Callable[..., Viewer]) -> Viewer:
    return serve()
