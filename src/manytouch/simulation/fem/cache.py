"""Solved states on disk, each under a key of all that it depends on, so that nothing is solved twice.

The key of a step is a hash of the sheet, of the loading up to and with that step, and of the code of
this package (its syntax tree without docstrings: comments and layout change nothing). A longer
trajectory with the same beginning reuses it.
"""

import ast
import hashlib
import os
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path

import numpy as np
import platformdirs

from manytouch.errors import OutputError
from manytouch.simulation.fem.elements.mesh import HexMesh
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.sheet import SolidModel, sheet_solver
from manytouch.simulation.fem.solver.newton import NewtonSolver
from manytouch.simulation.fem.state import ContactForce, SheetState
from manytouch.values.arrays import read_only

NOT_CODE_OF_STATES = ("__init__.py", "cache.py", "sampling.py")


def user_cache() -> Path:
    """The user's folder for what can be computed again, by the convention of the system."""
    return platformdirs.user_cache_path("manytouch", appauthor=False)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StateCache:
    """A folder of solved states, one `.npz` each; safe to share between processes."""

    folder: Path

    def states(self, model: SolidModel, loading: Loading) -> Iterator[SheetState]:
        """The states of all steps, read where they are known, solved and kept where not.

        Raises:
            OutputError: the folder cannot be written.
        """
        solver = sheet_solver(model)
        state = None
        for number, key in enumerate(step_keys(model, loading)):
            path = self.folder / f"{key}.npz"
            known = _read(path, solver.body.mesh)
            if known is None:
                known = solver.step(solver.start(loading) if state is None else state, loading, number)
                self._keep(path, known)
            state = known
            yield state

    def _keep(self, path: Path, state: SheetState) -> None:
        aside = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with aside.open("wb") as file:
                np.savez_compressed(file, allow_pickle=False, **_arrays(state))
            aside.replace(path)
        except OSError as error:
            raise OutputError(f"cannot keep a solved state in {self.folder}: {error.strerror}") from None


def step_keys(model: SolidModel, loading: Loading) -> list[str]:
    """A name for each step of all that its state depends on: the problem, the solver's settings and code."""
    return [_hash(code_revision(), _text(_settings()), key) for key in problem_keys(model, loading)]


def problem_keys(model: SolidModel, loading: Loading) -> list[str]:
    """A name for each step of its problem: the sheet and the loading up to and with that step.

    Unlike `step_keys` it stays when the solver changes; files that are shipped are looked up by it.
    """
    key = _hash(
        _text(model),
        *(_text(t.indenter) + repr(t.friction) for t in loading.touches),
        *(repr((patch.centre_mm, patch.size_mm, patch.outline)) for patch in loading.patches),
    )
    keys = []
    for number in range(loading.steps):
        poses = [row for t in loading.touches for row in (t.position_mm[number], t.rotation_vector[number])]
        forces = [patch.force_N[number] for patch in loading.patches]
        key = _hash(key, *(_text(row) for row in poses + forces))
        keys.append(key)
    return keys


def _settings() -> dict[str, object]:
    """The defaults of the solver's parameters."""
    return {item.name: repr(item.default) for item in fields(NewtonSolver) if item.default is not MISSING}


def _hash(*texts: str) -> str:
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:32]


def _text(value: object) -> str:
    """Every field of a value, arrays to the last bit."""
    if isinstance(value, np.ndarray):
        content = np.ascontiguousarray(value + 0.0).tobytes()  # + 0.0: -0.0 is 0.0
        return f"{value.shape}{value.dtype}{hashlib.sha256(content).hexdigest()}"
    if is_dataclass(value):
        inner = ",".join(f"{item.name}={_text(getattr(value, item.name))}" for item in fields(value))
        return f"{type(value).__name__}({inner})"
    return repr(value)


@cache
def code_revision() -> str:
    """A hash of the code that makes the states, without its docstrings."""
    trees = []
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        if path.name in NOT_CODE_OF_STATES:
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            match node:
                case ast.Expr(value=ast.Constant(value=str()) as docstring):
                    docstring.value = ""
        trees.append(ast.dump(tree))
    return _hash(*trees)


def _arrays(state: SheetState) -> dict[str, np.ndarray]:
    contacts = np.array(
        [[*c.force_N, c.torque_Nmm, c.area_mm2, *c.centre_mm, c.penetration_mm] for c in state.contacts]
    ).reshape(-1, 8)
    return {
        "displacement_mm": state.displacement_mm,
        "support_N": state.support_N,
        "contacts": contacts,
        "status": np.array(state.status),
        "course": np.array([state.reached, state.newton_steps, state.residual_N]),
        "dead_N": state.dead_N,
        "position_mm": state.position_mm,
        "rotation_vector": state.rotation_vector,
        "pressure_MPa": state.pressure_MPa,
        "shear_MPa": state.shear_MPa,
    }


def _read(path: Path, mesh: HexMesh) -> SheetState | None:
    """A kept state; None when there is none or it is damaged, then it is solved again."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            table = {name: read_only(file[name]) for name in file.files}
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError, ValueError):
        return None
    reached, newton_steps, residual_N = table["course"].tolist()
    same = (
        "displacement_mm",
        "support_N",
        "dead_N",
        "position_mm",
        "rotation_vector",
        "pressure_MPa",
        "shear_MPa",
    )
    return SheetState(
        mesh=mesh,
        contacts=tuple(_contact(row) for row in table["contacts"]),
        status=str(table["status"]),
        reached=reached,
        newton_steps=int(newton_steps),
        residual_N=residual_N,
        **{name: table[name] for name in same},
    )


def _contact(row: np.ndarray) -> ContactForce:
    return ContactForce(
        force_N=read_only(row[:3].copy()),
        torque_Nmm=float(row[3]),
        area_mm2=float(row[4]),
        centre_mm=read_only(row[5:7].copy()),
        penetration_mm=float(row[7]),
    )
