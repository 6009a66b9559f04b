"""The simulated sensor that people press while it runs."""

from collections.abc import Iterator
from itertools import count, islice

from manytouch.errors import SourceError
from manytouch.simulation.hands import Hands
from manytouch.simulation.scene import SCENES
from manytouch.simulation.sensor import demo_sensor
from manytouch.simulation.simulator import Simulator
from manytouch.sources.simulated import WIDTH_PX
from manytouch.sources.source import ASSUMED_FPS
from manytouch.values import Frame, Press, Release, Sensor, Truth


class PressedSource:
    """Pictures of a simulated sensor under hands, and the truth about the latest of them.

    Time goes on with the frames that are taken. All frames of one instance are one story: a second
    iterator goes on where the first one is.
    """

    def __init__(self, sensor: Sensor, hands: Hands, *, seconds: float | None = None) -> None:
        """Args: sensor; hands: what presses it; seconds: how long it lasts, None without end."""
        self._hands = hands
        self._simulator = Simulator(sensor=sensor, scene=hands, fps=hands.fps)
        self._length = None if seconds is None else round(seconds * hands.fps)
        self._latest_truth: Truth | None = None
        self._indices = count()

    @property
    def name(self) -> str:
        return f"sim-{self._hands.name}"

    @property
    def fps(self) -> float:
        return self._hands.fps

    @property
    def frame_count(self) -> int | None:
        return self._length

    @property
    def width_px(self) -> int:
        return self.sensor.camera.width_px

    @property
    def height_px(self) -> int:
        return self.sensor.camera.height_px

    @property
    def is_live(self) -> bool:
        return False

    @property
    def sensor(self) -> Sensor:
        """The true sensor."""
        return self._simulator.sensor

    def __iter__(self) -> Iterator[Frame]:
        for index in islice(self._indices, self._length):
            self._hands.step(index)
            yield self._simulator.frame(index)

    def press(self, command: Press | Release) -> None:
        """Put a finger on the sheet, move it, or lift it; from the next frame on."""
        self._hands.obey(command)

    def truth(self, index: int) -> Truth | None:
        """What really happens in one of the latest frames; None of others."""
        latest = self._latest_truth
        if latest is None or latest.frame_index != index:
            latest = self._simulator.truth(index) if self._hands.is_remembered(index) else None
            self._latest_truth = latest
        return latest


def pressed_source(scene: str = "", *, seconds: float | None = None, seed: int = 0) -> PressedSource:
    """The demo sensor to be pressed, under a scene of that name where nobody does.

    Raises:
        SourceError: there is no such scene.
    """
    name = scene or "fingers"
    if name not in SCENES:
        raise SourceError(f"there is no simulated scene {name!r}; there are: {', '.join(SCENES)}")
    sensor = demo_sensor(WIDTH_PX)
    assert sensor.sheet is not None
    return PressedSource(sensor, Hands(SCENES[name](seed), sensor.sheet, ASSUMED_FPS), seconds=seconds)
