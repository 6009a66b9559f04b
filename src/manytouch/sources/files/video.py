"""Video files, read with OpenCV."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.limits import size_mistake
from manytouch.sources.files.containers import Container, read_container
from manytouch.sources.predicting_codecs import predicts_pictures
from manytouch.sources.quiet_opencv import cv2
from manytouch.sources.source import ASSUMED_FPS, Capabilities, evenly_timed_ns
from manytouch.values import Frame
from manytouch.values.arrays import read_only

VIDEO_SUFFIXES = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".wmv", ".ts")
MOST_FRAMES = 1_000_000  # a larger number in a header is ignored
FIRST_READS = 100  # in which a frame must be decoded: 3 s at 30 per second, by choice; a start may be damaged
INEXACT_FRAMES, INEXACT_SHARE = 2, 0.01
"""How many more frames than it has an intact AVI may announce, at least and as a share: a choice. Larger ones
hide lost frames at the end of a file, smaller ones add frames without image to intact files."""
MOST_FAILURES = 1_000  # failed reads in a row after which a file counts as ended
LONGEST_PAUSE_NS = 60 * 10**9  # a larger step of the container's clock counts as its error


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class VideoSource:
    """A video file; each iteration opens it again.

    Timestamps are the container's own, from 0, unless the rate is given. Frames that a damaged file
    has lost follow as frames without an image, as far as the file states that there were such frames.

    Attributes:
        name: stem for the folder of its results.
        path: the file.
        fps: rate in frames per second; None when the file states none.
        is_rate_given: timestamps follow `fps` instead of the container.
        frame_count: frames that the file announces; None when it announces none.
        width_px, height_px: size of its first frame.
        is_predicted: of its frames.
    """

    name: str
    path: Path
    fps: float | None
    is_rate_given: bool
    frame_count: int | None
    width_px: int
    height_px: int
    is_predicted: bool

    @property
    def is_live(self) -> bool:
        return False

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(files=(self.path,))

    def __iter__(self) -> Iterator[Frame]:
        container = read_container(self.path)  # first: the file may be moved while it is read
        capture = _opened(self.path)
        clock = _Clock(fps=self.fps, follows_container=not self.is_rate_given)
        index = failures = all_failures = 0
        try:
            while failures <= self._failures_allowed(index):
                if not capture.grab():
                    failures += 1
                    continue
                container_ns = _position_ns(capture)
                if failures:
                    for _ in range(self._lost_before(index, failures, clock.periods_until(container_ns))):
                        yield self._frame(index, clock.missed(), None)
                        index += 1
                    all_failures += failures
                    failures = 0
                decoded, image = capture.retrieve()
                fits = decoded and image is not None and image.shape[:2] == (self.height_px, self.width_px)
                yield self._frame(index, clock.at(container_ns), read_only(image) if fits else None)
                index += 1
        finally:
            capture.release()
        for _ in range(frames_lost(self.frame_count, index, all_failures, container)):
            yield self._frame(index, clock.missed(), None)
            index += 1

    def _frame(self, index: int, timestamp_ns: int, image: object) -> Frame:
        return Frame(
            index=index,
            timestamp_ns=timestamp_ns,
            camera=self.name,
            image=image,  # type: ignore[arg-type]
            is_predicted=self.is_predicted,
        )

    def _failures_allowed(self, index: int) -> int:
        """How many reads in a row may fail: a decoder fails on every packet of a damaged stretch."""
        return 0 if self.frame_count is None else min(max(self.frame_count - index, 0), MOST_FAILURES)

    def _lost_before(self, index: int, failures: int, periods: int) -> int:
        """Frames that a damaged stretch has cost: by the clock, else by the packets that failed."""
        lost = periods - 1 if periods > 1 else failures
        return lost if self.frame_count is None else max(min(lost, self.frame_count - index - 1), 0)


class _Clock:
    """Timestamps of one iteration over a file: the container's while they are plausible."""

    def __init__(self, *, fps: float | None, follows_container: bool) -> None:
        self._fps = fps
        self._follows = follows_container
        self._period_ns = round(1e9 / (fps or ASSUMED_FPS))
        self._first_ns: int | None = None
        self._last_ns = -self._period_ns
        self._count = 0

    def at(self, container_ns: int | None) -> int:
        """Timestamp of a frame that was decoded."""
        if self._first_ns is None and container_ns is not None:
            self._first_ns = container_ns - self._last_ns - self._period_ns
        if not self._follows or container_ns is None or self._first_ns is None:
            return self.missed()
        step_ns = container_ns - self._first_ns - self._last_ns
        if not 0 < step_ns <= LONGEST_PAUSE_NS:
            return self.missed()
        self._count += 1
        self._last_ns += step_ns
        return self._last_ns

    def missed(self) -> int:
        """Timestamp of a frame that has none: one period after the last."""
        self._count += 1
        if not self._follows:
            self._last_ns = evenly_timed_ns(self._count - 1, self._fps)
        else:
            self._last_ns += self._period_ns
        return self._last_ns

    def periods_until(self, container_ns: int | None) -> int:
        """Frame periods from the last frame to this time of the container; 0 when not known."""
        if container_ns is None or self._first_ns is None or not self._follows:
            return 0
        return max(round((container_ns - self._first_ns - self._last_ns) / self._period_ns), 0)


def frames_lost(announced: int | None, delivered: int, failures: int, container: Container) -> int:
    """Frames that a file has lost at an unknown place.

    The announced number counts only where it is exact: not for containers that state a duration alone,
    nor for an MP4 whose edit list leaves frames out. An intact AVI may be off by a few.
    """
    if announced is None or container.kind == "other":
        return 0
    lost = max(announced - delivered, 0)
    if container.is_cut_short or failures:
        return lost
    return lost if container.kind == "riff" and lost > max(INEXACT_FRAMES, INEXACT_SHARE * announced) else 0


def video_source(path: Path, fps: float | None) -> VideoSource:
    """A video file as a source.

    Raises:
        SourceError: it cannot be decoded.
    """
    if read_container(path).is_cut_short and not _opened(path).isOpened():
        raise SourceError(
            f"{str(path)!r} is cut short: it ends before the index without which its frames cannot be found; "
            f"copy or record it again."
        )
    error = SourceError(
        f"{str(path)!r} cannot be decoded as a video or an image: check that it is complete and of a "
        f"common kind ({', '.join(suffix[1:] for suffix in VIDEO_SUFFIXES)}), or convert it to MP4."
    )
    if _is_text(path):
        raise error
    capture = _opened(path)
    try:
        sides = [capture.get(side) for side in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
        mistake = size_mistake(*(int(side) if math.isfinite(side) else 0 for side in sides))
        if mistake is not None:
            raise SourceError(f"the frames of {str(path)!r} are too large: {mistake}.")
        image = next(
            (image for decoded, image in (capture.read() for _ in range(FIRST_READS)) if decoded), None
        )
        if image is None:
            raise error
        rate = capture.get(cv2.CAP_PROP_FPS)
        announced = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        is_predicted = predicts_pictures(capture.get(cv2.CAP_PROP_FOURCC))
    finally:
        capture.release()
    return VideoSource(
        name=path.stem,
        path=path,
        fps=fps or (rate if math.isfinite(rate) and 0 < rate <= 10_000 else None),
        is_rate_given=fps is not None,
        frame_count=int(announced) if math.isfinite(announced) and 0 < announced <= MOST_FRAMES else None,
        width_px=image.shape[1],
        height_px=image.shape[0],
        is_predicted=is_predicted,
    )


def _opened(path: Path) -> "cv2.VideoCapture":
    """Open with FFmpeg: others print, and may read a name with digits as a sequence of images."""
    has_ffmpeg = cv2.CAP_FFMPEG in cv2.videoio_registry.getBackends()
    return cv2.VideoCapture(str(path), cv2.CAP_FFMPEG if has_ffmpeg else cv2.CAP_ANY)


def _position_ns(capture: "cv2.VideoCapture") -> int | None:
    milliseconds = capture.get(cv2.CAP_PROP_POS_MSEC)
    return round(milliseconds * 1e6) if math.isfinite(milliseconds) else None


def _is_text(path: Path) -> bool:
    """Whether it is a text file, which FFmpeg would decode as a video of a terminal."""
    with path.open("rb") as file:
        head = file.read(4096)
    return not any(byte < 9 or 13 < byte < 27 for byte in head)
