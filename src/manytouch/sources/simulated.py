"""The simulated sensor as a source."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from manytouch.errors import SourceError
from manytouch.simulation.scene import SCENES
from manytouch.simulation.sensor import demo_sensor
from manytouch.simulation.simulator import Simulator
from manytouch.sources.source import ASSUMED_FPS
from manytouch.values import Frame, Sensor, Truth

WIDTH_PX = 1280  # of the demo sensor's camera, so that a picture takes less time than it shows


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SimulatedSource:
    """Pictures of a simulated sensor, and the truth about them.

    Attributes:
        simulator: the sensor, the scene and how it is looked at.
    """

    simulator: Simulator

    @property
    def name(self) -> str:
        return f"sim-{self.simulator.scene.name}"

    @property
    def fps(self) -> float:
        return self.simulator.fps

    @property
    def frame_count(self) -> int:
        return self.simulator.frame_count

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
        return self.simulator.sensor

    def __iter__(self) -> Iterator[Frame]:
        return (self.simulator.frame(index) for index in range(self.frame_count))

    def truth(self, index: int) -> Truth:
        """What really happens in a frame."""
        return self.simulator.truth(index)

    def lasting(self, seconds: float) -> "SimulatedSource":
        """The same source cut, or played again and again, to a number of seconds."""
        scene = self.simulator.scene.lasting(seconds)
        return SimulatedSource(simulator=replace(self.simulator, scene=scene))


def simulated_source(scene: str = "", *, fps: float | None = None, seed: int = 0) -> SimulatedSource:
    """The demo sensor under a scene of that name; `fingers` where none is given."""
    name = scene or "fingers"
    if name not in SCENES:
        raise SourceError(
            f"There is no simulated scene {name!r}: there are {', '.join(SCENES)}, as in 'sim:one'."
        )
    return SimulatedSource(
        simulator=Simulator(sensor=demo_sensor(WIDTH_PX), scene=SCENES[name](seed), fps=fps or ASSUMED_FPS)
    )
