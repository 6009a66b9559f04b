"""The plate: known answers, symmetry, superposition, and derivatives that are derivatives."""

import numpy as np
import pytest

from manytouch.simulation.plate import PatchLoad, Plate, beam_functions, clamped_plate, patch_points
from manytouch.simulation.sensor import demo_sensor
from manytouch.values import Sheet

PLATE = Plate(size_mm=(120.0, 80.0), bending_stiffness_Nmm=8.7, pretension_N_per_mm=0.3)
SOME = np.array([[3.0, -7.0], [-41.0, 22.0], [55.0, 1.0], [-20.0, -35.0]])


def load(x: float, y: float, force_N: float = 1.0, radius_mm: float = 5.0) -> PatchLoad:
    return PatchLoad(centre_mm=(float(x), float(y)), radius_mm=radius_mm, force_N=force_N)


def depth(plate: Plate, loads: tuple[PatchLoad, ...], point_mm: np.ndarray) -> np.ndarray:
    return plate.modes_at(point_mm).field(plate.coefficients(loads)).depth_mm


def uniform(size_mm: tuple[float, float]) -> tuple[PatchLoad, ...]:
    """1 MPa as point loads at the points of a quadrature."""
    node, weight = np.polynomial.legendre.leggauss(24)
    half_x, half_y = size_mm[0] / 2, size_mm[1] / 2
    return tuple(
        load(half_x * x, half_y * y, half_x * half_y * float(wx * wy), 0.0)
        for x, wx in zip(node, weight, strict=True)
        for y, wy in zip(node, weight, strict=True)
    )


def test_clamped_square_under_a_point_load() -> None:
    plate = Plate(size_mm=(100.0, 100.0), bending_stiffness_Nmm=10.0)
    w = depth(plate, (load(0, 0, radius_mm=0.0),), np.zeros((1, 2)))[0]
    assert w * 10.0 / 100.0**2 == pytest.approx(0.00560, rel=2e-3)


@pytest.mark.parametrize(("size_mm", "expected"), [((80.0, 80.0), 0.001265), ((120.0, 80.0), 0.002197)])
def test_clamped_rectangle_under_uniform_load(size_mm: tuple[float, float], expected: float) -> None:
    plate = Plate(size_mm=size_mm, bending_stiffness_Nmm=10.0, functions=(16, 14))
    w = depth(plate, uniform(size_mm), np.zeros((1, 2)))[0]
    assert w * 10.0 / 80.0**4 == pytest.approx(expected, rel=2e-3)


def test_strong_pretension_gives_the_membrane() -> None:
    """Uniform load on a square membrane: w N / (q a^2) = 0.0737 (Timoshenko, torsion analogy)."""
    plate = Plate(
        size_mm=(80.0, 80.0), bending_stiffness_Nmm=1e-3, pretension_N_per_mm=1.0, functions=(31, 31)
    )
    w = depth(plate, uniform((80.0, 80.0)), np.zeros((1, 2)))[0]
    assert w / 80.0**2 == pytest.approx(0.0737, rel=0.03)  # the clamped rim costs 2 %


def test_superposition() -> None:
    one, two = load(12, -9, 1.5), load(-30, 15, 0.7, 3.0)
    both = depth(PLATE, (one, two), SOME)
    assert both == pytest.approx(depth(PLATE, (one,), SOME) + depth(PLATE, (two,), SOME), rel=1e-9)
    assert depth(PLATE, (), SOME) == pytest.approx(np.zeros(4))
    assert (both > 0).all()


def test_symmetry_and_reciprocity() -> None:
    mirrored = SOME * [-1, 1]
    assert depth(PLATE, (load(12, -9),), SOME) == pytest.approx(
        depth(PLATE, (load(-12, -9),), mirrored), rel=1e-9
    )
    at_a, at_b = np.array([[12.0, -9.0]]), np.array([[-30.0, 15.0]])
    there = depth(PLATE, (load(12, -9, radius_mm=0.0),), at_b)
    back = depth(PLATE, (load(-30, 15, radius_mm=0.0),), at_a)
    assert there == pytest.approx(back, rel=1e-9)


def test_outline_is_clamped() -> None:
    outline = np.array([[60.0, 10.0], [-60.0, -33.0], [25.0, 40.0], [-8.0, -40.0]])
    field = PLATE.modes_at(outline).field(PLATE.coefficients((load(40, 20),)))
    assert np.abs(field.depth_mm).max() < 1e-12
    assert np.abs(field.slope).max() < 1e-10


def test_derivatives_against_finite_differences() -> None:
    coefficients = PLATE.coefficients((load(5, -4), load(-44, 20)))
    step = 1e-3
    field = PLATE.modes_at(SOME).field(coefficients)
    for axis in (0, 1):
        shift = step * np.eye(2)[axis]
        above = PLATE.modes_at(SOME + shift).field(coefficients)
        below = PLATE.modes_at(SOME - shift).field(coefficients)
        slope = (above.depth_mm - below.depth_mm) / (2 * step)
        assert field.slope[:, axis] == pytest.approx(slope, rel=1e-4, abs=1e-8)


def test_beam_functions_are_orthonormal_to_the_highest() -> None:
    node, weight = np.polynomial.legendre.leggauss(200)
    basis = beam_functions((node + 1) / 2, 40, 0)
    assert (basis * weight[:, None] / 2).T @ basis == pytest.approx(np.eye(40), abs=1e-9)


def test_patch_carries_its_force_at_its_centre() -> None:
    point_mm, share = patch_points(load(7.0, -3.0, 2.0, 5.0))
    assert share.sum() == pytest.approx(1)
    assert share @ point_mm == pytest.approx([7, -3])
    square = ((point_mm - [7, -3]) ** 2).sum(axis=1)
    assert share @ square == pytest.approx(25 / 3)  # of p ~ 1 - r^2 / R^2
    assert square.max() < 25


def test_plate_of_a_sheet() -> None:
    sheet = demo_sensor().sheet
    assert sheet is not None
    plate = clamped_plate(sheet)
    assert plate.bending_stiffness_Nmm == pytest.approx(3.1 * 27 / (12 * (1 - 0.45**2)))
    assert plate.pretension_N_per_mm == sheet.pretension_N_per_mm
    with pytest.raises(ValueError, match="young_MPa"):
        clamped_plate(Sheet(size_mm=np.array([120.0, 80.0]), thickness_mm=3.0))
