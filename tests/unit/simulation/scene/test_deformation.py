"""A solved sheet in brief, and many of them in a file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.simulation.fem.contact.forces import touched_face
from manytouch.simulation.fem.contact.indenters import RoundPunch, Sphere
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import Loading, PressurePatch, press
from manytouch.simulation.fem.sheet import SheetModel, sheet_solver, solve_sheet
from manytouch.simulation.fem.state import SheetState
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation, TrueContact
from manytouch.simulation.scene.deformation_file import STEP_MM, read_deformations, write_deformations

MODEL = SheetModel(
    size_mm=(30.0, 22.0), thickness_mm=3.0, material=NeoHooke(young_MPa=3.1, poisson=0.45), element_mm=2.0
)
DEPTH_MM = np.array([0.4, 1.0, 1.5])
PLACE_MM = np.random.default_rng(0).uniform(-1.0, 1.0, (500, 2)) * [15.0, 11.0]


def path(x: float, y: float, depth_mm: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(depth_mm), x), np.full(len(depth_mm), y), depth_mm])


LOADING = Loading(
    touches=(
        press(Sphere(radius_mm=4.0), thickness_mm=3.0, path_mm=path(-6.0, 2.0, DEPTH_MM)),
        press(RoundPunch(radius_mm=3.0), thickness_mm=3.0, path_mm=path(7.0, -2.0, DEPTH_MM - 0.9)),
    ),
    patches=(
        PressurePatch(
            centre_mm=(0.0, 6.0), size_mm=(6.0, 4.0), force_N=np.array([[0.0, 0.0, -0.5]] * len(DEPTH_MM))
        ),
    ),
)


@pytest.fixture(scope="module")
def states() -> list[SheetState]:
    return list(solve_sheet(sheet_solver(MODEL), LOADING))


def test_it_moves_every_place_as_the_finite_elements_do(states: list[SheetState]) -> None:
    for state in states:
        brief = condense(state, LOADING)
        displacement_mm, gradient = state.camera_side(PLACE_MM)
        found_mm, slope = brief.camera_side(PLACE_MM)
        np.testing.assert_allclose(found_mm, displacement_mm, atol=1e-6)
        np.testing.assert_allclose(slope, gradient[:, :, :2], atol=2e-6)
        np.testing.assert_array_equal(brief.displacement_mm(PLACE_MM), found_mm)


def test_outside_the_sheet_nothing_is_known(states: list[SheetState]) -> None:
    outside_mm = np.array([[15.01, 0.0], [0.0, -11.01], [15.0, 11.0]])
    moved_mm, slope = condense(states[0], LOADING).camera_side(outside_mm)
    assert np.isnan(moved_mm[:2]).all()
    assert np.isnan(slope[:2]).all()
    np.testing.assert_array_equal(moved_mm[2], 0.0)


def test_contacts_keep_their_forces_and_know_their_depth(states: list[SheetState]) -> None:
    ball, punch, patch = condense(states[-1], LOADING).contacts
    kept = states[-1].contacts
    assert [contact.normal_force_N for contact in (ball, punch, patch)] == [
        contact.normal_force_N for contact in kept
    ]
    assert ball.is_touching
    np.testing.assert_allclose(ball.centre_mm, kept[0].centre_mm)
    rest_mm = touched_face(states[-1].mesh).rest_mm[:, :, :2]
    for number, contact in enumerate((ball, punch)):
        pressed = states[-1].pressure_MPa[number] > 0.0
        depth_mm = -states[-1].camera_side(rest_mm[pressed])[0][:, 2].min()
        assert contact.depth_mm == pytest.approx(depth_mm, abs=0.02)
    assert (
        punch.depth_mm < -states[-1].camera_side(np.array([[4.5, -2.0]]))[0][0, 2]
    )  # it presses on one edge
    spot_mm = np.random.default_rng(2).uniform(-3.0, 3.0, (4000, 2))
    spot_mm = spot_mm[np.linalg.norm(spot_mm / [3.0, 2.0], axis=1) < 1.0] + [0.0, 6.0]
    assert patch.depth_mm == pytest.approx(-states[-1].camera_side(spot_mm)[0][:, 2].min(), abs=0.02)


def test_what_does_not_touch_has_no_force_and_no_place(states: list[SheetState]) -> None:
    punch = condense(states[0], LOADING).contacts[1]
    assert not punch.is_touching
    assert np.isnan([punch.depth_mm, *punch.centre_mm]).all()


def test_rounding_is_no_contact(states: list[SheetState]) -> None:
    """A body that has left may keep a force far below what is out of balance."""
    last = states[-1]
    ball, *others = last.contacts
    for force_N, is_touching in ((3e-17, False), (2e-9, True)):
        left = replace(ball, force_N=np.array([0.0, 0.0, -force_N]))
        state = replace(last, contacts=(left, *others), residual_N=1e-9)
        found = condense(state, LOADING).contacts
        assert found[0].is_touching == is_touching
        assert np.isnan(found[0].depth_mm) != is_touching
        assert found[1].is_touching


def test_a_file_keeps_the_contact_face_of_a_pad(states: list[SheetState], tmp_path: Path) -> None:
    sheets = [condense(state, LOADING) for state in states]
    pads = {f"{n}": replace(one, contact_face_mm=1.5 * one.face_mm) for n, one in enumerate(sheets)}
    write_deformations(tmp_path / "a.npz", {**pads, "sheet": sheets[0]})
    found = read_deformations(tmp_path / "a.npz")
    assert list(found) == [*pads, "sheet"]
    assert found["sheet"].contact_face_mm is None
    assert found["sheet"].touched is found["sheet"]
    for key, pad in pads.items():
        mine = found[key]
        assert mine.contact_face_mm is not None
        np.testing.assert_allclose(mine.face_mm[::2, ::2], pad.face_mm[::2, ::2], atol=0.6 * STEP_MM)
        wanted_mm = pad.touched.face_mm[::2, ::2]
        np.testing.assert_allclose(mine.touched.face_mm[::2, ::2], wanted_mm, atol=0.6 * STEP_MM)
        assert [one.depth_mm for one in mine.touched.contacts] == [one.depth_mm for one in mine.contacts]


def test_a_file_gives_back_what_it_was_given(states: list[SheetState], tmp_path: Path) -> None:
    given = {f"{number}": condense(state, LOADING) for number, state in enumerate(states)}
    size = write_deformations(tmp_path / "a.npz", given)
    found = read_deformations(tmp_path / "a.npz")
    assert size == (tmp_path / "a.npz").stat().st_size < 0.6 * 2 * 3 * 3 * 31 * 23  # 16-bit numbers
    assert list(found) == list(given)
    for key, state in found.items():
        nodal = given[key].face_mm.copy()
        nodal[1::2, 1::2] = state.face_mm[1::2, 1::2]
        np.testing.assert_allclose(state.face_mm, nodal, atol=0.5 * STEP_MM + 1e-6)
        moved_mm = given[key].displacement_mm(PLACE_MM)
        np.testing.assert_allclose(state.displacement_mm(PLACE_MM), moved_mm, atol=1.25 * STEP_MM)
        for mine, other in zip(state.contacts, given[key].contacts, strict=True):
            np.testing.assert_array_equal(mine.force_N, other.force_N)
            np.testing.assert_array_equal(mine.centre_mm, other.centre_mm)
            np.testing.assert_equal(
                (mine.depth_mm, mine.area_mm2, mine.torque_Nmm),
                (other.depth_mm, other.area_mm2, other.torque_Nmm),
            )
        assert state.status == "ok"
    again = {key: found[key] for key in reversed(found)}
    write_deformations(tmp_path / "b.npz", again)
    for key, state in read_deformations(tmp_path / "b.npz").items():
        np.testing.assert_array_equal(state.face_mm, found[key].face_mm)


def test_the_largest_displacements_come_back_too(tmp_path: Path) -> None:
    chance = np.random.default_rng(1)
    wild = Deformation(
        x_mm=np.linspace(-2.0, 2.0, 5),
        y_mm=np.linspace(-3.0, 3.0, 7),
        face_mm=chance.uniform(-40.0, 40.0, (5, 7, 3)).astype(np.float32),
        contacts=(
            TrueContact(
                force_N=np.zeros(3),
                torque_Nmm=np.nan,
                area_mm2=0.0,
                centre_mm=np.full(2, np.nan),
                depth_mm=np.nan,
            ),
        ),
        status="not_converged",
    )
    write_deformations(tmp_path / "wild.npz", {"a": wild, "b": replace(wild, face_mm=-wild.face_mm)})
    found = read_deformations(tmp_path / "wild.npz")
    np.testing.assert_allclose(found["a"].face_mm[::2], wild.face_mm[::2], atol=0.5 * STEP_MM + 1e-5)
    np.testing.assert_allclose(found["b"].face_mm[::2], -wild.face_mm[::2], atol=0.5 * STEP_MM + 1e-5)
    assert found["a"].status == "not_converged"
    assert not found["a"].contacts[0].is_touching


def test_different_sheets_do_not_share_a_file(states: list[SheetState], tmp_path: Path) -> None:
    one = condense(states[0], LOADING)
    other = replace(one, x_mm=one.x_mm * 2.0)
    with pytest.raises(ValueError, match="one sheet"):
        write_deformations(tmp_path / "a.npz", {"a": one, "b": other})


def test_a_damaged_or_missing_file_is_an_error(states: list[SheetState], tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    with pytest.raises(SourceError, match="cannot read deformations"):
        read_deformations(file)
    write_deformations(file, {"a": condense(states[0], LOADING)})
    whole = file.read_bytes()
    for damaged in (whole[: len(whole) // 2], whole[:-2000] + bytes(2000), b"nothing"):
        file.write_bytes(damaged)
        with pytest.raises(SourceError, match="damaged"):
            read_deformations(file)
