"""The simulated sensor as a source."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.simulation.scene.deformation import Deformation
from manytouch.simulation.scene.file import BUILT_IN, SceneFile, built_in_scenes, load_scene
from manytouch.simulation.simulator import Simulator
from manytouch.simulation.solve_scene import simulator, solve_scene, states_folder
from manytouch.simulation.views import ViewsSimulator
from manytouch.sources.source import Capabilities
from manytouch.values import Frame, Sensor, Truth

WIDTH_PX = 1280  # rendering a frame then takes less than a frame period


class Simulated:
    """Properties that all sources of a simulated sensor share.

    Attributes:
        simulator: the sensor, the scene and the rendering.
    """

    __slots__ = ()

    simulator: Simulator | ViewsSimulator

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
    """Rendered frames of a simulated sensor under a solved scene, with their ground truth."""

    simulator: Simulator | ViewsSimulator

    @property
    def frame_count(self) -> int:
        return self.simulator.frame_count

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(truth=self.truth, sensor=self.sensor)

    def __iter__(self) -> Iterator[Frame]:
        return (self.simulator.frame(index) for index in range(self.frame_count))

    def truth(self, index: int) -> Truth:
        """Ground truth of a frame."""
        return self.simulator.truth(index)

    def lasting(self, seconds: float) -> "SimulatedSource":
        """The same source, cut or repeated to a number of seconds.

        Raises:
            SourceError: they are shorter than a frame.
        """
        scene = self.simulator.scene.with_duration(seconds)
        source = SimulatedSource(simulator=replace(self.simulator, scene=scene))
        if source.frame_count == 0:
            raise SourceError(
                f"{seconds:g} s of the sensor contain no frame: give {1.0 / source.fps:.2g} s or more"
            )
        return source


def simulated_source(
    scene: str = "",
    *,
    fps: float | None = None,
    seed: int | None = None,
    width_px: int = WIDTH_PX,
) -> SimulatedSource:
    """The simulated sensor under a scene.

    Args:
        scene: the name of a built-in scene, or the path of a scene file; `fingers` when empty.
        fps: frames per second instead of the scene's.
        seed: of the noise instead of the scene's.
        width_px: of the frames of a built-in scene.

    Raises:
        SourceError: the scene does not exist, or its file is invalid.
    """
    file, states = load_solved_scene(scene, width_px)
    file = replace(file, fps=fps or file.fps, seed=file.seed if seed is None else seed)
    return SimulatedSource(simulator=simulator(file, states))


def load_solved_scene(scene: str = "", width_px: int = WIDTH_PX) -> tuple[SceneFile, tuple[Deformation, ...]]:
    """A scene file and its solved states; arguments and errors as for `simulated_source`."""
    name = scene or "fingers"
    if name.endswith(".toml"):
        file = load_scene(Path(name).expanduser())
    elif name in built_in_scenes():
        file = load_scene(BUILT_IN / f"{name}.toml", width_px=width_px)
    else:
        raise SourceError(
            f"The simulated scene {name!r} does not exist: use {', '.join(built_in_scenes())}, as in "
            "'sim:one'; or give the path of a scene file (.toml)."
        )
    return file, tuple(solve_scene(file, states_folder()))
