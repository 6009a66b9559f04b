"""Presses of given force on the linear plate in time, as values: any of them, at once.

Forces suit the linear plate of `simulation.plate` and the demo sheet: 4 N in its middle press 3 mm deep.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from manytouch.simulation.plate import PatchLoad


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Press:
    """One fingertip from its first touch to its release.

    Attributes:
        start_s, end_s: it touches at times between the two, excluding both.
        from_mm, to_mm: it slides from x, y to x, y once it is down; equal for a press in place.
        force_N: pressing force while it is down.
        radius_mm: of the contact patch.
        ramp_s: time to press down, and to release.
    """

    start_s: float
    end_s: float
    from_mm: tuple[float, float]
    to_mm: tuple[float, float]
    force_N: float
    radius_mm: float = 5.0
    ramp_s: float = 0.25

    def load(self, time_s: float) -> PatchLoad | None:
        """The load at a time; None while it does not touch."""
        if not self.start_s < time_s < self.end_s:
            return None
        down = min(time_s - self.start_s, self.end_s - time_s) / self.ramp_s
        along = (time_s - self.start_s - self.ramp_s) / max(self.end_s - self.start_s - 2 * self.ramp_s, 1e-9)
        share = _smooth(along)
        x, y = (a + share * (b - a) for a, b in zip(self.from_mm, self.to_mm, strict=True))
        return PatchLoad(centre_mm=(x, y), radius_mm=self.radius_mm, force_N=self.force_N * _smooth(down))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scene:
    """Presses in a span of time.

    Attributes:
        name: for people.
        duration_s: of the whole.
        presses: in the order of their starts; a contact's id is its index.
        seed: of the image noise.
    """

    name: str
    duration_s: float
    presses: tuple[Press, ...]
    seed: int = 0

    def loads(self, time_s: float) -> dict[int, PatchLoad]:
        """The presses that touch at a time, by id."""
        loads = ((id_, press.load(time_s)) for id_, press in enumerate(self.presses))
        return {id_: load for id_, load in loads if load is not None}

    def lasting(self, duration_s: float) -> "Scene":
        """This scene cut, or played again and again, to another duration."""
        rounds = math.ceil(duration_s / self.duration_s)
        presses = (
            replace(press, start_s=press.start_s + later, end_s=min(press.end_s + later, duration_s))
            for later in (self.duration_s * number for number in range(rounds))
            for press in self.presses
            if press.start_s + later < duration_s
        )
        return replace(self, duration_s=duration_s, presses=tuple(presses))


def fingers(seed: int = 0) -> Scene:
    """Press, slide, three taps, then up to five fingers at once; untouched up to 1.2 s and from 9.3 s."""
    tap_mm = (38.0, -15.0)
    presses = (
        _still(1.2, 4.2, (-30.0, 9.0), 4.0, radius_mm=6.0),
        Press(start_s=1.9, end_s=3.9, from_mm=(0.0, -17.0), to_mm=(36.0, 6.0), force_N=3.8),
        _still(4.5, 4.8, tap_mm, 4.5, radius_mm=4.0, ramp_s=0.1),
        _still(4.7, 9.0, (-42.0, 12.0), 4.8, radius_mm=6.0),
        _still(5.0, 5.3, tap_mm, 5.5, radius_mm=4.0, ramp_s=0.1),
        _still(5.5, 5.8, tap_mm, 4.5, radius_mm=4.0, ramp_s=0.1),
        Press(start_s=5.6, end_s=8.8, from_mm=(-14.0, -18.0), to_mm=(-20.0, -12.0), force_N=3.4),
        _still(6.1, 9.3, (13.0, 16.0), 3.4),
        Press(start_s=6.3, end_s=9.2, from_mm=(40.0, -16.0), to_mm=(44.0, -2.0), force_N=4.4),
        _still(7.4, 7.8, (12.0, -18.0), 3.6, radius_mm=4.0, ramp_s=0.1),
    )
    chance = np.random.default_rng(seed)
    return Scene(
        name="fingers", duration_s=10.0, presses=tuple(_varied(press, chance) for press in presses), seed=seed
    )


def rest(seed: int = 0) -> Scene:
    """Nobody touches it for 5 s."""
    return Scene(name="rest", duration_s=5.0, presses=(), seed=seed)


def one(seed: int = 0) -> Scene:
    """One slow press in 6 s, off the middle."""
    chance = np.random.default_rng(seed)
    press = _still(1.0, 5.0, (14.0, -8.0), 5.0, ramp_s=1.8)
    return Scene(name="one", duration_s=6.0, presses=(_varied(press, chance),), seed=seed)


SCENES: Mapping[str, Callable[[int], Scene]] = {"fingers": fingers, "one": one, "rest": rest}


def _still(
    start_s: float,
    end_s: float,
    at_mm: tuple[float, float],
    force_N: float,
    *,
    radius_mm: float = 5.0,
    ramp_s: float = 0.25,
) -> Press:
    return Press(
        start_s=start_s,
        end_s=end_s,
        from_mm=at_mm,
        to_mm=at_mm,
        force_N=force_N,
        radius_mm=radius_mm,
        ramp_s=ramp_s,
    )


def _varied(press: Press, chance: np.random.Generator) -> Press:
    """The same press a little elsewhere and a little harder or softer, so that seeds differ."""
    x, y = chance.uniform(-1.5, 1.5, 2)
    return replace(
        press,
        from_mm=(press.from_mm[0] + float(x), press.from_mm[1] + float(y)),
        to_mm=(press.to_mm[0] + float(x), press.to_mm[1] + float(y)),
        force_N=press.force_N * float(chance.uniform(0.9, 1.1)),
    )


def _smooth(share: float) -> float:
    """0 to 1 with rest at both ends."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3 - 2 * share)
