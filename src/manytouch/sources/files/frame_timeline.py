"""Random access to the frames of a video or of images, for playback; timestamps are not checked here."""

from collections import OrderedDict
from collections.abc import Iterator

from manytouch.sources.source import Source, evenly_timed_ns
from manytouch.values import Frame, Reading

KEPT_BYTES = 200_000_000


class FrameTimeline:
    """A `Timeline` of a source that can be iterated again; it has no stored readings.

    The next frame is decoded, a later one after those before it, an earlier one from the beginning if it is
    not among the latest `KEPT_BYTES`.
    """

    method = ""
    warning = None

    def __init__(self, source: Source, length: int) -> None:
        """Begin before the first frame; use `frame_timeline`."""
        self._source = source
        self._length = length
        self._frames: Iterator[Frame] = iter(source)
        self._next = 0
        self._kept: OrderedDict[int, Frame] = OrderedDict()
        self._kept_bytes = 0

    def __len__(self) -> int:
        return self._length

    def timestamp_ns(self, place: int) -> int:
        """Timestamp of the frame at a place; of one that was not decoded yet by the frame rate."""
        kept = self._kept.get(place)
        return evenly_timed_ns(place, self._source.fps) if kept is None else kept.timestamp_ns

    def frame(self, place: int) -> Frame:
        """The frame at a place; without image if the source ends before it."""
        if place not in self._kept:
            if place < self._next:
                self._frames, self._next = iter(self._source), 0
            while self._next <= place and (frame := next(self._frames, None)) is not None:
                self._keep(self._next, frame)
                self._next += 1
        if place in self._kept:
            return self._kept[place]
        self._length = max(self._next, 1)
        return Frame(index=place, timestamp_ns=self.timestamp_ns(place), camera=self._source.name, image=None)

    def reading(self, place: int) -> Reading | None:
        """There are no stored readings."""
        return None

    def stored_reading(self, frame_index: int) -> Reading | None:
        """There are no stored readings."""
        return None

    def _keep(self, place: int, frame: Frame) -> None:
        self._kept[place] = frame
        self._kept_bytes += _size(frame)
        while self._kept_bytes > KEPT_BYTES and len(self._kept) > 1:
            _, oldest = self._kept.popitem(last=False)
            self._kept_bytes -= _size(oldest)


def frame_timeline(source: Source) -> FrameTimeline | None:
    """A timeline of a source; None of a live one, and where the number of frames is not known."""
    if source.is_live or not source.capabilities.files or not source.frame_count:
        return None
    return FrameTimeline(source, source.frame_count)


def _size(frame: Frame) -> int:
    return 0 if frame.image is None else frame.image.nbytes
