"""A recording as a source of frames."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.recording.reader import Recording
from manytouch.sources.encoded import decoded
from manytouch.sources.source import Capabilities, evenly_timed_ns
from manytouch.values import Frame, Reading


class ReplaySource:
    """The frames of a recording at their recorded times, and its stored readings.

    Attributes:
        recording: the file.
        is_colour: decode JPEG in colour.
    """

    def __init__(self, recording: Recording, fps: float | None = None) -> None:
        """Read the size of its frames.

        Args:
            recording: the file.
            fps: rate that the timestamps follow instead of the recorded times.

        Raises:
            SourceError: none of its frames can be decoded.
        """
        self.recording = recording
        self._fps = fps
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
                f"none of the {len(recording)} frames of {str(recording.path)!r} can be decoded: record again"
            )
        self.height_px, self.width_px = int(first[0]), int(first[1])

    @property
    def name(self) -> str:
        sensor = self.recording.rig_sensor
        return self.recording.path.stem if sensor is None else f"{self.recording.path.stem}-{sensor}"

    @property
    def fps(self) -> float | None:
        """As given, else from the median step between frames, so that gaps do not count."""
        if self._fps is not None:
            return self._fps
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
    def capabilities(self) -> Capabilities:
        return Capabilities(
            seek=self,
            sensor=self.recording.sensor,
            files=(self.recording.path,),
            started_unix_ns=self.recording.started_unix_ns if self._fps is None else None,
        )

    @property
    def method(self) -> str:
        """Method of the stored readings."""
        return str(self.recording.about["method"])

    @property
    def warning(self) -> str | None:
        """A sentence about a file that is not whole, or None."""
        return self.recording.damage

    def __len__(self) -> int:
        return len(self.recording)

    def timestamp_ns(self, place: int) -> int:
        """Stored timestamp of the frame at a place."""
        return self.recording.timestamp_ns(place)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(place) for place in range(len(self.recording)))

    def frame(self, place: int) -> Frame:
        """The frame at a place, decoded."""
        frame = decoded(self.recording.frame(place), is_colour=self.is_colour)
        return frame if self._fps is None else replace(frame, timestamp_ns=evenly_timed_ns(place, self._fps))

    def reading(self, place: int) -> Reading | None:
        """The stored reading of the frame at a place; None when there is none."""
        return self.recording.reading(self.frame(place)) if self.recording.has_reading(place) else None

    def stored_reading(self, frame_index: int) -> Reading | None:
        """The stored reading of a frame by its number, without image; None when there is none."""
        bare = Frame(index=frame_index, timestamp_ns=0, camera="", image=None)
        return self.recording.reading(bare)


def replay_source(path: Path, fps: float | None = None, sensor: str | None = None) -> ReplaySource:
    """A recording as a source; of a rig, one of its sensors.

    Raises:
        SourceError: it is not a recording, or none of its frames can be decoded.
        MissingExtraError: the packages for recordings are not installed.
    """
    return ReplaySource(Recording(path, sensor), fps)
