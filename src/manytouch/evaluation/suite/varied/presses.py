"""What presses in the varied cases, in plain numbers, drawn from a seed: bodies, their places and sizes."""

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
        """About the distance from its middle to its border, as far as it can touch."""
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
class Drawn:
    """Bodies that are drawn from a random generator.

    Attributes:
        rng: the generator.
        sheet: that they press.
        deepest_mm: of the deepest one.
    """

    rng: np.random.Generator
    sheet: VariedSheet
    deepest_mm: float

    def between(self, low: float, high: float) -> float:
        """A number with two digits after the point, even between two limits."""
        return round(float(self.rng.uniform(low, high)), 2)

    def length(self, low_mm: float, high_mm: float, share: float) -> float:
        """A length, at most a share of the shorter side of the sheet."""
        most_mm = share * min(self.sheet.size_mm)
        return self.between(min(low_mm, 0.6 * most_mm), min(high_mm, most_mm))

    def several(self, low: int, high: int) -> int:
        """A whole number between two limits, which may be drawn too."""
        return int(self.rng.integers(low, high + 1))

    def body(self, kind: Kind, *size_mm: float) -> tuple[Kind, tuple[float, ...]]:
        """A body that is not placed yet; sizes as listed at `VariedPress.kind`."""
        return kind, size_mm

    def placed(
        self, bodies: list[tuple[Kind, tuple[float, ...]]], *, tilt_rad: float = 0.0, turned: bool = True
    ) -> tuple[VariedPress, ...]:
        """The bodies at places that keep apart and off the rim; those that find no room are left out."""
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
            rim_mm = float((half_mm - np.abs(place)).min())
            found.append(
                VariedPress(
                    kind=kind,
                    size_mm=size_mm,
                    at_mm=(float(place[0]), float(place[1])),
                    yaw_rad=self.between(-1.5, 1.5)
                    if turned and kind not in {"ball", "punch", "dome"}
                    else 0.0,
                    tilt_rad=(tilt_rad * self.between(0.5, 1.0), -tilt_rad * self.between(0.3, 1.0)),
                    strength=self._strength(kind, size_mm, share, rim_mm, reach_mm),
                )
            )
        return tuple(found)

    def _strength(
        self, kind: Kind, size_mm: tuple[float, ...], share: float, rim_mm: float, reach_mm: float
    ) -> float:
        flat = kind in {"block", "punch", "ring", "cylinder"}
        free_mm = rim_mm - (reach_mm if flat else 0.0)
        depth_mm = share * min(self.deepest_mm, 0.3 * free_mm)
        if kind == "dome":
            return round(self.sheet.force_N(depth_mm, 0.25 * sum(size_mm)), 4)
        return round(depth_mm, 3)


def balls(drawn: Drawn) -> tuple[VariedPress, ...]:
    """One to three of R 2 to 5 mm."""
    return drawn.placed([drawn.body("ball", drawn.between(2.0, 5.0)) for _ in range(drawn.several(1, 3))])


def large_balls(drawn: Drawn) -> tuple[VariedPress, ...]:
    """One or two of R 8 to 25 mm."""
    return drawn.placed(
        [drawn.body("ball", drawn.length(8.0, 25.0, 0.3)) for _ in range(drawn.several(1, 2))]
    )


def square(drawn: Drawn) -> tuple[VariedPress, ...]:
    """A square end of 6 to 25 mm, in half of the cases with a ball."""
    side_mm = drawn.length(6.0, 25.0, 0.3)
    return drawn.placed([drawn.body("block", side_mm, side_mm), *_perhaps_a_ball(drawn)])


def round_punch(drawn: Drawn) -> tuple[VariedPress, ...]:
    """A flat round end of R 3 to 12 mm, in half of the cases with a ball."""
    return drawn.placed([drawn.body("punch", drawn.length(3.0, 12.0, 0.15)), *_perhaps_a_ball(drawn)])


def oblong(drawn: Drawn) -> tuple[VariedPress, ...]:
    """A rectangular end, 4 to 8 by 15 to 35 mm."""
    return drawn.placed([drawn.body("block", drawn.length(15.0, 35.0, 0.35), drawn.between(4.0, 8.0))])


def line(drawn: Drawn) -> tuple[VariedPress, ...]:
    """A lying cylinder of R 2 to 5 mm, 12 to 40 mm long, in half of the cases with a ball."""
    radius_mm = drawn.between(2.0, 5.0)
    return drawn.placed(
        [drawn.body("cylinder", radius_mm, drawn.length(12.0, 40.0, 0.4)), *_perhaps_a_ball(drawn)]
    )


def ring(drawn: Drawn) -> tuple[VariedPress, ...]:
    """A ring of R 5 to 12 mm."""
    return drawn.placed([drawn.body("ring", drawn.length(5.0, 12.0, 0.14), drawn.between(1.0, 2.0))])


def corner(drawn: Drawn) -> tuple[VariedPress, ...]:
    """One or two corners of cubes."""
    return drawn.placed(
        [drawn.body("corner", drawn.length(8.0, 20.0, 0.25)) for _ in range(drawn.several(1, 2))]
    )


def tilted(drawn: Drawn) -> tuple[VariedPress, ...]:
    """A square end of 8 to 18 mm, tilted by 2 to 8 degrees."""
    side_mm = drawn.length(8.0, 18.0, 0.25)
    return drawn.placed([drawn.body("block", side_mm, side_mm)], tilt_rad=drawn.between(0.06, 0.14))


def fingers(drawn: Drawn) -> tuple[VariedPress, ...]:
    """One to four soft fingertips."""
    return drawn.placed([_finger(drawn) for _ in range(drawn.several(1, 4))])


def palm(drawn: Drawn) -> tuple[VariedPress, ...]:
    """A palm-like wide load, and one to three soft fingertips."""
    wide = drawn.body("dome", drawn.length(30.0, 60.0, 0.45), drawn.length(25.0, 45.0, 0.4))
    return drawn.placed([wide, *(_finger(drawn) for _ in range(drawn.several(1, 3)))])


def mixed(drawn: Drawn) -> tuple[VariedPress, ...]:
    """Three to eight balls, rigid fingertips, punches and soft fingertips."""
    kinds: tuple[Callable[[Drawn], tuple[Kind, tuple[float, ...]]], ...] = (
        lambda one: one.body("ball", one.between(2.0, 7.0)),
        lambda one: one.body(
            "fingertip", one.between(4.0, 6.0), one.between(5.0, 8.0), one.between(4.0, 6.0)
        ),
        lambda one: one.body("punch", one.between(2.0, 4.0)),
        _finger,
    )
    count = drawn.several(3, 8)
    return drawn.placed([kinds[number % len(kinds)](drawn) for number in range(count)])


def _finger(drawn: Drawn) -> tuple[Kind, tuple[float, ...]]:
    return drawn.body("dome", drawn.length(8.0, 14.0, 0.18), drawn.length(10.0, 18.0, 0.22))


def _perhaps_a_ball(drawn: Drawn) -> list[tuple[Kind, tuple[float, ...]]]:
    return [drawn.body("ball", drawn.between(2.5, 6.0))] if drawn.rng.random() < 0.5 else []


SHAPES: dict[str, Callable[[Drawn], tuple[VariedPress, ...]]] = {
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
