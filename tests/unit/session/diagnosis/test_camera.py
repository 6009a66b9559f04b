"""Lines about the settings and the frame rate of cameras."""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from manytouch.session.diagnosis.camera import (
    describe_cameras,
    describe_frame_rate,
    describe_settings,
    describe_usb_buses,
)
from manytouch.sources import Capabilities
from manytouch.values import Frame, Setting


def test_a_setting_that_differs_from_its_request_has_a_line() -> None:
    lines = list(
        describe_settings(
            [
                Setting(name="size", requested="2560 x 1440 px", found="1280 x 720 px"),
                Setting(name="exposure", requested="8 ms", found=None),
                Setting(name="focus", requested="auto", found="12"),
                Setting(name="gain", requested="3", found="3"),
            ]
        )
    )
    assert lines == [
        "camera: size 1280 x 720 px, focus 12, gain 3",
        "camera: size 2560 x 1440 px was requested; the driver reports 1280 x 720 px",
        "camera: exposure 8 ms was requested; the driver does not report it",
    ]
    assert list(describe_settings([])) == []


class Steady:
    """A camera that delivers every second of 100 frames per second and reports 200."""

    name, fps, frame_count, width_px, height_px, is_live = "steady", 200.0, None, 8, 6, True
    status, is_colour = "ok", False
    settings: tuple[Setting, ...] = ()

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(device=self)

    def __iter__(self) -> Iterator[Frame]:
        for index in range(100):
            image = np.zeros((6, 8), np.uint8)
            yield Frame(index=2 * index, timestamp_ns=index, camera="steady", image=image)

    def listen(self, tap: object) -> None: ...

    def close(self) -> None: ...


def test_the_frame_rate_is_measured_and_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([10.0, 10.89])
    monkeypatch.setattr("manytouch.session.diagnosis.camera.time.monotonic", lambda: next(clock))
    words = describe_frame_rate(Steady())
    assert "100.0 frames per second arrive, 50.6 are decoded; the camera reports 200" in words


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems do not list cameras")
def test_cameras_are_listed(tmp_path: Path) -> None:
    assert describe_cameras(tmp_path) == "cameras: none found"
    for number, name in ((10, "Second\n"), (2, "First\n")):
        (tmp_path / f"video{number}").mkdir()
        (tmp_path / f"video{number}" / "name").write_text(name)
    assert describe_cameras(tmp_path) == "cameras: /dev/video2 (First), /dev/video10 (Second)"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems do not list cameras")
def test_nodes_of_one_camera_are_folded_and_a_shared_bus_is_a_warning(tmp_path: Path) -> None:
    listed = tmp_path / "class"
    listed.mkdir()
    places = ["usb1/1-1/1-1:1.0", "usb1/1-1/1-1:1.0", "usb1/1-2/1-2:1.0", "usb2/2-1/2-1:1.0"]
    for number, place in enumerate(places):
        interface = tmp_path / "devices" / place
        node = interface / f"video{number}"
        node.mkdir(parents=True)
        (node / "name").write_text(f"Camera {place[3]}\n")
        (node / "device").symlink_to(interface)
        (listed / node.name).symlink_to(node)
    assert describe_cameras(listed) == (
        "cameras: /dev/video0 (Camera 1, USB bus 1), /dev/video2 (Camera 1, USB bus 1), "
        "/dev/video3 (Camera 2, USB bus 2)"
    )
    (warning,) = describe_usb_buses(listed)
    assert warning.startswith("warning: /dev/video0, /dev/video2 share USB bus 1")
