"""Frames and readings of a recording, in order."""

from collections.abc import Iterator

from manytouch.recording.reader import Recording
from manytouch.values import Frame, Reading


def frames_of(recording: Recording) -> Iterator[tuple[Frame, Reading | None]]:
    """Each frame as it was recorded, with its reading, or None where there is none."""
    for place in range(len(recording)):
        frame = recording.frame(place)
        yield frame, recording.reading(frame)


def readings_of(recording: Recording) -> Iterator[Reading]:
    """The stored readings, without images."""
    return (reading for _, reading in frames_of(recording) if reading is not None)
