"""Sentences about a camera: one when it gives no images, one when it does again."""

from dataclasses import dataclass, replace

import pytest

from drawn_source import DrawnSource
from manytouch.sources import Capabilities
from manytouch.sources.state_notes import StateNotes


@dataclass
class Camera(DrawnSource):
    """A source that is a device too.

    Attributes:
        status: of the device.
    """

    status: str = "ok"
    is_colour: bool = False
    settings: tuple[()] = ()

    @property
    def capabilities(self) -> Capabilities:
        return replace(super().capabilities, device=self)

    def listen(self, tap: object) -> None: ...

    def close(self) -> None: ...


@pytest.mark.parametrize(
    ("states", "sentences"),
    [
        (["ok", "ok"], []),
        (["ok", "no image for 3 s", "no image for 4 s"], ["no image for 3 s"]),
        (["no image for 3 s", "disconnected"], ["no image for 3 s", "disconnected"]),
        (["disconnected", "ok", "ok", "disconnected"], ["disconnected", "AGAIN", "disconnected"]),
    ],
)
def test_each_change_is_stated_once(states: list[str], sentences: list[str]) -> None:
    camera, found = Camera(), []
    stop = StateNotes(camera, found.append).checked(lambda: camera.status == "disconnected")
    for camera.status in states:
        assert stop() == (camera.status == "disconnected"), "the other condition decides"
    assert found == [each.replace("AGAIN", "drawn gives images again") for each in sentences]


def test_nothing_is_stated_of_a_source_without_a_device() -> None:
    found: list[str] = []
    assert not StateNotes(DrawnSource(), found.append).checked(lambda: False)()
    assert found == []
