"""What presses in the varied cases, in plain numbers that are sampled at random: bodies, places and sizes.

Sizes in the docstrings of the shapes are those on large sheets; on small ones most are limited to a share of
the shorter side (`PressSampler.length`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from manytouch.evaluation.suite.varied.sheets import VariedSheet

Kind = Literal["ball", "block", "punch", "cylinder", "ring", "corner", "fingertip", "dome"]


@dataclass(frozen=True, slots=True, kw_only=True)
class VariedPress:
    """One body, or a given pressure.

    Attributes:
        kind: "ball" (radius); "block", a flat rectangular end (sides along x and y); "punch", a flat round
            end (radius); "cylinder", lying (radius, length); "ring", lying (radius, of its wire); "corner",
            of a cube (its edge); "fingertip", a rigid ellipsoid (half axes); "dome", the pressure of
            something soft on an ellipse (extent along x and y).
        size_mm: as listed for the kind.
        at_mm: x, y of its middle.
        yaw_rad, tilt_rad: turn about z; about x and y.
        strength: depth of its lowest point in mm; of a dome its force in N.
    """

    kind: Kind
    size_mm: tuple[float, ...]
    at_mm: tuple[float, float]
    yaw_rad: float = 0.0
    tilt_rad: tuple[float, float] = (0.0, 0.0)
    strength: float

    @property
    def reach_mm(self) -> float:
        """Distance from its middle within which it may touch the sheet; approximate."""
        return _reach_mm(self.kind, self.size_mm)


def _reach_mm(kind: Kind, size_mm: tuple[float, ...]) -> float:
    match kind:
        case "ball" | "punch":
            return size_mm[0] if kind == "punch" else min(size_mm[0], 6.0 + 0.3 * size_mm[0])
        case "block" | "dome":
            return 0.5 * float(np.hypot(size_mm[0], size_mm[1]))
        case "cylinder":
            return 0.5 * size_mm[1]
        case "ring":
            return sum(size_mm)
        case "corner":
            return 0.6 * size_mm[0]
    return max(size_mm[:2])


@dataclass(frozen=True, slots=True, kw_only=True)
class PressSampler:
    """Samples bodies and their places from a random generator.

    Attributes:
        rng: the generator.
        sheet: that the bodies press.
        deepest_mm: depth of the first body; the others are 0.5 to 1 times as deep. Near the clamp the depth
            is limited to 0.3 of the distance from it.
    """

    rng: np.random.Generator
    sheet: VariedSheet
    deepest_mm: float

    def between(self, low: float, high: float) -> float:
        """A number that is uniformly distributed between two limits, rounded to 0.01."""
        return round(float(self.rng.uniform(low, high)), 2)

    def length(self, low_mm: float, high_mm: float, share: float) -> float:
        """A length that is uniformly distributed between two limits.

        The upper limit is at most `share` of the shorter side of the sheet, the lower at most 0.6 of that.
        """
        most_mm = share * min(self.sheet.size_mm)
        return self.between(min(low_mm, 0.6 * most_mm), min(high_mm, most_mm))

    def several(self, low: int, high: int) -> int:
        """A whole number from `low` to `high`, both included; each is equally likely."""
        return int(self.rng.integers(low, high + 1))

    def body(self, kind: Kind, *size_mm: float) -> tuple[Kind, tuple[float, ...]]:
        """A body that is not placed yet; sizes as listed at `VariedPress.kind`."""
        return kind, size_mm

    def placed(
        self, bodies: list[tuple[Kind, tuple[float, ...]]], *, tilt_rad: float = 0.0, turned: bool = True
    ) -> tuple[VariedPress, ...]:
        """The bodies at random places, each at least the sheet's `gap_mm` from the others and from the clamp.

        A body for which none of 400 places has enough room is left out.

        Args:
            bodies: from `body`.
            tilt_rad: each is tilted about x by 0.5 to 1 times as much, and about y by -0.3 to -1 times.
            turned: whether bodies that are not round are turned about z, by up to 1.5 rad.
        """
        half_mm, gap_mm = 0.5 * np.array(self.sheet.size_mm), self.sheet.gap_mm
        found: list[VariedPress] = []
        for number, (kind, size_mm) in enumerate(bodies):
            reach_mm = _reach_mm(kind, size_mm)
            room_mm = half_mm - reach_mm - gap_mm
            for _ in range(400):
                place = np.round(self.rng.uniform(-1, 1, 2) * np.maximum(room_mm, 0.0), 2)
                off_mm = [np.linalg.norm(place - other.at_mm) - other.reach_mm - reach_mm for other in found]
                if all(each >= gap_mm for each in off_mm):
                    break
            else:
                continue
            share = 1.0 if number == 0 else self.between(0.5, 1.0)
            border_mm = float((half_mm - np.abs(place)).min())
            found.append(
                VariedPress(
                    kind=kind,
                    size_mm=size_mm,
                    at_mm=(float(place[0]), float(place[1])),
                    yaw_rad=self.between(-1.5, 1.5)
                    if turned and kind not in {"ball", "punch", "dome"}
                    else 0.0,
                    tilt_rad=(tilt_rad * self.between(0.5, 1.0), -tilt_rad * self.between(0.3, 1.0)),
                    strength=self._strength(kind, size_mm, share, border_mm, reach_mm),
                )
            )
        return tuple(found)

    def _strength(
        self, kind: Kind, size_mm: tuple[float, ...], share: float, border_mm: float, reach_mm: float
    ) -> float:
        flat = kind in {"block", "punch", "ring", "cylinder"}
        free_mm = border_mm - (reach_mm if flat else 0.0)
        depth_mm = share * min(self.deepest_mm, 0.3 * free_mm)
        if kind == "dome":
            return round(self.sheet.force_N(depth_mm, 0.25 * sum(size_mm)), 4)
        return round(depth_mm, 3)


def balls(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """One to three balls of R 2 to 5 mm."""
    return sampler.placed(
        [sampler.body("ball", sampler.between(2.0, 5.0)) for _ in range(sampler.several(1, 3))]
    )


def large_balls(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """One or two balls of R 8 to 25 mm."""
    return sampler.placed(
        [sampler.body("ball", sampler.length(8.0, 25.0, 0.3)) for _ in range(sampler.several(1, 2))]
    )


def square(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """A square end of 6 to 25 mm, in half of the cases with a ball."""
    side_mm = sampler.length(6.0, 25.0, 0.3)
    return sampler.placed([sampler.body("block", side_mm, side_mm), *_perhaps_a_ball(sampler)])


def round_punch(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """A flat round end of R 3 to 12 mm, in half of the cases with a ball."""
    return sampler.placed([sampler.body("punch", sampler.length(3.0, 12.0, 0.15)), *_perhaps_a_ball(sampler)])


def oblong(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """A rectangular end, 4 to 8 by 15 to 35 mm."""
    return sampler.placed(
        [sampler.body("block", sampler.length(15.0, 35.0, 0.35), sampler.between(4.0, 8.0))]
    )


def line(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """A lying cylinder of R 2 to 5 mm, 12 to 40 mm long, in half of the cases with a ball."""
    radius_mm = sampler.between(2.0, 5.0)
    return sampler.placed(
        [sampler.body("cylinder", radius_mm, sampler.length(12.0, 40.0, 0.4)), *_perhaps_a_ball(sampler)]
    )


def ring(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """A lying ring of R 5 to 12 mm, of a wire of R 1 to 2 mm."""
    return sampler.placed([sampler.body("ring", sampler.length(5.0, 12.0, 0.14), sampler.between(1.0, 2.0))])


def corner(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """One or two corners of cubes with edges of 8 to 20 mm."""
    return sampler.placed(
        [sampler.body("corner", sampler.length(8.0, 20.0, 0.25)) for _ in range(sampler.several(1, 2))]
    )


def tilted(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """A square end of 8 to 18 mm, tilted by 2 to 8 degrees about x and 1 to 8 about y."""
    side_mm = sampler.length(8.0, 18.0, 0.25)
    return sampler.placed([sampler.body("block", side_mm, side_mm)], tilt_rad=sampler.between(0.06, 0.14))


def fingers(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """One to four soft fingertips: pressure on ellipses of 8 to 14 by 10 to 18 mm."""
    return sampler.placed([_finger(sampler) for _ in range(sampler.several(1, 4))])


def palm(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """A palm: pressure on an ellipse of 30 to 60 by 25 to 45 mm; and one to three soft fingertips."""
    wide = sampler.body("dome", sampler.length(30.0, 60.0, 0.45), sampler.length(25.0, 45.0, 0.4))
    return sampler.placed([wide, *(_finger(sampler) for _ in range(sampler.several(1, 3)))])


def mixed(sampler: PressSampler) -> tuple[VariedPress, ...]:
    """Three to eight balls, rigid fingertips, punches and soft fingertips."""
    kinds: tuple[Callable[[PressSampler], tuple[Kind, tuple[float, ...]]], ...] = (
        lambda one: one.body("ball", one.between(2.0, 7.0)),
        lambda one: one.body(
            "fingertip", one.between(4.0, 6.0), one.between(5.0, 8.0), one.between(4.0, 6.0)
        ),
        lambda one: one.body("punch", one.between(2.0, 4.0)),
        _finger,
    )
    count = sampler.several(3, 8)
    return sampler.placed([kinds[number % len(kinds)](sampler) for number in range(count)])


def _finger(sampler: PressSampler) -> tuple[Kind, tuple[float, ...]]:
    return sampler.body("dome", sampler.length(8.0, 14.0, 0.18), sampler.length(10.0, 18.0, 0.22))


def _perhaps_a_ball(sampler: PressSampler) -> list[tuple[Kind, tuple[float, ...]]]:
    return [sampler.body("ball", sampler.between(2.5, 6.0))] if sampler.rng.random() < 0.5 else []


CASES_OF_SHAPES: dict[str, Callable[[PressSampler], tuple[VariedPress, ...]]] = {
    "balls": balls,
    "large-balls": large_balls,
    "square": square,
    "round": round_punch,
    "oblong": oblong,
    "line": line,
    "ring": ring,
    "corner": corner,
    "tilted": tilted,
    "fingers": fingers,
    "palm": palm,
    "mixed": mixed,
}
