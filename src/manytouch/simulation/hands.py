"""Fingers of people on the simulated sheet, and the scene that plays while nobody presses."""

import threading
from dataclasses import dataclass

import numpy as np

from manytouch.simulation.plate import PatchLoad, clamped_plate
from manytouch.simulation.scene import Scene
from manytouch.values import Press, Release, Sheet

FINGER_RADIUS_MM = 5.0
MOST_FINGERS = 20
STRONGEST_N = 20.0  # of a finger near the rim, where the sheet hardly gives way
EASE_S = 0.05  # time in which a finger comes 63 % nearer to what is wanted of it
GONE_N = 0.03  # a lifted finger that presses less has left
ALONE_S = 6.0  # the scene's own fingers come back when nobody has pressed for so long
REMEMBERED = 300  # frames whose loads can still be asked for
FIRST_ID = 100_000  # of people's fingers, above all presses of a scene


@dataclass(slots=True, eq=False)
class _Finger:
    """A finger of somebody: how it presses, and how it should."""

    id: int
    at_mm: np.ndarray
    wanted_mm: np.ndarray
    force_N: float
    wanted_N: float

    def ease(self, share: float) -> None:
        self.at_mm += share * (self.wanted_mm - self.at_mm)
        self.force_N += share * (self.wanted_N - self.force_N)


class Hands:
    """A scene, played again and again, and fingers that come and go meanwhile; a `mechanics.Pressing`.

    It is told frame by frame: `step` makes the next one, and only frames that were made can be asked for.
    While people press, the scene's fingers keep away.
    """

    def __init__(self, scene: Scene, sheet: Sheet, fps: float) -> None:
        self.scene, self.sheet, self.fps = scene, sheet, fps
        self._plate = clamped_plate(sheet)
        self._lock = threading.Lock()
        self._held: dict[int, _Finger] = {}
        self._lifted: list[_Finger] = []
        self._next_id = FIRST_ID
        self._presence, self._alone_s = 1.0, ALONE_S
        self._loads: dict[int, dict[int, PatchLoad]] = {}

    @property
    def name(self) -> str:
        return self.scene.name

    @property
    def duration_s(self) -> float:
        return self.scene.duration_s

    @property
    def seed(self) -> int:
        return self.scene.seed

    def lasting(self, duration_s: float) -> "Hands":
        """The same hands, not yet on the sheet, over a scene of another duration."""
        return Hands(self.scene.lasting(duration_s), self.sheet, self.fps)

    def loads(self, time_s: float) -> dict[int, PatchLoad]:
        """The presses of one of the latest frames; none of others."""
        with self._lock:
            return self._loads.get(round(time_s * self.fps), {})

    def is_remembered(self, index: int) -> bool:
        """Can this frame still be asked for?"""
        with self._lock:
            return index in self._loads

    def obey(self, command: Press | Release) -> None:
        """Put a finger on the sheet, move it, or lift it; from the next frame on."""
        with self._lock:
            self._alone_s = 0.0
            match command:
                case Release(finger=finger):
                    if finger in self._held:
                        self._lift(finger)
                case Press(finger=finger, x_mm=x_mm, y_mm=y_mm, depth_mm=depth_mm):
                    at_mm = self._on_sheet(x_mm, y_mm)
                    if finger not in self._held and len(self._held) < MOST_FINGERS:
                        self._held[finger] = _Finger(self._next_id, at_mm.copy(), at_mm, 0.0, 0.0)
                        self._next_id += 1
                    if finger in self._held:
                        held = self._held[finger]
                        held.wanted_mm, held.wanted_N = at_mm, self._force_N(at_mm, depth_mm)

    def step(self, index: int) -> None:
        """Make the next frame: everything that presses in it."""
        step_s = 1.0 / self.fps
        share = 1.0 - float(np.exp(-step_s / EASE_S))
        with self._lock:
            for finger in (*self._held.values(), *self._lifted):
                finger.ease(share)
            self._lifted = [finger for finger in self._lifted if finger.force_N > GONE_N]
            self._alone_s = 0.0 if self._held else self._alone_s + step_s
            self._presence += share * (float(self._alone_s > ALONE_S) - self._presence)
            fingers = [*self._held.values(), *self._lifted]
            loads = self._of_scene(index * step_s)
            loads |= {finger.id: _load(finger.at_mm, finger.force_N) for finger in fingers}
            self._loads[index] = {id_: load for id_, load in loads.items() if load.force_N > GONE_N}
            self._loads.pop(index - REMEMBERED, None)

    def _lift(self, finger: int) -> None:
        held = self._held.pop(finger)
        held.wanted_N = 0.0
        self._lifted.append(held)

    def _of_scene(self, time_s: float) -> dict[int, PatchLoad]:
        played, into_s = divmod(time_s, self.scene.duration_s)
        return {
            int(played) * len(self.scene.presses) + number: PatchLoad(
                centre_mm=load.centre_mm, radius_mm=load.radius_mm, force_N=load.force_N * self._presence
            )
            for number, load in self.scene.loads(into_s).items()
        }

    def _on_sheet(self, x_mm: float, y_mm: float) -> np.ndarray:
        """The place, moved inwards until the whole finger is on the sheet."""
        reach_mm = np.maximum(self.sheet.size_mm / 2 - 1.2 * FINGER_RADIUS_MM, 0.0)
        return np.asarray(np.clip(np.array([x_mm, y_mm]), -reach_mm, reach_mm))

    def _force_N(self, at_mm: np.ndarray, depth_mm: float) -> float:
        """How hard a finger presses to be so deep with nobody else there."""
        modes = self._plate.modes_at(at_mm[None])
        per_N = modes.field(self._plate.coefficients((_load(at_mm, 1.0),))).depth_mm[0]
        return min(max(depth_mm, 0.0) / float(per_N), STRONGEST_N)


def _load(at_mm: np.ndarray, force_N: float) -> PatchLoad:
    x, y = (float(value) for value in at_mm)
    return PatchLoad(centre_mm=(x, y), radius_mm=FINGER_RADIUS_MM, force_N=force_N)
