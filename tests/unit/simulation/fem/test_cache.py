"""Kept states: the same as solved ones, and found only for the same problem."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import manytouch.simulation.fem.cache as cache_module
from manytouch.errors import OutputError
from manytouch.simulation.fem.cache import StateCache, problem_keys, step_keys, user_cache
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import Loading, PressurePatch, press
from manytouch.simulation.fem.sheet import SheetModel
from manytouch.simulation.fem.solver.newton import NewtonSolver

MODEL = SheetModel(size_mm=(12.0, 10.0), thickness_mm=3.0, material=NeoHooke(young_MPa=1.0, poisson=0.45))


def pressing(*depths_mm: float, radius_mm: float = 4.0, friction: float = 0.2) -> Loading:
    path = np.array([[0.2, 0.1, depth] for depth in depths_mm])
    return Loading(
        touches=(press(Sphere(radius_mm=radius_mm), thickness_mm=3.0, path_mm=path, friction=friction),)
    )


def test_a_kept_state_is_the_solved_one_and_is_not_solved_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = StateCache(folder=tmp_path / "states")
    solved = list(cache.states(MODEL, pressing(0.3, 0.6)))
    assert len(list(cache.folder.iterdir())) == 2
    longer = list(cache.states(MODEL, pressing(0.3, 0.6, 0.8)))
    np.testing.assert_array_equal(longer[1].displacement_mm, solved[1].displacement_mm)
    np.testing.assert_array_equal(longer[1].contacts[0].force_N, solved[1].contacts[0].force_N)
    assert (longer[1].status, longer[1].newton_steps) == (solved[1].status, solved[1].newton_steps)

    def refuse(*_: object) -> None:
        raise AssertionError("solved again")

    monkeypatch.setattr(NewtonSolver, "step", refuse)
    again = list(cache.states(MODEL, pressing(0.3, 0.6, 0.8)))
    np.testing.assert_array_equal(again[2].shear_MPa, longer[2].shear_MPa)


def test_going_on_from_a_kept_state_gives_the_same_bits(tmp_path: Path) -> None:
    whole = list(StateCache(folder=tmp_path / "whole").states(MODEL, pressing(0.3, 0.6)))
    part = StateCache(folder=tmp_path / "part")
    list(part.states(MODEL, pressing(0.3)))
    resumed = list(part.states(MODEL, pressing(0.3, 0.6)))
    np.testing.assert_array_equal(resumed[1].displacement_mm, whole[1].displacement_mm)


def test_a_damaged_file_is_solved_again(tmp_path: Path) -> None:
    cache = StateCache(folder=tmp_path)
    solved = list(cache.states(MODEL, pressing(0.3)))
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[:100])
    again = list(cache.states(MODEL, pressing(0.3)))
    np.testing.assert_array_equal(again[0].displacement_mm, solved[0].displacement_mm)


def test_everything_that_matters_changes_the_key() -> None:
    same = step_keys(MODEL, pressing(0.3, 0.6))
    assert step_keys(MODEL, pressing(0.3, 0.6)) == same
    assert step_keys(MODEL, pressing(0.3, 0.7))[0] == same[0]
    patch = PressurePatch(centre_mm=(0.0, 0.0), size_mm=(3.0, 3.0), force_N=np.array([[0.0, 0.0, -1.0]]))
    others = [
        step_keys(MODEL, pressing(0.3, 0.7))[1],
        step_keys(MODEL, pressing(0.4, 0.6))[1],
        step_keys(MODEL, pressing(0.3, 0.6, radius_mm=4.5))[1],
        step_keys(MODEL, pressing(0.3, 0.6, friction=0.3))[1],
        step_keys(replace(MODEL, thickness_mm=2.5), pressing(0.3, 0.6))[1],
        step_keys(replace(MODEL, pretension_N_per_mm=0.01), pressing(0.3, 0.6))[1],
        step_keys(replace(MODEL, material=NeoHooke(young_MPa=1.1, poisson=0.45)), pressing(0.3, 0.6))[1],
        step_keys(MODEL, Loading(patches=(patch,)))[0],
        step_keys(MODEL, Loading(patches=(replace(patch, outline="rectangle"),)))[0],
        same[0],
        same[1],
    ]
    assert len(set(others)) == len(others)


def test_a_folder_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot keep"):
        list(StateCache(folder=tmp_path / "file").states(MODEL, pressing(0.3)))


def test_another_process_finds_the_same_keys() -> None:
    code = (
        "import numpy as np; from manytouch.simulation.fem import cache;"
        "from manytouch.simulation.fem.contact.indenters import Sphere;"
        "from manytouch.simulation.fem.loading import Loading, press;"
        "from manytouch.simulation.fem.elements.material import NeoHooke;"
        "from manytouch.simulation.fem.sheet import SheetModel;"
        "rubber = NeoHooke(young_MPa=1.0, poisson=0.45);"
        "model = SheetModel(size_mm=(12.0, 10.0), thickness_mm=3.0, material=rubber);"
        "path = np.array([[0.2, 0.1, 0.3]]);"
        "ball = press(Sphere(radius_mm=4.0), thickness_mm=3.0, path_mm=path, friction=0.2);"
        "print(cache.step_keys(model, Loading(touches=(ball,)))[0])"
    )
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert other.stdout.strip() == step_keys(MODEL, pressing(0.3))[0]


def test_a_problem_keeps_its_key_when_the_solver_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, solved = problem_keys(MODEL, pressing(0.3, 0.6)), step_keys(MODEL, pressing(0.3, 0.6))
    monkeypatch.setattr(cache_module, "code_revision", lambda: "another")
    assert problem_keys(MODEL, pressing(0.3, 0.6)) == problem
    assert set(step_keys(MODEL, pressing(0.3, 0.6))).isdisjoint(solved)
    assert problem_keys(MODEL, pressing(0.3, 0.7))[1] != problem[1]


def test_the_cache_of_the_user_follows_the_system(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert user_cache() == tmp_path / "manytouch"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert user_cache() == tmp_path / ".cache" / "manytouch"
