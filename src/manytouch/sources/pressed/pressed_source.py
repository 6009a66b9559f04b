"""The simulated sensor that is pressed interactively."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import count, islice

from manytouch.simulation.interactive_indenters import InteractiveIndenters
from manytouch.simulation.solve_scene import simulator, solid_scene
from manytouch.sources.simulated import WIDTH_PX, Simulated, load_solved_scene
from manytouch.sources.source import Capabilities
from manytouch.values import Frame, Press, Release, Truth


class PressedSource(Simulated):
    """Rendered frames of a simulated sensor that is pressed while it runs, with ground truth of the latest.

    Time advances with the frames that are taken. All iterators of one instance share its time: a second
    iterator continues where the first one is.
    """

    def __init__(self, scene: str = "", *, seconds: float | None = None, width_px: int = WIDTH_PX) -> None:
        """Prepare a scene; it is shown while nothing is pressed.

        Args:
            scene: as for `simulated_source`.
            seconds: duration; None without end.
            width_px: of the frames of a built-in scene.

        Raises:
            SourceError: the scene does not exist, or its file is invalid.
        """
        file, states = load_solved_scene(scene, width_px)
        pitch_mm = math.sqrt(math.prod(file.layout.pitch_mm))
        shown = solid_scene(file, states)
        self._indenters = InteractiveIndenters(shown, file.bodies, file.sheet, file.fps, pitch_mm)
        self.simulator = replace(simulator(file, states), scene=self._indenters)
        self._length = None if seconds is None else round(seconds * file.fps)
        self._latest_truth: Truth | None = None
        self._indices = count()

    @property
    def frame_count(self) -> int | None:
        return self._length

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(truth=self.truth, press=self.press, sensor=self.sensor)

    def __iter__(self) -> Iterator[Frame]:
        for index in islice(self._indices, self._length):
            self._indenters.step(index)
            yield self.simulator.frame(index)

    def press(self, command: Press | Release) -> None:
        """Put a finger on the sheet, move it, or lift it, from the next frame on."""
        self._indenters.apply(command)

    def truth(self, index: int) -> Truth | None:
        """Ground truth of one of the latest frames; None for others."""
        latest = self._latest_truth
        if latest is None or latest.frame_index != index:
            latest = self.simulator.truth(index) if self._indenters.is_available(index) else None
            self._latest_truth = latest
        return latest
