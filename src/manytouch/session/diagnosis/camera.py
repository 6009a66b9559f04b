"""Lines of text about cameras: their settings, their frame rate, and the latency of a live session."""

import re
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

from manytouch.sources.source import Source
from manytouch.values import Health, Setting
from manytouch.values.display.text import count_of

MEASURED_FRAMES = 45
_DEVICES = Path("/sys/class/video4linux")


def describe_settings(settings: Sequence[Setting]) -> Iterator[str]:
    """One line with the reported settings of a camera, and one for each that differs from its request."""
    reported = [f"{setting.name} {setting.found}" for setting in settings if setting.found is not None]
    if reported:
        yield f"camera: {', '.join(reported)}"
    for setting in settings:
        if setting.requested in (None, "auto", setting.found):
            continue
        answer = "does not report it" if setting.found is None else f"reports {setting.found}"
        yield f"camera: {setting.name} {setting.requested} was requested; the driver {answer}"


def describe_latency(health: Health) -> str:
    """Latency of the readings, and the numbers of processed and dropped frames."""
    latency = f"{health.latency_ms_p50:.0f} ms (median), {health.latency_ms_p99:.0f} ms (99th percentile)"
    frames = count_of(health.frames, "frame")
    return f"latency from frame to reading {latency}; {frames} processed, {health.dropped} dropped"


def describe_frame_rate(source: Source) -> str:
    """The measured rate at which frames arrive and are decoded."""
    frames = iter(source)
    next(frames, None)
    started_s = time.monotonic()
    indices = [frame.index for frame in islice(frames, MEASURED_FRAMES)]
    elapsed_s = time.monotonic() - started_s
    if len(indices) < 2:
        device = source.capabilities.device
        return f"measured rate: unknown: {'too few frames' if device is None else device.status}"
    arrived = indices[-1] - indices[0] + 1
    text = f"measured rate: {arrived / elapsed_s:.1f} frames per second arrive"
    if arrived > len(indices):
        text += f", {len(indices) / elapsed_s:.1f} are decoded"
    if source.fps is not None and arrived / elapsed_s < 0.9 * source.fps:
        text += (
            f"; the camera reports {source.fps:g}: try more light, a shorter exposure, Motion JPEG, a "
            "USB 3 port, or a smaller image"
        )
    return text


def describe_cameras(devices: Path = _DEVICES) -> str:
    """The cameras that the operating system lists; further nodes of one camera are not named."""
    if not sys.platform.startswith("linux"):
        return "cameras: not listed by this system; try manytouch doctor 0, then 1"
    found = []
    for device in _camera_nodes(devices):
        name, bus = device / "name", _usb_bus(device)
        on = "" if bus is None else f", USB bus {bus}"
        found.append(f"/dev/{device.name} ({name.read_text().strip() if name.is_file() else 'no name'}{on})")
    return f"cameras: {', '.join(found) or 'none found'}"


def describe_usb_buses(devices: Path = _DEVICES) -> Iterator[str]:
    """A warning for each USB bus that several cameras share."""
    by_bus: dict[str, list[str]] = {}
    for device in _camera_nodes(devices) if sys.platform.startswith("linux") else ():
        bus = _usb_bus(device)
        if bus is not None:
            by_bus.setdefault(bus, []).append(f"/dev/{device.name}")
    for bus, names in sorted(by_bus.items()):
        if len(names) > 1:
            yield (
                f"warning: {', '.join(names)} share USB bus {bus} and its bandwidth: use Motion JPEG, "
                "smaller images or fewer frames per second, or ports of different controllers"
            )


def _camera_nodes(devices: Path) -> list[Path]:
    """The first node of each camera: drivers add nodes for its metadata, with the same parent."""
    nodes = sorted(devices.glob("video*"), key=lambda path: int(path.name.removeprefix("video") or 0))
    first: dict[Path, Path] = {}
    for node in nodes:
        parent = node / "device"
        first.setdefault(parent.resolve() if parent.exists() else node, node)
    return list(first.values())


def _usb_bus(device: Path) -> str | None:
    """Number of the USB bus of a node; None if it is not on one."""
    found = re.search(r"/usb(\d+)/", (device / "device").resolve().as_posix())
    return None if found is None else found[1]
