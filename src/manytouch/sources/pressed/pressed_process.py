"""The simulated sensor that is pressed interactively, in a process of its own (`pressed_worker`).

Solving the sheet and rendering its picture take about as long as estimating the contacts. In one process, the
threads of both would wait for each other's turns of the interpreter.
"""

import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace

from manytouch.child_process import ChildProcess, Refused, error_of
from manytouch.errors import SourceError
from manytouch.sources.source import Capabilities
from manytouch.values import Frame, Press, Release, Sensor, Truth

TRUTHS_KEPT = 60
"""Number of latest frames: 2 s, longer than a viewer takes to show one. Each has 0.1 MB with 600 markers."""
END_S = 2.0
PROCESS = "the process of the simulated sensor"


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneRequest:
    """The first message to the process; see `PressedProcess`."""

    scene: str
    seconds: float | None
    width_px: int | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Loaded:
    """Its answer, once the scene is loaded: the properties of the source."""

    name: str
    fps: float
    frame_count: int | None
    sensor: Sensor


@dataclass(frozen=True, slots=True, kw_only=True)
class NextFrame:
    """Requests a frame; presses are sent as they are."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NewFrame:
    """A frame and its ground truth without the layout; both None after the last frame."""

    frame: Frame | None = None
    truth: Truth | None = None


class PressedProcess:
    """A `PressedSource` in a process of its own, which runs until `close` or until this process ends."""

    def __init__(self, scene: str = "", *, seconds: float | None = None, width_px: int | None = None) -> None:
        """Start the process, and do not wait for it.

        Args:
            scene: as for `simulated_source`. Whether it exists is known when a property is read.
            seconds: duration; None without end.
            width_px: of the frames of a built-in scene; None: as for `simulated_source`.
        """
        self._turn, self._truths_turn = threading.Lock(), threading.Lock()
        self._truths: dict[int, Truth] = {}
        self._answer: object = None
        self._is_closed = False
        self._process = ChildProcess("manytouch.sources.pressed.worker")
        self._send(SceneRequest(scene=scene, seconds=seconds, width_px=width_px))

    @property
    def name(self) -> str:
        return self._loaded.name

    @property
    def fps(self) -> float:
        return self._loaded.fps

    @property
    def frame_count(self) -> int | None:
        return self._loaded.frame_count

    @property
    def width_px(self) -> int:
        return self._loaded.sensor.camera.width_px

    @property
    def height_px(self) -> int:
        return self._loaded.sensor.camera.height_px

    @property
    def is_live(self) -> bool:
        return False

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(truth=self.truth, press=self.press, sensor=self._loaded.sensor, close=self.close)

    def __iter__(self) -> Iterator[Frame]:
        """Frames, each made when it is taken; see `PressedSource` for several iterators.

        Raises:
            SourceError: the process has ended.
        """
        sensor = self._loaded.sensor
        while True:
            with self._turn:
                if self._is_closed:
                    return
                self._send(NextFrame())
                made = self._receive()
            assert isinstance(made, NewFrame)
            if made.frame is None:
                return
            if made.truth is not None:
                surface = replace(made.truth.surface, layout=sensor.layout)
                self._keep(replace(made.truth, surface=surface))
            yield made.frame

    def press(self, command: Press | Release) -> None:
        """Put a finger on the sheet, move it, or lift it, from the next frame on."""
        with self._turn:
            if not self._is_closed:
                self._send(command)

    def truth(self, index: int) -> Truth | None:
        """Ground truth of one of the latest frames; None for others."""
        with self._truths_turn:
            return self._truths.get(index)

    def close(self) -> None:
        """End the process; iterations over its frames end."""
        with self._turn:
            self._is_closed = True
            self._process.end(END_S)
            self._process.close()

    @property
    def _loaded(self) -> Loaded:
        """Waits until the process has loaded the scene.

        Raises:
            SourceError: the scene does not exist, or its file is invalid.
        """
        with self._turn:
            if self._answer is None:
                self._answer = self._receive()
        assert isinstance(self._answer, Loaded)
        return self._answer

    def _keep(self, truth: Truth) -> None:
        with self._truths_turn:
            self._truths[truth.frame_index] = truth
            self._truths.pop(truth.frame_index - TRUTHS_KEPT, None)

    def _send(self, value: object) -> None:
        try:
            self._process.send(value)
        except OSError:
            raise self._ended() from None

    def _receive(self) -> object:
        answer = self._process.receive()
        if answer is None:
            raise self._ended()
        if isinstance(answer, Refused):
            raise error_of(answer, PROCESS)
        return answer

    def _ended(self) -> SourceError:
        return SourceError(f"{PROCESS} has ended ({self._process.end(END_S)}): start again")
