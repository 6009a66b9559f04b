"""A plate on a pad: forces from images of its own model, and what the benchmark needs of a folder."""

import sys
from pathlib import Path

import numpy as np
import pytest

from bonded_pad import YOUNG_MPA, pad_sensor

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

import real_pads  # noqa: E402
from plate_contact import MODES, PlateContact  # noqa: E402
from plate_load import PlateModel, plate_forces, plate_model, young_MPa  # noqa: E402

from manytouch.values.sensor_file.read import load_sensor  # noqa: E402


@pytest.fixture(scope="module")
def model() -> PlateModel:
    return plate_model(pad_sensor())


def lifted(contact: PlateContact, motion_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) the nodes that a plate leaves, and (3 n, MODES) nodal forces over E."""
    is_free = contact.free_nodes(motion_mm, np.zeros(len(contact.place_mm), dtype=bool))
    return is_free, contact.nodal(is_free)


def test_a_plate_resists_and_shows_its_forces(model: PlateModel) -> None:
    force = model.contact.forces(model.contact.held)
    assert (np.diag(force[:, :3]) > 0.0).all()
    assert force[2, 2] > 4.0 * force[0, 0]
    np.testing.assert_allclose(force[:2, 2], 0.0, atol=1e-6 * force[2, 2])


def test_a_tilted_plate_presses_on_one_side_and_is_above_the_face_on_the_other(model: PlateModel) -> None:
    contact = model.contact
    motion_mm = np.array([0.02, 0.0, 0.05, 0.15, 0.0, 0.0])
    is_free, nodal = lifted(contact, motion_mm)
    force = (nodal @ motion_mm).reshape(-1, 3)
    np.testing.assert_allclose(force[is_free, 2], 0.0, atol=1e-9 * np.abs(force).max())
    assert (force[~is_free, 2] <= 0.0).all()
    off_mm = np.linalg.solve(contact.stiffness, (nodal - contact.held) @ motion_mm).reshape(-1, 3)
    np.testing.assert_allclose(off_mm[~is_free], 0.0, atol=1e-9)
    assert (off_mm[is_free, 2] < 0.0).all()  # below the plate
    assert contact.place_mm[is_free, 0].min() > contact.place_mm[~is_free, 0].mean()


def test_free_nodes_do_not_depend_on_the_guess(model: PlateModel) -> None:
    motion_mm = np.array([0.0, 0.0, 0.03, 0.1, -0.12, 0.0])
    from_none, _ = lifted(model.contact, motion_mm)
    assert 0.1 < from_none.mean() < 0.6
    from_all = model.contact.free_nodes(motion_mm, np.ones_like(from_none))
    np.testing.assert_array_equal(from_all, from_none)


def test_a_plate_that_is_only_lifted_does_not_press(model: PlateModel) -> None:
    is_free, nodal = lifted(model.contact, np.array([0.0, 0.0, -0.1, 0.0, 0.0, 0.0]))
    assert is_free.all()
    largest = np.abs(model.contact.forces(model.contact.held)).max()
    np.testing.assert_allclose(model.contact.forces(nodal)[2], 0.0, atol=1e-9 * largest)


@pytest.mark.parametrize("motion_mm", [(0.02, 0.0, 0.02, 0.15, 0.05, 0.0), (0.0, 0.05, 0.0, 0.15, 0.0, 0.0)])
def test_the_force_of_a_plate_that_leaves_one_side_is_found(motion_mm: tuple[float, ...]) -> None:
    """With a plate that also pulls, normal forces would be a quarter to a half too small."""
    model, motion = plate_model(load_sensor(real_pads.SENSOR)), np.array(motion_mm)
    is_free, nodal = lifted(model.contact, motion)
    assert 0.2 < is_free.mean() < 0.8
    true = model.contact.forces(nodal) @ motion
    moved_px = (motion @ model.contact.images(nodal)).reshape(1, -1, 2)
    moved_px += np.random.default_rng(5).normal(0.0, 0.005, moved_px.shape)
    found = plate_forces(model, moved_px)
    np.testing.assert_allclose(found.force[0], true, atol=0.03 * true[2])


def test_markers_in_the_middle_that_hardly_move_do_not_decide() -> None:
    """The error of the model is as large there as around them."""
    model = plate_model(load_sensor(real_pads.SENSOR))
    motion_mm = np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    clean_px = (motion_mm @ model.contact.images(model.contact.held)).reshape(-1, 2)
    true = model.contact.forces(model.contact.held)[2] @ motion_mm
    error_px = 0.2 * np.sqrt(model.around @ (clean_px**2).sum(axis=1) / 2.0)[:, None]
    random = np.random.default_rng(7)
    moved_px = clean_px + error_px * random.normal(size=(12, *clean_px.shape))
    off = plate_forces(model, moved_px).force[:, 2] / true - 1.0
    assert np.sqrt(np.mean(off**2)) < 0.045
    assert abs(np.mean(off)) < 0.02


def moved_by(model: PlateModel, force_N: np.ndarray, view: np.ndarray) -> np.ndarray:
    """(m, 2) images of a plate under a force that presses everywhere, seen by a view that moved."""
    contact, motion_mm = model.contact, np.zeros(MODES)
    motion_mm[:3] = np.linalg.solve(contact.forces(contact.held)[:, :3], force_N / YOUNG_MPA)
    return (motion_mm @ contact.images(contact.held) + view @ model.view).reshape(-1, 2)


def test_forces_are_found_whatever_the_view_did(model: PlateModel) -> None:
    random = np.random.default_rng(3)
    true_N = np.array([[0.0, 0.0, 6.0], [0.5, -0.3, 4.0], [0.0, 0.0, 18.0], [-1.0, 1.0, 9.0]])
    view = np.array([[0.3, 0.3, 2e-3, 2e-3], [0.3, -0.3, -2e-3, 0], [0, 0.2, 2e-3, 0], [-0.3, 0, 0, -4e-3]])
    moved_px = np.array([moved_by(model, *case) for case in zip(true_N, view, strict=True)])
    moved_px += random.normal(0.0, 0.005, moved_px.shape)
    moved_px[1, 5] = np.nan
    found = plate_forces(model, moved_px)
    young, share = young_MPa(found, [0, 2], true_N[:, 2])
    assert young == pytest.approx(YOUNG_MPA, rel=0.1)
    std_N = young * np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    off_N = young * found.force - true_N
    assert (np.abs(off_N) < 2.0 * np.hypot(std_N, share * np.abs(true_N))).all()
    assert (std_N[:, :2] < 0.6).all()


def test_a_regression_predicts_each_case_from_the_others() -> None:
    random = np.random.default_rng(0)
    rest_px = random.uniform(0.0, 200.0, (30, 2))
    away = rest_px - rest_px.mean(axis=0)
    force_N = random.uniform(-1.0, 1.0, (8, 3))
    moved_px = force_N[:, None, :2] * 0.5 + force_N[:, 2, None, None] * 0.01 * away
    np.testing.assert_allclose(real_pads.regression(moved_px, rest_px, force_N), force_N, atol=1e-9)


def test_a_folder_without_labels_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["real_pads.py", str(tmp_path)])
    assert real_pads.main() == 1
    assert "has no labels.csv" in capsys.readouterr().err


def test_cases_are_read_with_the_unloaded_one_first(tmp_path: Path) -> None:
    head = "file,mass_g,theta_x_deg,theta_z_deg,repeat,shear_x_N,shear_z_N,normal_N\n"
    rows = ["b0.jpg,700,15,0,0,1.8,0,6.6", "b1.jpg,700,15,0,1,1.8,0,6.6", "a0.jpg,0,0,0,0,0,0,0"]
    (tmp_path / "labels.csv").write_text(head + "\n".join(rows) + "\n")
    unloaded, tilted = real_pads.read_cases(tmp_path)
    assert unloaded.force_N.tolist() == [0.0, 0.0, 0.0]
    assert [path.name for path in tilted.images] == ["b0.jpg", "b1.jpg"]
    assert not tilted.is_straight
