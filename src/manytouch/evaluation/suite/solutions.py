"""Solved cases: those that ship with the package, and those kept in a folder.

One file per case, named after everything its states depend on. A file that ships is named after the
case alone; one that was solved here also after the code that solved it.
"""

import hashlib
import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.evaluation.suite import pressing
from manytouch.evaluation.suite.cases import RAMP_FRAMES, Case
from manytouch.evaluation.suite.pads.cases import PadCase
from manytouch.evaluation.suite.pressing import sheet_model, solve_presses
from manytouch.evaluation.suite.varied import solving
from manytouch.evaluation.suite.varied.cases import VariedCase
from manytouch.evaluation.suite.varied.solving import problem_key, solve_varied
from manytouch.evaluation.suite.workers import RunObserver, run_tasks
from manytouch.simulation.fem.cache import code_revision
from manytouch.simulation.fem.elements.mesh import reference_nodes
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation
from manytouch.simulation.scene.deformation_file import read_deformations, write_deformations

SHIPPED = "deformations"


@dataclass(frozen=True, slots=True, kw_only=True)
class Solutions:
    """The states of cases, step by step.

    Attributes:
        folder: where what is solved is kept; safe to share between processes.
    """

    folder: Path

    def known(self, case: Case) -> tuple[Deformation, ...] | None:
        """The states of a case, fewer than `state_count` where no equilibrium was found; None: not solved."""
        for path in (files("manytouch.evaluation") / SHIPPED / shipped_name(case), self._path(case)):
            found = _read(path)
            if found is not None:
                return found
        return None

    def solve(self, case: Case) -> tuple[Deformation, ...]:
        """Solve a case and keep it.

        The varied cases of both groups are the same presses, so that they are solved once.

        Raises:
            OutputError: the folder cannot be written.
            MissingExtraError: scikit-fem is not installed.
        """
        states = []
        for state in _solve(case):
            states.append(state)
            if state.status != "ok":
                break
        keep(self._path(case), states)
        return tuple(state for state in states if state.status == "ok")

    def _path(self, case: Case) -> Path:
        code = inspect.getsource(solving if isinstance(case, VariedCase) else pressing)
        return self.folder / _name(case, code_revision(), code)


def solve_missing(
    cases: Sequence[Case],
    solutions: Solutions,
    *,
    observer: RunObserver | None = None,
    stop: Callable[[], bool] | None = None,
    processes: int = 1,
) -> None:
    """Solve the cases that are not known; one that was begun is kept when it is whole. Pads all ship.

    Raises:
        OutputError: the folder cannot be written.
        MissingExtraError: scikit-fem is not installed.
    """
    sheets = [case for case in cases if not isinstance(case, PadCase)]
    unique = {shipped_name(case): case for case in sheets}  # two groups have the same varied presses
    missing = [case for case in unique.values() if solutions.known(case) is None]
    if not missing:
        return
    reference_nodes()  # raises here what is missing, before other processes begin
    if observer is not None:
        observer.report(
            f"{len(missing)} of {len(cases)} cases are to be solved first; kept in {solutions.folder}"
        )
        observer.begin("solving", len(missing))
    for number, states in run_tasks(solutions.solve, missing, processes=processes, stop=stop):
        if observer is not None:
            words = f"{len(states)} of {state_count(missing[number])} states in balance"
            observer.done(missing[number].title, words)


def state_count(case: Case) -> int:
    """States of a case that is solved."""
    return case.state_count if isinstance(case, VariedCase) else RAMP_FRAMES


def _solve(case: Case) -> Iterator[Deformation]:
    if isinstance(case, VariedCase):
        yield from solve_varied(case)
        return
    for step in solve_presses(case):
        yield condense(step.state, step.loading)


def keep(path: Path, states: list[Deformation]) -> None:
    """Write the states in balance, or the first one, which is then not, when there are none."""
    in_balance = [state for state in states if state.status == "ok"]
    write_deformations(path, {str(step): state for step, state in enumerate(in_balance or states[:1])})


def shipped_name(case: Case) -> str:
    """The file of a case in the package."""
    return _name(case)


def _name(case: Case, *more: str) -> str:
    """Title and a hash of all that decides how the sheet deforms."""
    if isinstance(case, VariedCase):
        key = hashlib.sha256("\n".join([problem_key(case), *more]).encode()).hexdigest()
        return f"varied-{case.name}-{key[:12]}.npz"
    depends = (
        repr(sheet_model(case)),
        repr((RAMP_FRAMES, case.touches, case.strength_is, case.deepest_mm, case.friction)),
        repr(case.seed if case.friction else None),
        *more,
    )
    key = hashlib.sha256("\n".join(depends).encode()).hexdigest()
    return f"{case.group}-{case.name}-{key[:12]}.npz"


def _read(path: Path | Traversable) -> tuple[Deformation, ...] | None:
    if not path.is_file():
        return None
    try:
        states = read_deformations(path).values()
    except SourceError:
        return None  # damaged: solved again
    return tuple(state for state in states if state.status == "ok")
