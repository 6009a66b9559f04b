"""The simulated sensor that people press while it runs."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import count, islice

from manytouch.simulation.scene.interactive_indenters import InteractiveIndenters
from manytouch.simulation.scene.solve import simulator, solid_scene
from manytouch.sources.simulated import Simulated, solved
from manytouch.values import Frame, Press, Release, Truth


class PressedSource(Simulated):
    """Pictures of a simulated sensor under hands, and the truth about the latest of them.

    Time goes on with the frames that are taken. All frames of one instance are one story: a second
    iterator goes on where the first one is.
    """

    def __init__(self, scene: str = "", *, seconds: float | None = None) -> None:
        """The sensor of a scene, to be pressed; where nobody does, the scene plays.

        Args:
            scene: as for `simulated_source`.
            seconds: how long it lasts, None without end.

        Raises:
            SourceError: there is no such scene, or its file is wrong.
        """
        said, states = solved(scene)
        self._hands = InteractiveIndenters(solid_scene(said, states), said.bodies, said.sheet, said.fps)
        self.simulator = replace(simulator(said, states), scene=self._hands)
        self._length = None if seconds is None else round(seconds * said.fps)
        self._latest_truth: Truth | None = None
        self._indices = count()

    @property
    def frame_count(self) -> int | None:
        return self._length

    def __iter__(self) -> Iterator[Frame]:
        for index in islice(self._indices, self._length):
            self._hands.step(index)
            yield self.simulator.frame(index)

    def press(self, command: Press | Release) -> None:
        """Put a finger on the sheet, move it, or lift it; from the next frame on."""
        self._hands.obey(command)

    def truth(self, index: int) -> Truth | None:
        """What really happens in one of the latest frames; None of others."""
        latest = self._latest_truth
        if latest is None or latest.frame_index != index:
            latest = self.simulator.truth(index) if self._hands.is_remembered(index) else None
            self._latest_truth = latest
        return latest
