"""A camera or a stream as a source of frames, until it is closed."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from urllib.parse import urlsplit

from manytouch.errors import SourceError, without_password
from manytouch.sources.cameras.capture import CameraRequest, Capture, CapturedImage, open_camera
from manytouch.sources.cameras.refusal import refusal_of, unreachable
from manytouch.sources.cameras.stream import open_stream
from manytouch.sources.encoded import decoded
from manytouch.sources.source import Capabilities
from manytouch.values import Frame, Setting
from manytouch.values.arrays import Image

WAITING = 3  # frames; a new one replaces the oldest
RETRY_S = 0.5
FIRST_TRIES = 20  # the first images of a camera may be incomplete
FAILURES = 3  # in a row, after which the camera counts as disconnected
CLOSE_S = 3.0
SILENT_S = 3.0  # without an image, after which the status states it
CLOCKS_APART_NS = 10**9


class CameraSource:
    """Frames of a camera, read in a thread of its own.

    At most `WAITING` frames wait; a newer frame replaces the oldest, whose index is then missing. While the
    camera is disconnected `status` states it and opening is tried repeatedly; afterwards indices continue,
    and timestamps show the gap.

    Attributes:
        is_colour: decode in colour; grey takes a third of the time and is sufficient for most sheets.
    """

    def __init__(self, text: str, open_capture: Callable[[], Capture | None]) -> None:
        """Open it and read a first image.

        Args:
            text: number, device or address of the camera.
            open_capture: opens it, also after it was disconnected.

        Raises:
            SourceError: it does not open, or gives no image.
        """
        self._text = text
        self._open = open_capture
        self._index = 0
        capture = open_capture()
        if capture is None:
            raise SourceError(_not_opened(text))
        picture = next(
            (image for _ in range(FIRST_TRIES) if (image := self._image(capture)) is not None), None
        )
        if picture is None:
            capture.release()
            raise SourceError(_without_image(text))
        self._capture: Capture | None = capture
        self.height_px, self.width_px = map(int, picture.shape[:2])
        self.settings: tuple[Setting, ...] = capture.settings
        self.is_colour = False
        self._status = "ok"
        self._has_other_size = False
        self._arrived_ns: int | None = None
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
    def status(self) -> str:
        """ "ok", or a sentence on what is wrong: disconnected, silent, or with images of another size."""
        if self._status != "ok" or self._arrived_ns is None:
            return self._status
        silent_s = (time.monotonic_ns() - self._arrived_ns) * 1e-9
        return "ok" if silent_s < SILENT_S else f"no image from {self.name} for {silent_s:.0f} s"

    @property
    def fps(self) -> float | None:
        """As the camera reports."""
        rate = next((setting.found for setting in self.settings if setting.name == "rate"), None)
        return None if rate is None else float(rate.split()[0])

    @property
    def frame_count(self) -> int | None:
        return None

    @property
    def is_live(self) -> bool:
        return True

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(device=self)

    def listen(self, tap: Callable[[Frame], None] | None) -> None:
        """Pass every frame to `tap` as it arrives, in the camera's thread, before any may be dropped."""
        self._tap = tap

    def __iter__(self) -> Iterator[Frame]:
        """Frames from now on, decoded in the thread that takes them, until `close`."""
        if self._thread is None:
            self._arrived_ns = time.monotonic_ns()  # a silence counts from here
            self._thread = threading.Thread(target=self._run, name="manytouch-camera", daemon=True)
            self._thread.start()
        while (frame := self._next()) is not None:
            yield self._of_first_size(decoded(frame, is_colour=self.is_colour))

    def close(self) -> None:
        """Release the camera; iterations end."""
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
                if not self._has_other_size:
                    self._status = "ok"
                self._append(shot)
                continue
            failures += 1
            if failures >= FAILURES:
                self._disconnect()
                self._is_over.wait(RETRY_S)
                self._capture = None if self._is_over.is_set() else self._reopen()
                failures = FAILURES if self._capture is None else 0
        if self._capture is not None:
            self._capture.release()

    def _of_first_size(self, frame: Frame) -> Frame:
        """The frame, without its image if that is not of the size of the first one."""
        image = frame.image
        if image is None or image.shape[:2] == (self.height_px, self.width_px):
            if image is not None and self._has_other_size:
                self._has_other_size, self._status = False, "ok"
            return frame
        self._has_other_size = True
        self._status = (
            f"{self.name} changed its images from {self.width_px} x {self.height_px} px to "
            f"{image.shape[1]} x {image.shape[0]} px; set the size again or restart"
        )
        return replace(frame, image=None, encoded=None)

    def _disconnect(self) -> None:
        if self._capture is not None:
            self._status = (
                f"no image from {self.name} since it was disconnected; retrying every {RETRY_S:g} s"
            )
            self._capture.release()
            self._capture = None

    def _reopen(self) -> Capture | None:
        """Open the camera again; None unless it gives images of the size before."""
        capture = self._open()
        shot = None if capture is None else capture.read()
        if capture is None or shot is None:
            if capture is not None:
                capture.release()
            return None
        image = decoded(self._frame(shot, 0, 0), is_colour=False).image
        if image is None or image.shape[:2] != (self.height_px, self.width_px):
            found = "none that can be decoded" if image is None else f"{image.shape[1]} x {image.shape[0]} px"
            self._status = (
                f"{self.name} is connected again with other images: expected {self.width_px} x "
                f"{self.height_px} px, found {found}; set the size again or restart"
            )
            capture.release()
            return None
        self.settings = capture.settings
        self._status = "ok"
        self._clock.synchronise()
        self._append(shot)
        return capture

    def _image(self, capture: Capture) -> Image | None:
        """The next image, decoded; None when none came or it cannot be decoded."""
        shot = capture.read()
        return None if shot is None else decoded(self._frame(shot, 0, 0), is_colour=False).image

    def _append(self, shot: CapturedImage) -> None:
        arrived_ns = self._arrived_ns = time.monotonic_ns()
        frame = self._frame(shot, self._clock.at(shot.driver_ns, arrived_ns), arrived_ns)
        self._index += 1
        tap = self._tap
        if tap is not None:
            tap(frame)
        with self._arrival:
            self._waiting.append(frame)
            self._arrival.notify()

    def _frame(self, shot: CapturedImage, timestamp_ns: int, arrived_ns: int) -> Frame:
        return Frame(
            index=self._index,
            timestamp_ns=timestamp_ns,
            camera=self.name,
            image=shot.image,
            encoded=shot.encoded,
            arrived_ns=arrived_ns,
            is_predicted=shot.is_predicted,
        )


class ArrivalClock:
    """Timestamps from 0: the driver's while plausible, otherwise this machine's.

    A driver's time is plausible while it increases and differs from this machine's by less than a second;
    after a gap or a jump it is synchronised again with this machine's.
    """

    def __init__(self) -> None:
        self._first_arrived_ns: int | None = None
        self._offset_ns: int | None = None
        self._last_ns = -1

    def synchronise(self) -> None:
        """Synchronise with the next image, since the driver's time may have restarted."""
        self._offset_ns = None

    def at(self, driver_ns: int | None, arrived_ns: int) -> int:
        """Timestamp of an image, from its driver's time or None and its arrival by `time.monotonic_ns`."""
        if self._first_arrived_ns is None:
            self._first_arrived_ns = arrived_ns
        own_ns = arrived_ns - self._first_arrived_ns
        timestamp_ns = own_ns
        if driver_ns is None:
            self._offset_ns = None
        else:
            if self._offset_ns is None or abs(driver_ns - self._offset_ns - own_ns) > CLOCKS_APART_NS:
                self._offset_ns = driver_ns - own_ns
            timestamp_ns = driver_ns - self._offset_ns
        self._last_ns = max(timestamp_ns, self._last_ns + 1)
        return self._last_ns


def camera_source(text: str, request: CameraRequest | None = None) -> CameraSource:
    """A camera by number or device, or a stream by address.

    Raises:
        SourceError: it does not open, or gives no image.
    """
    wanted = CameraRequest() if request is None else request
    if "://" in text:
        return CameraSource(text, lambda: open_stream(text))
    number_or_path = int(text) if text.isdigit() else text
    return CameraSource(text, lambda: open_camera(number_or_path, wanted))


def _not_opened(text: str) -> str:
    shown = without_password(text)
    if "://" in text:
        refusal = unreachable(text) or refusal_of(text)
        reason = f" ({refusal})" if refusal else ""
        remedy = "check the address, and that a browser or VLC shows it"
        return f"The stream {shown!r} does not open{reason}: {remedy}."
    return (
        f"The camera {shown!r} does not open: check that it is connected, that no other program uses it and "
        "that this user may use it (on Linux: member of the group video); manytouch doctor lists the cameras."
    )


def _without_image(text: str) -> str:
    shown = without_password(text)
    if "://" in text:
        return (
            f"The stream {shown!r} opens but gives no image that can be decoded: check that a browser or VLC "
            "shows it, and that its server has a camera."
        )
    return (
        f"The camera {shown!r} opens but gives no image: try another size or --no-mjpg, another cable or "
        "port, and close other programs that use it."
    )
