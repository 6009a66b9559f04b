"""Cameras and live sessions in words: what was asked for, what is there, how late readings are."""

import sys
import time
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

from manytouch.sources.source import Device
from manytouch.values import Health, Setting

MEASURED_FRAMES = 45
_DEVICES = Path("/sys/class/video4linux")


def settings_in_words(settings: Sequence[Setting]) -> Iterator[str]:
    """One line about all that a camera says, and one about each thing that it does otherwise than asked."""
    told = [f"{setting.name} {setting.found}" for setting in settings if setting.found is not None]
    if told:
        yield f"camera: {', '.join(told)}"
    for setting in settings:
        if setting.requested in (None, "auto", setting.found):
            continue
        says = "this driver does not tell" if setting.found is None else f"it says {setting.found}"
        yield f"camera: {setting.name} {setting.requested} was asked for; {says}"


def pace_in_words(health: Health) -> str:
    """How late readings were, and what was left out."""
    late = (
        f"{health.latency_ms_p50:.0f} ms in the median, {health.latency_ms_p99:.0f} ms for the latest of 100"
    )
    read = "1 frame" if health.frames == 1 else f"{health.frames} frames"
    return f"from frame to reading {late}; {read} read, {health.dropped} dropped"


def rate_in_words(source: Device) -> str:
    """How many pictures really come."""
    frames = iter(source)
    next(frames, None)
    begun_s = time.monotonic()
    indices = [frame.index for frame in islice(frames, MEASURED_FRAMES)]
    spent_s = time.monotonic() - begun_s
    if len(indices) < 2:
        return f"measured rate: not known: {source.status}"
    arrived = indices[-1] - indices[0] + 1
    words = f"measured rate: {arrived / spent_s:.1f} frames per second arrive"
    if arrived > len(indices):
        words += f", {len(indices) / spent_s:.1f} are decoded here"
    if source.fps is not None and arrived / spent_s < 0.9 * source.fps:
        words += (
            f"; the camera says {source.fps:g}: more light or a shorter exposure, Motion JPEG, a USB 3 port, "
            "or a smaller size"
        )
    return words


def cameras_in_words(devices: Path = _DEVICES) -> str:
    """The cameras of this machine, as far as the system lists them."""
    if not sys.platform.startswith("linux"):
        return "cameras: this system does not list them; try manytouch doctor 0, then 1"
    found = []
    for device in sorted(devices.glob("video*"), key=lambda path: int(path.name.removeprefix("video") or 0)):
        name = device / "name"
        found.append(f"/dev/{device.name} ({name.read_text().strip() if name.is_file() else 'no name'})")
    return f"cameras: {', '.join(found) or 'none found'}"
