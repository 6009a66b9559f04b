"""Contacts on sensors that are turned, whose sheet hangs otherwise then than at rest.

    python benchmarks/turned_sensor.py [--first 100] [--scenes 6] [--fixed] [--fps 30]

Each scene has a clamped sheet of its own (that of `random_scenes.py --moving`; silicone of 1070 kg/m^3) as a
3-D solid under its weight. After half a second at rest the sensor is turned within a second, into another
direction or, in every second scene, from facing up to facing down. A ball presses the turned sheet, stays
while the sensor is turned back, and is lifted. The true images of the markers get noise. Printed are contacts
where nothing presses, those of the ball that are found, and the error of its force; with `--fixed` for a
sensor that is taken for one that does not move.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import tomlkit
from random_scenes import moving_sensor

from manytouch.estimation import MechanicsEstimator
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.fem.sheet import Refinement, graded_sheet_model, sheet_solver
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Sensor, TrackedGrid, Truth
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file.read import load_sensor

SEED, DENSITY_KG_M3, NOISE_PX = 77000, 1070.0, 0.01
GATE_MM = 3.0
CLEAR_MM = -3.0
# time in s, share of the turn, share of the depth of the ball
KEYFRAMES = np.array(
    [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0)]
    + [(0.5 + 0.2 * k, k / 5, 0.0) for k in range(1, 6)]
    + [(1.8, 1.0, 0.0)]
    + [(1.8 + 0.12 * k, 1.0, k / 4) for k in range(1, 5)]
    + [(2.4 + 0.2 * k, 1.0 - k / 5, 1.0) for k in range(1, 6)]
    + [(3.5, 0.0, 2 / 3), (3.6, 0.0, 1 / 3), (3.7, 0.0, 0.0), (4.2, 0.0, 0.0)]
)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A turned sensor: what is given to the method, its truth, and how far the turn moves the sheet."""

    sensor: Sensor
    truths: list[Truth]
    moved_mm: float


def unit(vector: np.ndarray) -> np.ndarray:
    """The vector with length 1."""
    return np.asarray(vector / np.linalg.norm(vector))


def simulated(number: int, fps: float) -> Scene | None:
    """The scene with this number, or None if no equilibrium is found."""
    draw = np.random.default_rng(SEED + number)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "sensor.toml"
        path.write_text(tomlkit.dumps(moving_sensor(draw, f"turned-{number}")))
        sensor = load_sensor(path)
    sheet, layout = sensor.sheet, sensor.layout
    assert sheet is not None
    assert layout is not None
    place_mm = draw.uniform(-0.25, 0.25, 2) * sheet.size_mm
    radius_mm, depth_mm = draw.uniform(3.0, 8.0), draw.uniform(0.4, 1.2) * sheet.thickness_mm
    before, after = unit(draw.normal(size=3)), unit(draw.normal(size=3))
    if number % 2:
        before, after = np.array([0.0, 0.0, 1.0]), unit(np.array([0.3, 0.3, -1.0]) * before)
    rubber = NeoHooke(
        young_MPa=sheet.young_MPa or np.nan, poisson=sheet.poisson or np.nan, density_kg_m3=DENSITY_KG_M3
    )
    model = graded_sheet_model(
        (float(sheet.size_mm[0]), float(sheet.size_mm[1])),
        sheet.thickness_mm,
        rubber,
        element_mm=min(10.0, 0.06 * float(sheet.size_mm.max())),
        refined=(Refinement(low_mm=tuple(place_mm - 4.0), high_mm=tuple(place_mm + 4.0), element_mm=1.5),),
        pretension_N_per_mm=sheet.pretension_N_per_mm or 0.0,
    )
    time_s, turns, depths = KEYFRAMES.T
    depths_mm = np.where(depths > 0.0, depths * depth_mm, CLEAR_MM)
    path_mm = np.column_stack([np.tile(place_mm, (len(time_s), 1)), depths_mm])
    ball = press(Sphere(radius_mm=radius_mm), thickness_mm=sheet.thickness_mm, path_mm=path_mm)
    loading, solver, states = Loading(touches=(ball,)), sheet_solver(model), list[Deformation]()
    state = solver.start(loading)
    for step, turn in enumerate(turns):
        gravity = unit((1.0 - turn) * before + turn * after)
        state = replace(solver, gravity=tuple(gravity.tolist())).step(state, loading, step)
        if state.status != "ok":
            return None
        states.append(condense(state, loading))
    scene = SolidScene(name=sensor.name, time_s=time_s, states=tuple(states), duration_s=time_s[-1])
    simulator = Simulator(sensor=sensor, scene=scene, fps=fps)
    truths = [simulator.truth(frame) for frame in range(simulator.frame_count)]
    given = replace(sensor, layout=replace(layout, rest_px=truths[0].grid.position_px))
    moved_mm = np.abs(states[7].face_mm - states[0].face_mm).max()
    return Scene(sensor=given, truths=truths, moved_mm=float(moved_mm))


def noisy(grid: TrackedGrid, chance: np.random.Generator) -> TrackedGrid:
    """The markers with noise."""
    position_px = grid.position_px + chance.normal(0.0, NOISE_PX, grid.position_px.shape)
    covariance_px2 = np.where(grid.is_seen[:, None, None], NOISE_PX**2 * np.eye(2), np.nan)
    return replace(grid, position_px=read_only(position_px), covariance_px2=read_only(covariance_px2))


def figures(scene: Scene, estimator: MechanicsEstimator) -> tuple[int, int, int, list[float]]:
    """Contacts where nothing presses, true ones that are found and missed, and relative errors of force."""
    chance, state = np.random.default_rng(0), estimator.start(scene.sensor)
    false = found = missed = 0
    errors = []
    for truth in scene.truths:
        state, _, contacts = estimator.step(state, noisy(truth.grid, chance))
        near = 0
        for true in truth.contacts.touching:
            away_mm = [np.linalg.norm(each.centre_mm - true.centre_mm) for each in contacts.touching]
            is_found = min(away_mm, default=np.inf) < GATE_MM
            near += is_found
            missed += not is_found
            if is_found:
                force_N = contacts.touching[int(np.argmin(away_mm))].force_N[2]
                errors.append(force_N / true.force_N[2] - 1.0)
        found += near
        false += len(contacts.touching) - near
    return false, found, missed, errors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=100, help="number of the first scene")
    parser.add_argument("--scenes", type=int, default=6)
    parser.add_argument("--fixed", action="store_true", help="do not estimate a body force")
    parser.add_argument("--fps", type=float, default=30.0, help="frames per second")
    args = parser.parse_args()
    estimator = MechanicsEstimator()
    if args.fixed:
        fit = estimator.gauss_newton
        fixed = replace(fit, body_force=replace(fit.body_force, std_g=0.0))
        estimator = replace(estimator, gauss_newton=fixed)
    totals, every = np.zeros(3, dtype=np.int64), list[float]()
    for number in range(args.first, args.first + args.scenes):
        scene = simulated(number, args.fps)
        if scene is None:
            print(f"{number}: no equilibrium was found", flush=True)
            continue
        *counts, errors = figures(scene, estimator)
        totals += counts
        every += errors
        print(
            "{}: turned by {:.2f} mm; {} false, {} found, {} missed; force {:.1%}".format(
                number, scene.moved_mm, *counts, np.median(np.abs(errors)) if errors else np.nan
            ),
            flush=True,
        )
    false, found, missed = totals.tolist()
    precision, recall = found / max(found + false, 1), found / max(found + missed, 1)
    median, most = np.percentile(np.abs(every), [50, 95]) if every else (np.nan, np.nan)
    print(f"all: precision {precision:.1%}, recall {recall:.1%}; force median {median:.1%}, 95 % {most:.1%}")


if __name__ == "__main__":
    main()
