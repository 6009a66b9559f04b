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
from plate_load import MODES, PlateModel, plate_forces, plate_model, young_MPa  # noqa: E402

from manytouch.values.sensor_file.read import load_sensor  # noqa: E402


@pytest.fixture(scope="module")
def model() -> PlateModel:
    return plate_model(pad_sensor())


def moved_by(model: PlateModel, force_N: np.ndarray, view: np.ndarray) -> np.ndarray:
    """(m, 2) images of a plate under a force, seen by a view that moved."""
    rigid = np.zeros(MODES)
    rigid[:3] = np.linalg.solve(model.force[:, :3], force_N / YOUNG_MPA)
    return (rigid @ model.image + view @ model.view).reshape(-1, 2)


def test_a_plate_resists_and_shows_its_forces(model: PlateModel) -> None:
    assert (np.diag(model.force[:, :3]) > 0.0).all()
    assert model.force[2, 2] > 4.0 * model.force[0, 0]
    np.testing.assert_allclose(model.force[:2, 2], 0.0, atol=1e-6 * model.force[2, 2])


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


def test_markers_in_the_middle_that_hardly_move_do_not_decide() -> None:
    """The error of the model is as large there as around them."""
    model = plate_model(load_sensor(real_pads.SENSOR))
    motion_mm = np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    clean_px, true = (motion_mm @ model.image).reshape(-1, 2), model.force[2] @ motion_mm
    error_px = 0.2 * np.sqrt(model.around @ (clean_px**2).sum(axis=1) / 2.0)[:, None]
    random = np.random.default_rng(7)
    moved_px = clean_px + error_px * random.normal(size=(12, *clean_px.shape))
    off = plate_forces(model, moved_px).force[:, 2] / true - 1.0
    assert np.sqrt(np.mean(off**2)) < 0.045
    assert abs(np.mean(off)) < 0.02


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
