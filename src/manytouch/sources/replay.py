"""A recording as a source of frames."""

from collections.abc import Iterator
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.recording.reader import Recording
from manytouch.sources.encoded import decoded
from manytouch.values import Frame, Reading, Sensor


class ReplaySource:
    """The frames of a recording, at the times they had, and its stored readings.

    Attributes:
        recording: the file.
        is_colour: decode JPEG in colour.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        layout = recording.sensor.layout
        self.is_colour = layout is not None and layout.colour_weights is not None
        first = next(
            (
                frame.image.shape
                for place in range(len(recording))
                if (frame := self.frame(place)).image is not None
            ),
            None,
        )
        if first is None:
            raise SourceError(
                f"{str(recording.path)!r}: none of its {len(recording)} frames can be decoded; record again"
            )
        self.height_px, self.width_px = int(first[0]), int(first[1])

    @property
    def name(self) -> str:
        return self.recording.path.stem

    @property
    def fps(self) -> float | None:
        """From first to last frame, by the middle step, so that gaps do not count."""
        steps = [
            self.recording.timestamp_ns(place + 1) - self.recording.timestamp_ns(place)
            for place in range(len(self.recording) - 1)
        ]
        middle = sorted(steps)[len(steps) // 2] if steps else 0
        return 1e9 / middle if middle > 0 else None

    @property
    def frame_count(self) -> int:
        return len(self.recording)

    @property
    def is_live(self) -> bool:
        return False

    @property
    def sensor(self) -> Sensor:
        """The sensor that was recorded."""
        return self.recording.sensor

    @property
    def warning(self) -> str | None:
        """What to tell about the file, or None."""
        if self.recording.is_whole:
            return None
        return f"{self.recording.path.name} was cut off; its {len(self.recording)} whole frames are replayed"

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(place) for place in range(len(self.recording)))

    def frame(self, place: int) -> Frame:
        """The frame at a place, decoded."""
        return decoded(self.recording.frame(place), is_colour=self.is_colour)

    def reading(self, place: int) -> Reading | None:
        """The stored reading of the frame at a place; None when it was not read."""
        return self.recording.reading(self.frame(place)) if self.recording.was_read(place) else None


def replay_source(path: Path) -> ReplaySource:
    """A recording as a source.

    Raises:
        SourceError: it is none, or none of its frames can be decoded.
        MissingExtraError: the packages for recordings are not installed.
    """
    return ReplaySource(Recording(path))
