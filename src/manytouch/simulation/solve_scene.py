"""A scene file, solved: from bodies on their trajectories to the simulated sensor."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from manytouch.errors import SourceError
from manytouch.simulation.fem.cache import StateCache, problem_keys, user_cache
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.sheet import SheetModel, SolidModel
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation, flat
from manytouch.simulation.scene.deformation_file import read_deformations
from manytouch.simulation.scene.file import SceneFile
from manytouch.simulation.scene.motion import keyframe_times, loading, poses
from manytouch.simulation.scene.pad import markers_mm, pad_solid, rubber
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.shell.energy import PosedIndenter
from manytouch.simulation.shell.live_sheet import LiveSheet
from manytouch.simulation.simulator import Simulator
from manytouch.simulation.views import ViewsSimulator
from manytouch.values.arrays import Scalars

STATES_VARIABLE = "MANYTOUCH_STATES"
MOST_STEPS = 200
MOST_PULL = 0.2
"""Largest pull of a body over the largest force so far; friction on a steep flank can pull a little."""
LEAST_PULL_N = 1e-6
LIBRARY = files("manytouch.simulation") / "library"


def states_folder() -> Path:
    """The user's folder of solved states: $MANYTOUCH_STATES, or a part of the user's cache."""
    chosen = os.environ.get(STATES_VARIABLE)
    return Path(chosen).expanduser() if chosen else user_cache() / "states"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SolidProblem:
    """The problem of a scene that the finite elements solve.

    Attributes:
        model: the sheet and its mesh.
        time_s: (k,) of the keyframes.
        loading: its steps are the keyframes; None where nothing ever presses.
        keys: one name for each keyframe, under which it is kept.
        pad_markers_mm: from the bonded face to the markers; None for a clamped sheet.
        pitch_mm: geometric mean of the pitches of the markers, which defines the regions of contacts.
    """

    model: SolidModel
    time_s: Scalars
    loading: Loading | None
    keys: tuple[str, ...]
    pad_markers_mm: float | None
    pitch_mm: float

    def states(self, folder: Path) -> Iterator[Deformation]:
        """Every keyframe in turn, solved where it is not yet in the folder."""
        if self.loading is None:
            return
        for state in StateCache(folder=folder).states(self.model, self.loading):
            yield condense(state, self.loading, pad_markers_mm=self.pad_markers_mm, pitch_mm=self.pitch_mm)


def solid_problem(scene: SceneFile) -> SolidProblem:
    """The problem of a scene that the finite elements solve."""
    sheet, mesh = scene.sheet, scene.mesh
    time_s = keyframe_times(scene.bodies, scene.duration_s, step_mm=mesh.step_mm)
    load = loading(scene.bodies, time_s, thickness_mm=sheet.thickness_mm) if scene.bodies else None
    model: SolidModel
    if sheet.boundary == "bonded":
        model = pad_solid(
            sheet,
            load,
            element_mm=mesh.element_mm,
            contact_element_mm=mesh.contact_element_mm,
            layers=mesh.layers,
        )
    else:
        model = SheetModel(
            size_mm=(float(sheet.size_mm[0]), float(sheet.size_mm[1])),
            thickness_mm=sheet.thickness_mm,
            material=rubber(sheet),
            pretension_N_per_mm=sheet.pretension_N_per_mm or 0.0,
            element_mm=mesh.element_mm,
            layers=mesh.layers,
        )
    keys = () if load is None else tuple(problem_keys(model, load))
    return SolidProblem(
        model=model,
        time_s=time_s,
        loading=load,
        keys=keys,
        pad_markers_mm=markers_mm(sheet),
        pitch_mm=float(np.sqrt(np.prod(scene.layout.pitch_mm))),
    )


def shipped_states(name: str, keys: tuple[str, ...]) -> tuple[Deformation, ...] | None:
    """The states that the package ships for a built-in scene; None where that problem is another one."""
    path = LIBRARY / f"{name}.npz"
    if not path.is_file():
        return None
    known = read_deformations(path)
    return tuple(known[key] for key in keys) if all(key in known for key in keys) else None


def solve_scene(scene: SceneFile, folder: Path) -> Iterator[Deformation]:
    """The states at the keyframes of a scene, one by one: shipped, kept in a folder, or solved now.

    Raises:
        SourceError: no equilibrium is found, or a body has passed through the sheet and pulls it.
        OutputError: the folder cannot be written.
    """
    if scene.mechanics == "shell":
        yield from _solved_live(scene)
        return
    problem = solid_problem(scene)
    shipped = shipped_states(scene.name, problem.keys) if problem.keys else None
    if shipped is not None:
        yield from shipped
        return
    yield from checked(scene.name, problem.time_s, problem.states(folder))


def checked(name: str, time_s: Scalars, states: Iterable[Deformation]) -> Iterator[Deformation]:
    """The states at keyframes, of a scene with this name, as long as they are equilibria of pressed sheets.

    Raises:
        SourceError: see `solve_scene`.
    """
    most_N = 0.0
    for at_s, state in zip(time_s.tolist(), states, strict=False):
        if state.status != "ok":
            raise SourceError(
                f"the scene {name!r} could not be solved beyond {at_s:.2f} s: press less deep there, "
                "or take smaller elements or steps in [solid]"
            )
        normal_N = np.array([contact.normal_force_N for contact in state.contacts])
        most_N = max(most_N, float(np.abs(normal_N).max(initial=0.0)))
        if normal_N.min(initial=0.0) < -max(MOST_PULL * most_N, LEAST_PULL_N):
            raise SourceError(
                f"in the scene {name!r}, body {int(normal_N.argmin()) + 1} has passed through the sheet and "
                f"pulls it at {at_s:.2f} s: take smaller elements or steps in [solid], or press less deep"
            )
        yield state


def state_count(scene: SceneFile) -> int:
    """How many states `solve_scene` gives."""
    return len(solid_problem(scene).time_s) if scene.bodies else 0


def _solved_live(scene: SceneFile) -> Iterator[Deformation]:
    """The states at the keyframes of a scene as the live sheet finds them, each on its own."""
    sheet, thickness_mm = LiveSheet(scene.sheet), scene.sheet.thickness_mm
    pitch_mm = float(np.sqrt(np.prod(scene.layout.pitch_mm)))
    for time_s in solid_problem(scene).time_s.tolist() if scene.bodies else ():
        bodies = [
            PosedIndenter(indenter=body.indenter, position_mm=position_mm, rotation_vector=rotation_vector)
            for body, position_mm, rotation_vector in poses(scene.bodies, time_s, thickness_mm=thickness_mm)
        ]
        for _ in range(3):  # thickness follows from call to call
            sheet.settle(bodies, max_evaluations=MOST_STEPS)
        yield sheet.deformation(pitch_mm)


def simulator(scene: SceneFile, states: tuple[Deformation, ...]) -> Simulator | ViewsSimulator:
    """The simulated sensor of a scene and all its states."""
    kind = ViewsSimulator if scene.sensor.camera.views else Simulator
    return kind(
        sensor=scene.sensor,
        scene=solid_scene(scene, states),
        fps=scene.fps,
        look=scene.look,
        optics=scene.optics,
        faults=scene.faults,
    )


def solid_scene(scene: SceneFile, states: tuple[Deformation, ...]) -> SolidScene:
    """A scene and all its states as the sheet in time."""
    time_s = solid_problem(scene).time_s
    if not scene.bodies:
        x, y = (float(size) for size in scene.sheet.size_mm)
        states = (flat((x, y)),) * len(time_s)
    return SolidScene(
        name=scene.name, time_s=time_s, states=states, seed=scene.seed, duration_s=scene.duration_s
    )
