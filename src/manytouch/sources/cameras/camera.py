"""A camera or a stream as a source: frames as they come, for as long as they come."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from urllib.parse import urlsplit

from manytouch.errors import SourceError
from manytouch.sources.cameras.capture import CameraRequest, Capture, Shot, open_camera
from manytouch.sources.cameras.stream import open_stream
from manytouch.sources.encoded import decoded
from manytouch.values import Frame, Setting

WAITING = 3  # frames; the oldest makes room for a new one
RETRY_S = 0.5
FIRST_TRIES = 20  # cameras may need some pictures before one is whole
FAILURES = 3  # in a row, after which the camera counts as lost
CLOSE_S = 3.0
CLOCKS_APART_NS = 10**9


class CameraSource:
    """Frames of a camera, read in a thread of its own.

    At most `WAITING` frames wait; a frame that is not fetched in time makes room for a newer one, and its
    number is missing. While the camera is away `status` says so and it is tried again and again; then
    numbers go on where they were, and timestamps show the gap.

    Attributes:
        is_colour: decode in colour; grey takes a third of the time, and is all that most sheets need.
    """

    def __init__(self, text: str, open_capture: Callable[[], Capture | None]) -> None:
        """Open it and take a first picture.

        Args:
            text: what the camera is called.
            open_capture: opens it, and opens it again after it was lost.

        Raises:
            SourceError: it does not open, or gives no picture.
        """
        self._text = text
        self._open = open_capture
        self._index = 0
        capture = open_capture()
        if capture is None:
            raise SourceError(_not_opened(text))
        first = next((shot for _ in range(FIRST_TRIES) if (shot := capture.read()) is not None), None)
        picture = None if first is None else decoded(self._frame(first, 0, 0), is_colour=False).image
        if picture is None:
            capture.release()
            raise SourceError(
                f"The camera {without_password(text)!r} opens but gives no picture: try another size or "
                "--no-mjpg, another cable or port, and see that no other program uses it."
            )
        self._capture: Capture | None = capture
        self.height_px, self.width_px = map(int, picture.shape[:2])
        self.settings: tuple[Setting, ...] = capture.settings
        self.is_colour = False
        self.status = "ok"
        self._tap: Callable[[Frame], None] | None = None
        self._arrival = threading.Condition()
        self._waiting: deque[Frame] = deque(maxlen=WAITING)
        self._is_over = threading.Event()
        self._thread: threading.Thread | None = None
        self._clock = ArrivalClock()

    @property
    def name(self) -> str:
        """camera-0, or the host of a stream."""
        if "://" in self._text:
            return f"stream-{urlsplit(self._text).hostname or 'local'}"
        return f"camera-{self._text.rpartition('/')[2]}"

    @property
    def fps(self) -> float | None:
        """As the camera says."""
        rate = next((setting.found for setting in self.settings if setting.name == "rate"), None)
        return None if rate is None else float(rate.split()[0])

    @property
    def frame_count(self) -> int | None:
        return None

    @property
    def is_live(self) -> bool:
        return True

    def listen(self, tap: Callable[[Frame], None] | None) -> None:
        """Hand every frame to `tap` as it arrives, in the camera's thread, before any may be dropped."""
        self._tap = tap

    def __iter__(self) -> Iterator[Frame]:
        """Frames from now on, decoded in the thread that takes them, until `close`."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="manytouch-camera", daemon=True)
            self._thread.start()
        while (frame := self._next()) is not None:
            yield decoded(frame, is_colour=self.is_colour)

    def close(self) -> None:
        """Let go of the camera; iterations end."""
        self._is_over.set()
        with self._arrival:
            self._arrival.notify_all()
        if self._thread is not None:
            self._thread.join(timeout=CLOSE_S)
        elif self._capture is not None:
            self._capture.release()

    def _next(self) -> Frame | None:
        with self._arrival:
            self._arrival.wait_for(lambda: self._waiting or self._is_over.is_set())
            return None if self._is_over.is_set() else self._waiting.popleft()

    def _run(self) -> None:
        failures = 0
        while not self._is_over.is_set():
            shot = None if self._capture is None else self._capture.read()
            if shot is not None:
                failures = 0
                self.status = "ok"
                self._arrived(shot)
                continue
            failures += 1
            if failures >= FAILURES:
                self._lost()
                self._is_over.wait(RETRY_S)
                self._capture = None if self._is_over.is_set() else self._again()
                failures = FAILURES if self._capture is None else 0
        if self._capture is not None:
            self._capture.release()

    def _lost(self) -> None:
        if self._capture is not None:
            self.status = f"no picture from {self.name} any more; it is tried again every {RETRY_S:g} s"
            self._capture.release()
            self._capture = None

    def _again(self) -> Capture | None:
        """The camera, when it is back and gives pictures of the size it had."""
        capture = self._open()
        shot = None if capture is None else capture.read()
        if capture is None or shot is None:
            if capture is not None:
                capture.release()
            return None
        image = decoded(self._frame(shot, 0, 0), is_colour=False).image
        if image is None or image.shape[:2] != (self.height_px, self.width_px):
            found = "none that can be decoded" if image is None else f"{image.shape[1]} x {image.shape[0]} px"
            self.status = (
                f"{self.name} is back with other pictures: {self.width_px} x {self.height_px} px were "
                f"expected, found {found}; set the size again or start anew"
            )
            capture.release()
            return None
        self.settings = capture.settings
        self.status = "ok"
        self._clock.tie_anew()
        self._arrived(shot)
        return capture

    def _arrived(self, shot: Shot) -> None:
        arrived_ns = time.monotonic_ns()
        frame = self._frame(shot, self._clock.at(shot.driver_ns, arrived_ns), arrived_ns)
        self._index += 1
        tap = self._tap
        if tap is not None:
            tap(frame)
        with self._arrival:
            self._waiting.append(frame)
            self._arrival.notify()

    def _frame(self, shot: Shot, timestamp_ns: int, arrived_ns: int) -> Frame:
        return Frame(
            index=self._index,
            timestamp_ns=timestamp_ns,
            camera=self.name,
            image=shot.image,
            encoded=shot.encoded,
            arrived_ns=arrived_ns,
        )


class ArrivalClock:
    """Timestamps from 0: the driver's while it makes sense, this machine's otherwise.

    A driver's time makes sense while it grows and does not part from this machine's by more than a second;
    after a gap or a jump it is tied to this machine's anew.
    """

    def __init__(self) -> None:
        self._first_arrived_ns: int | None = None
        self._offset_ns: int | None = None
        self._last_ns = -1

    def tie_anew(self) -> None:
        """The driver's time may have begun again."""
        self._offset_ns = None

    def at(self, driver_ns: int | None, arrived_ns: int) -> int:
        """Timestamp of a picture."""
        if self._first_arrived_ns is None:
            self._first_arrived_ns = arrived_ns
        own_ns = arrived_ns - self._first_arrived_ns
        told_ns = own_ns
        if driver_ns is None:
            self._offset_ns = None
        else:
            if self._offset_ns is None or abs(driver_ns - self._offset_ns - own_ns) > CLOCKS_APART_NS:
                self._offset_ns = driver_ns - own_ns
            told_ns = driver_ns - self._offset_ns
        self._last_ns = max(told_ns, self._last_ns + 1)
        return self._last_ns


def camera_source(text: str, wishes: CameraRequest | None = None) -> CameraSource:
    """A camera by number or device, or a stream by address.

    Raises:
        SourceError: it does not open, or gives no picture.
    """
    asked = CameraRequest() if wishes is None else wishes
    if "://" in text:
        return CameraSource(text, lambda: open_stream(text))
    number_or_path = int(text) if text.isdigit() else text
    return CameraSource(text, lambda: open_camera(number_or_path, asked))


def without_password(text: str) -> str:
    """An address as it may be shown and written down; any other text as it is."""
    if "://" not in text:
        return text
    parts = urlsplit(text)
    return parts._replace(netloc=parts.netloc.rpartition("@")[2]).geturl()


def _not_opened(text: str) -> str:
    shown = without_password(text)
    if "://" in text:
        return f"The stream {shown!r} does not open: check the address, and that a browser or VLC shows it."
    return (
        f"The camera {shown!r} does not open: check that it is plugged in, that no other program uses it and "
        "that this user may use it (on Linux: member of the group video); manytouch doctor lists the cameras."
    )
