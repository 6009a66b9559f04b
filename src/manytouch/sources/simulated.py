"""The simulated sensor as a source."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.simulation.scene.deformation import Deformation
from manytouch.simulation.scene.file import BUILT_IN, SceneFile, built_in_scenes, load_scene
from manytouch.simulation.scene.solve import simulator, solve_scene, states_folder
from manytouch.simulation.simulator import Simulator
from manytouch.values import Frame, Sensor, Truth

WIDTH_PX = 1280  # of the demo sensor's camera, so that a picture takes less time than it shows


class Simulated:
    """What all sources of a simulated sensor say of themselves.

    Attributes:
        simulator: the sensor, the scene and how it is looked at.
    """

    __slots__ = ()

    simulator: Simulator

    @property
    def name(self) -> str:
        return f"sim-{self.simulator.scene.name}"

    @property
    def fps(self) -> float:
        return self.simulator.fps

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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SimulatedSource(Simulated):
    """Pictures of a simulated sensor under a solved scene, and the truth about them."""

    simulator: Simulator

    @property
    def frame_count(self) -> int:
        return self.simulator.frame_count

    def __iter__(self) -> Iterator[Frame]:
        return (self.simulator.frame(index) for index in range(self.frame_count))

    def truth(self, index: int) -> Truth:
        """What really happens in a frame."""
        return self.simulator.truth(index)

    def lasting(self, seconds: float) -> "SimulatedSource":
        """The same source cut, or played again and again, to a number of seconds."""
        scene = self.simulator.scene.with_duration(seconds)
        return SimulatedSource(simulator=replace(self.simulator, scene=scene))


def simulated_source(
    scene: str = "",
    *,
    fps: float | None = None,
    seed: int | None = None,
    width_px: int = WIDTH_PX,
) -> SimulatedSource:
    """The simulated sensor under a scene: one that the package has solved, or a file of one's own.

    Args:
        scene: the name of a built-in scene, or the path of a scene file; `fingers` where none is given.
        fps: frames per second instead of the scene's.
        seed: of the noise instead of the scene's.
        width_px: of the pictures of a built-in scene.

    Raises:
        SourceError: there is no such scene, or its file is wrong.
    """
    said, states = solved(scene, width_px)
    said = replace(said, fps=fps or said.fps, seed=said.seed if seed is None else seed)
    return SimulatedSource(simulator=simulator(said, states))


def solved(scene: str = "", width_px: int = WIDTH_PX) -> tuple[SceneFile, tuple[Deformation, ...]]:
    """A scene and its states; as for `simulated_source`."""
    name = scene or "fingers"
    if name.endswith(".toml"):
        said = load_scene(Path(name).expanduser())
    elif name in built_in_scenes():
        said = load_scene(BUILT_IN / f"{name}.toml", width_px=width_px)
    else:
        raise SourceError(
            f"There is no simulated scene {name!r}: there are {', '.join(built_in_scenes())}, as in "
            "'sim:one'; or give the path of a scene file (.toml)."
        )
    return said, tuple(solve_scene(said, states_folder()))
