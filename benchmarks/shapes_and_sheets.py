"""How well contacts of other shapes on other sheets are estimated, from points.

The accuracy suite presses rigid balls into one sheet under pretension. Here 3-D solids are pressed by
balls, flat squares, lying cylinders, round punches, tilted squares and soft pads, without pretension and
with it, on sheets of 1.5, 3 and 5 mm, with Poisson's ratios of .3 to .49, and near the clamp, at six depths
each. The method `mechanics` gets the true marker images with 0.03 px of noise and the true sheet. The cases
were looked at while the method was made, so these are not held-out figures.

    .venv/bin/python benchmarks/shapes_and_sheets.py --keep out/solids

solves the solids (a quarter of an hour, once) and prints a table by group, and with --each a line for each
state.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from manytouch.estimation.mechanics.estimator import MechanicsEstimator
from manytouch.evaluation.suite.cases import Case
from manytouch.evaluation.suite.sensors import true_sensor
from manytouch.simulation.fem.cache import StateCache
from manytouch.simulation.fem.contact.indenters import (
    Indenter,
    LyingCylinder,
    RoundPunch,
    Sphere,
    SquarePunch,
)
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import IndenterPath, Loading, PressurePatch, press
from manytouch.simulation.fem.sheet import SheetModel
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation, undeformed
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Contact, Sensor, Surface, TrackedGrid

NOISE_PX = 0.03
REST_FRAMES, HELD_FRAMES = 5, 6
BALL_MM = np.array([0.2, 0.5, 1.0, 2.0, 4.0, 6.0])
FLAT_MM = np.array([0.15, 0.3, 0.5, 1.0, 2.0, 4.0])
PAD_N = np.array([0.05, 0.1, 0.2, 0.5, 1.5, 5.0])
MATCH_MM = 3.0


@dataclass(frozen=True, kw_only=True)
class Solid:
    """One sheet and what presses it.

    Attributes:
        name, group: for the tables.
        model: of the sheet.
        loading: six steps.
    """

    name: str
    group: str
    model: SheetModel
    loading: Loading


def sheet(
    thickness_mm: float = 3.0, tension_N_per_mm: float = 0.0, poisson: float = 0.45, element_mm: float = 2.0
) -> SheetModel:
    """A sheet of 120 x 80 mm."""
    return SheetModel(
        size_mm=(120.0, 80.0),
        thickness_mm=thickness_mm,
        material=NeoHooke(young_MPa=3.1, poisson=poisson),
        pretension_N_per_mm=tension_N_per_mm,
        element_mm=element_mm,
    )


def touch(
    model: SheetModel,
    body: Indenter,
    place_mm: tuple[float, float],
    depth_mm: np.ndarray,
    *,
    yaw_rad: float = 0.0,
    tilt_rad: tuple[float, float] = (0.0, 0.0),
) -> IndenterPath:
    """A body that is pressed in at one place."""
    count = len(depth_mm)
    path = press(
        body,
        thickness_mm=model.thickness_mm,
        path_mm=np.column_stack([np.tile(place_mm, (count, 1)), depth_mm]),
        yaw_rad=np.full(count, yaw_rad),
    )
    if not any(tilt_rad):
        return path
    return replace(path, rotation_vector=np.tile([*tilt_rad, 0.0], (count, 1)))


def pad(place_mm: tuple[float, float], size_mm: tuple[float, float], force_N: np.ndarray) -> PressurePatch:
    """A soft pad: even pressure on an ellipse."""
    zero = np.zeros_like(force_N)
    return PressurePatch(centre_mm=place_mm, size_mm=size_mm, force_N=np.column_stack([zero, zero, -force_N]))


def solids() -> Iterator[Solid]:
    """All cases."""
    for tension in (0.0, 0.4):
        model, group = sheet(tension_N_per_mm=tension), f"pretension {tension:g} N/mm"
        square, bar = SquarePunch(side_mm=(20.0, 20.0)), LyingCylinder(radius_mm=4.0, length_mm=30.0)
        tilted, ball = SquarePunch(side_mm=(14.0, 14.0)), Sphere(radius_mm=5.0)
        bodies = {
            "ball": [touch(model, Sphere(radius_mm=6.0), (10.0, 5.0), BALL_MM)],
            "two balls": [
                touch(model, Sphere(radius_mm=3.0), (-20.0, 8.0), 0.7 * BALL_MM),
                touch(model, Sphere(radius_mm=10.0), (15.0, -6.0), 0.8 * BALL_MM),
            ],
            "square 20 mm": [touch(model, square, (-8.0, 4.0), FLAT_MM, yaw_rad=0.3)],
            "bar 30 mm": [touch(model, bar, (6.0, -5.0), FLAT_MM, yaw_rad=0.5)],
            "punch and ball": [
                touch(model, RoundPunch(radius_mm=8.0), (-22.0, 3.0), FLAT_MM),
                touch(model, Sphere(radius_mm=4.0), (18.0, -4.0), FLAT_MM),
            ],
            "tilted square": [touch(model, tilted, (10.0, 8.0), FLAT_MM, tilt_rad=(0.12, 0.06))],
            "8 mm from the clamp": [touch(model, ball, (-52.0, 4.0), 0.6 * BALL_MM)],
            "6 mm from the clamp": [touch(model, ball, (6.0, 34.0), 0.5 * BALL_MM)],
        }
        for name, touches in bodies.items():
            yield Solid(name=name, group=group, model=model, loading=Loading(touches=tuple(touches)))
        soft = pad((5.0, 3.0), (12.0, 16.0), PAD_N * (2.0 if tension else 1.0))
        yield Solid(name="pad", group=group, model=model, loading=Loading(patches=(soft,)))
        both = Loading(
            touches=(touch(model, ball, (-20.0, 5.0), FLAT_MM),),
            patches=(pad((15.0, -5.0), (16.0, 16.0), PAD_N),),
        )
        yield Solid(name="pad and ball", group=group, model=model, loading=both)
    yield from _other_sheets()


def _other_sheets() -> Iterator[Solid]:
    balls = {
        "1.5 mm": (sheet(1.5), 6.0, (10.0, 5.0), BALL_MM),
        "1.5 mm, .4 N/mm": (sheet(1.5, 0.4), 4.0, (-14.0, 8.0), FLAT_MM),
        "5 mm": (sheet(5.0, element_mm=2.5), 6.0, (10.0, 5.0), 0.8 * BALL_MM),
        "5 mm, .8 N/mm": (sheet(5.0, 0.8, element_mm=2.5), 4.0, (-14.0, 8.0), FLAT_MM),
        "5 mm, 12 mm from the clamp": (sheet(5.0, element_mm=2.5), 6.0, (-48.0, 4.0), 0.6 * BALL_MM),
        "Poisson's ratio .3": (sheet(poisson=0.3), 6.0, (-12.0, -7.0), 0.8 * BALL_MM),
        "Poisson's ratio .49": (sheet(poisson=0.49), 4.0, (-12.0, -7.0), 0.8 * BALL_MM),
    }
    for name, (model, radius_mm, place_mm, depth_mm) in balls.items():
        loading = Loading(touches=(touch(model, Sphere(radius_mm=radius_mm), place_mm, depth_mm),))
        yield Solid(name=name, group="other sheets, ball", model=model, loading=loading)
    for model in (sheet(1.5), sheet(5.0, element_mm=2.5)):
        square = touch(model, SquarePunch(side_mm=(14.0, 14.0)), (-8.0, 4.0), FLAT_MM)
        name = f"{model.thickness_mm:g} mm, square 14 mm"
        yield Solid(name=name, group="other sheets, square", model=model, loading=Loading(touches=(square,)))


def exact_sensor(model: SheetModel) -> Sensor:
    """The sensor, whose file states that it is exact."""
    case = Case(
        group="nominal",
        name="shapes",
        seed=1,
        looked_at=True,
        touches=(),
        deepest_mm=1.0,
        size_mm=model.size_mm,
        thickness_mm=model.thickness_mm,
        young_MPa=model.material.young_MPa,
        poisson=model.material.poisson,
        pretension_N_per_mm=model.pretension_N_per_mm,
    )
    sensor = true_sensor(case)
    assert sensor.sheet is not None
    exact = replace(
        sensor.sheet,
        thickness_std_mm=0.0,
        poisson_std=0.0,
        young_std_MPa=0.0,
        pretension_std_N_per_mm=0.0,
        outline_std_mm=0.0,
    )
    return replace(sensor, sheet=exact)


@dataclass(frozen=True, kw_only=True)
class State:
    """What was estimated of one state.

    Attributes:
        step: number of the state.
        truth: of the state.
        found: contacts.
        surface: depth at the markers.
        depth_mm: (m,) true depth there.
    """

    step: int
    truth: Deformation
    found: tuple[Contact, ...]
    surface: Surface
    depth_mm: np.ndarray


def estimate(solid: Solid, states: list[Deformation]) -> Iterator[State]:
    """Hold each state for some frames; the last of them counts."""
    sensor, rng = exact_sensor(solid.model), np.random.default_rng(0)
    count = len(states)
    scene = SolidScene(
        name="shapes",
        time_s=np.arange(count + 2, dtype=np.float64),
        states=(undeformed(states[0]), *states, states[-1]),
        seed=1,
        duration_s=float(count + 1),
    )
    simulator, estimator = Simulator(sensor=sensor, scene=scene, fps=1.0), MechanicsEstimator()
    state = estimator.start(sensor)
    for number in range(count + 1):
        truth = simulator.truth(number)
        markers = len(truth.grid.is_seen)
        for _ in range(HELD_FRAMES if number else REST_FRAMES):
            grid = TrackedGrid(
                position_px=truth.grid.position_px + NOISE_PX * rng.standard_normal((markers, 2)),
                covariance_px2=np.tile(NOISE_PX**2 * np.eye(2), (markers, 1, 1)),
                is_seen=truth.grid.is_seen,
                frames_unseen=truth.grid.frames_unseen,
            )
            state, surface, contacts = estimator.step(state, grid)
        if number:
            yield State(
                step=number - 1,
                truth=states[number - 1],
                found=contacts.touching,
                surface=surface,
                depth_mm=-truth.surface.displacement_mm[:, 2],
            )


@dataclass(kw_only=True)
class Errors:
    """Errors of the contacts of a group."""

    true: int = 0
    extra: int = 0
    force: list[float]
    place_mm: list[float]
    force_stds: list[float]
    rmse_mm: list[float]
    peak: list[float]

    @staticmethod
    def none() -> "Errors":
        return Errors(force=[], place_mm=[], force_stds=[], rmse_mm=[], peak=[])

    def add(self, state: State) -> str:
        """Compare one state; returns it as text."""
        off_mm = -state.surface.displacement_mm[:, 2] - state.depth_mm
        deepest = int(np.argmax(state.depth_mm))
        self.rmse_mm.append(float(np.sqrt(np.mean(off_mm**2))))
        self.peak.append(float(off_mm[deepest] / state.depth_mm[deepest]))
        left, words = list(state.found), []
        for true in (contact for contact in state.truth.contacts if contact.is_touching):
            self.true += 1
            away = [float(np.linalg.norm(found.centre_mm - true.centre_mm)) for found in left]
            if not away or min(away) > MATCH_MM:
                words.append(f"{true.normal_force_N:.3g} N missed")
                continue
            found = left.pop(int(np.argmin(away)))
            off_N = -float(found.force_N[2]) - true.normal_force_N
            self.place_mm.append(min(away))
            self.force.append(off_N / true.normal_force_N)
            self.force_stds.append(off_N / found.std("normal_force"))
            words.append(f"{true.normal_force_N:.3g} N {100 * self.force[-1]:+.0f} %, {min(away):.2f} mm off")
        self.extra += len(left)
        return f"depth RMSE {self.rmse_mm[-1]:.4f} mm, peak {100 * self.peak[-1]:+.1f} %, " + ", ".join(words)

    def row(self) -> str:
        force, place, rmse = np.abs(self.force), np.array(self.place_mm), np.array(self.rmse_mm)
        inside = np.mean(np.abs(self.force_stds) < 1.96)
        precision = len(force) / max(len(force) + self.extra, 1)
        return (
            f"{100 * precision:.0f} / {100 * len(force) / self.true:.0f} | "
            f"{np.median(place):.2f} / {np.quantile(place, 0.95):.2f} | "
            f"{100 * np.median(force):.1f} / {100 * np.quantile(force, 0.95):.0f}, "
            f"{100 * np.median(self.force):+.1f} | {np.median(rmse):.4f} / {rmse.max():.3f} | "
            f"{100 * np.median(np.abs(self.peak)):.1f} | {100 * inside:.0f}"
        )


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--keep", type=Path, required=True, help="folder of the solved solids")
    options.add_argument("--each", action="store_true", help="a line for each state")
    options.add_argument("--only", default="", help="cases with this in their name")
    chosen = options.parse_args()
    groups: dict[str, Errors] = {}
    for solid in solids():
        if chosen.only not in f"{solid.group}, {solid.name}":
            continue
        cache = StateCache(folder=chosen.keep)
        states = [condense(state, solid.loading) for state in cache.states(solid.model, solid.loading)]
        for state in estimate(solid, states):
            text = groups.setdefault(solid.group, Errors.none()).add(state)
            if chosen.each:
                print(f"{solid.group}, {solid.name}, {state.step + 1}: {text}")
    print(
        "group | precision / recall % | place median / 95 % mm | force median / 95 %, bias % | "
        "depth RMSE median / worst mm | peak median % | forces within 1.96 deviations %"
    )
    for group, errors in groups.items():
        print(f"{group} | {errors.row()}")


if __name__ == "__main__":
    main()
