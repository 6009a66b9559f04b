"""Several sources as the views of one sheet: their pictures in a row, one frame for all."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from manytouch.errors import SourceError
from manytouch.geometry.views.merging import side_by_side
from manytouch.source_names import VIEWS_PREFIX
from manytouch.sources.source import ASSUMED_FPS, Capabilities, Device, Source
from manytouch.values import Frame, Setting

_SAME_RATE = 0.01
_INTERVALS = 9  # whose median is the period of a camera that does not report its rate


class JoinedSource:
    """The frames of several sources, joined.

    Files are joined frame by frame and end with the first that ends. Frames of cameras are joined when they
    arrived within half a period; a frame without a partner is left out.

    Attributes:
        views: the sources, from left to right.
    """

    def __init__(self, views: Sequence[Source], *, fps: float | None = None) -> None:
        """Join sources.

        Args:
            views: from left to right.
            fps: of cameras that do not report their rate, such as streams; None measures it.

        Raises:
            SourceError: there are fewer than two, some are live and others are not, or their rates differ.
        """
        if len(views) < 2:
            raise SourceError(
                f"{VIEWS_PREFIX} needs two sources or more, separated by commas, found {len(views)}"
            )
        if len({view.is_live for view in views}) > 1:
            raise SourceError(
                "the views of a sheet are either all live or all files: give sources of one kind"
            )
        rates = [view.fps for view in views if view.fps is not None]
        if not views[0].is_live and rates and max(rates) > (1.0 + _SAME_RATE) * min(rates):
            listed = ", ".join(f"{view.name} {view.fps:g}" for view in views if view.fps is not None)
            raise SourceError(f"the views have different frame rates ({listed}): set one rate with --fps")
        self.views = tuple(views)
        self._given_fps = fps
        self._tap: Callable[[Frame], None] | None = None
        devices = [view.capabilities.device for view in views]
        known = [device for device in devices if device is not None]
        self._devices = _Devices(known, self) if known else None

    @property
    def name(self) -> str:
        """Names of the views, joined."""
        return "-".join(view.name for view in self.views)[:100]

    @property
    def fps(self) -> float | None:
        return next((view.fps for view in self.views if view.fps is not None), self._given_fps)

    @property
    def frame_count(self) -> int | None:
        counts = [view.frame_count for view in self.views]
        known = [count for count in counts if count is not None]
        return min(known) if len(known) == len(counts) else None

    @property
    def width_px(self) -> int | None:
        widths = [view.width_px for view in self.views]
        known = [width for width in widths if width is not None]
        return sum(known) if len(known) == len(widths) else None

    @property
    def height_px(self) -> int | None:
        return max((view.height_px for view in self.views if view.height_px is not None), default=None)

    @property
    def is_live(self) -> bool:
        return self.views[0].is_live

    @property
    def capabilities(self) -> Capabilities:
        files = tuple(path for view in self.views for path in view.capabilities.files)
        return Capabilities(device=self._devices, files=files, views=len(self.views))

    def __iter__(self) -> Iterator[Frame]:
        if self.is_live:
            return self._joined_by_time()
        return (side_by_side(frames) for frames in zip(*self.views, strict=False))

    def _joined_by_time(self) -> Iterator[Frame]:
        streams = [iter(view) for view in self.views]
        arrivals = [deque[int](maxlen=_INTERVALS + 1) for _ in streams]
        newest: list[Frame | None] = [None] * len(streams)
        while True:
            for number, stream in enumerate(streams):
                if newest[number] is None:
                    frame = newest[number] = next(stream, None)
                    if frame is not None:
                        arrivals[number].append(_arrived_ns(frame))
            found = [frame for frame in newest if frame is not None]
            if len(found) < len(newest):
                return
            last_ns = max(_arrived_ns(frame) for frame in found)
            half_ns = 0.5e9 / self.fps if self.fps else 0.5 * _period_ns(arrivals)
            newest = [None if last_ns - _arrived_ns(frame) > half_ns else frame for frame in found]
            if all(frame is not None for frame in newest):
                joined = side_by_side(found)
                if self._tap is not None:
                    self._tap(joined)
                yield joined
                newest = [None] * len(streams)

    def listen(self, tap: Callable[[Frame], None] | None) -> None:
        """Pass every joined frame to `tap`; None ends that."""
        self._tap = tap


def _period_ns(arrivals: Sequence[Sequence[int]]) -> float:
    """The longest median time between two frames of one view; 1 / `ASSUMED_FPS` before there are two."""
    medians = [float(np.median(np.diff(each))) for each in arrivals if len(each) > 1]
    return max(medians, default=1e9 / ASSUMED_FPS)


class _Devices:
    """The devices of all views as one."""

    def __init__(self, devices: Sequence[Device], joined: JoinedSource) -> None:
        self._devices, self._joined = devices, joined
        self.settings: tuple[Setting, ...] = tuple(
            replace(setting, name=f"{view.name} {setting.name}")
            for device, view in zip(devices, joined.views, strict=False)
            for setting in device.settings
        )

    @property
    def is_colour(self) -> bool:
        return any(device.is_colour for device in self._devices)

    @is_colour.setter
    def is_colour(self, value: bool) -> None:
        for device in self._devices:
            device.is_colour = value

    @property
    def status(self) -> str:
        return next((device.status for device in self._devices if device.status != "ok"), "ok")

    def listen(self, tap: Callable[[Frame], None] | None) -> None:
        self._joined.listen(tap)

    def close(self) -> None:
        for device in self._devices:
            device.close()


def _arrived_ns(frame: Frame) -> int:
    return time.monotonic_ns() if frame.arrived_ns is None else frame.arrived_ns
