"""The shell: derivatives, rigid motions, and plates whose deflection is known.

Plates: S. Timoshenko and S. Woinowsky-Krieger, Theory of Plates and Shells (1959), tables 35 and 37;
large deflection: S. Levy, NACA TN 847 (1942).
"""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.shell import material as material_kernels
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.mechanics.shell.shell import Shell

H = 1e-5


def direction(shell: Shell) -> np.ndarray:
    rough = np.random.default_rng(7).normal(size=(shell.patch.node_count, 3))
    return rough * shell.patch.is_free


def energy_reference(shell: Shell, coefficient_mm: np.ndarray) -> float:
    """Energy over E of a clamped sheet by numpy: membrane, pretension and bending at the Gauss points."""
    patch, nu, t = shell.patch, shell.poisson, shell.thickness_mm
    place, weight = np.polynomial.legendre.leggauss(3)
    axes = []
    for length, count, corner in zip(patch.size_mm, patch.elements, patch.corner_mm, strict=True):
        step = length / count
        axes.append(((np.arange(count)[:, None] + 0.5 * (place + 1.0)) * step).ravel() + corner)
    areas = [
        np.tile(0.5 * weight * length / count, count)
        for length, count in zip(patch.size_mm, patch.elements, strict=True)
    ]
    point_mm = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    at, c = patch.at(point_mm), coefficient_mm
    a1, a2, kxx, kyy, kxy = (
        np.einsum("kn,knj->kj", table, c[at.node]) for table in (at.dx, at.dy, at.dxx, at.dyy, at.dxy)
    )
    a1, a2 = a1 + np.eye(3)[0], a2 + np.eye(3)[1]
    e1, e2 = 0.5 * ((a1**2).sum(axis=1) - 1.0), 0.5 * ((a2**2).sum(axis=1) - 1.0)
    e3 = (a1 * a2).sum(axis=1)
    mu, bulk = 0.5 / (1.0 + nu), 1.0 / (3.0 * (1.0 - 2.0 * nu))
    membrane = np.array(
        [material_kernels.energy_density(*each, mu, bulk) for each in zip(e1, e2, e3, strict=True)]
    )
    k1, k2, k3 = kxx[:, 2], kyy[:, 2], 2.0 * kxy[:, 2]
    rigidity = shell.bending_factor * t**3 / (12.0 * (1.0 - nu**2))
    bending = 0.5 * rigidity * (k1**2 + k2**2 + 2.0 * nu * k1 * k2 + 0.5 * (1.0 - nu) * k3**2)
    density = t * membrane + shell.pretension_over_E_mm * (e1 + e2) + bending
    return float((np.outer(*areas).ravel() * density).sum())


def test_the_energy_is_the_integral_of_its_density(shell: Shell, bent_mm: np.ndarray) -> None:
    if shell.patch.boundary == "clamped":
        assert shell.energy(bent_mm) == pytest.approx(energy_reference(shell, bent_mm), rel=1e-11)


def test_forces_are_the_derivative_of_the_energy(shell: Shell, bent_mm: np.ndarray) -> None:
    way = direction(shell)
    slope = (shell.energy(bent_mm + H * way) - shell.energy(bent_mm - H * way)) / (2 * H)
    assert (shell.forces(bent_mm) * way).sum() == pytest.approx(slope, rel=1e-7)


def test_the_tangent_is_the_derivative_of_the_forces(shell: Shell, bent_mm: np.ndarray) -> None:
    way = direction(shell)
    force, tangent = np.empty_like(bent_mm), shell.empty_tangent()
    shell.forces_and_tangent(bent_mm, force, tangent)
    np.testing.assert_allclose(force, shell.forces(bent_mm), atol=1e-12)
    change = (shell.forces(bent_mm + H * way) - shell.forces(bent_mm - H * way)) / (2 * H)
    np.testing.assert_allclose(shell.product(tangent, way), change, atol=1e-7 * np.abs(change).max())


def test_nothing_acts_at_rest(shell: Shell) -> None:
    rest = np.zeros((shell.patch.node_count, 3))
    assert shell.energy(rest) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(shell.forces(rest), 0.0, atol=1e-12)


@pytest.mark.parametrize("elements", [(9, 7), (7, 9)])
def test_a_rigid_motion_has_no_energy(elements: tuple[int, int]) -> None:
    patch = SplinePatch(size_mm=(40.0, 30.0), elements=elements, boundary="soft")
    shell = Shell(patch=patch, thickness_mm=3.0, support_per_mm=0.0)
    cos, sin = np.cos(0.7), np.sin(0.7)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    tip = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    place = np.column_stack([patch.place_mm, np.zeros(patch.node_count)])
    moved = place @ (turn @ tip).T - place + np.array([5.0, -3.0, 8.0])
    assert abs(shell.energy(moved)) < 1e-10
    assert np.abs(shell.forces(moved)).max() < 1e-12


def test_springs_act_on_a_soft_boundary_only() -> None:
    shells = [
        Shell(patch=SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7), boundary=kind), thickness_mm=3.0)
        for kind in ("clamped", "soft")
    ]
    for shell, count in zip(shells, (0, 12 * 10 - 8 * 6), strict=True):
        aside = np.tile([1.0, 0.0, 0.0], (shell.patch.node_count, 1))
        assert shell.patch.is_rim.sum() == count
        without = replace(shell, support_per_mm=0.0)
        gain = shell.energy(aside) - without.energy(aside)
        rim_mm2 = shell.patch.area_mm2[shell.patch.is_rim].sum()
        assert gain == pytest.approx(0.5 * shell.support_per_mm * rim_mm2, abs=1e-12)


def test_neo_hooke_has_no_stress_through_the_thickness() -> None:
    """Against the energy minimised over the thickness stretch by brute force."""
    mu, bulk = 0.345, 3.3
    c = np.array([1.3, 0.9, 0.15])
    z = np.linspace(0.3, 1.6, 2_000_001)
    volume = np.sqrt((c[0] * c[1] - c[2] ** 2) * z)
    energy = 0.5 * mu * (volume ** (-2 / 3) * (c[0] + c[1] + z) - 3.0) + 0.5 * bulk * (volume - 1.0) ** 2
    strain = (0.5 * (c[0] - 1.0), 0.5 * (c[1] - 1.0), c[2])
    assert material_kernels.energy_density(*strain, mu, bulk) == pytest.approx(energy.min(), rel=1e-9)


def test_a_small_strain_is_hooke_in_plane_stress() -> None:
    nu, small = 0.45, 1e-7
    mu, bulk = 0.5 / (1.0 + nu), 1.0 / (3.0 * (1.0 - 2.0 * nu))
    s1, s2, s3 = material_kernels.stress(2.0 * small, -small, small, mu, bulk)
    modulus = 1.0 / (1.0 - nu**2)
    assert s1 == pytest.approx(modulus * (2.0 - nu) * small, rel=1e-5)
    assert s2 == pytest.approx(modulus * (-1.0 + 2.0 * nu) * small, rel=1e-4)
    assert s3 == pytest.approx(0.5 / (1.0 + nu) * small, rel=1e-5)


def deflection_mm(shell: Shell, load: np.ndarray) -> float:
    force = np.column_stack([np.zeros((len(load), 2)), -load])
    found = equilibrium(shell, force)
    assert found.status == "ok"
    return -float(shell.patch.at(np.zeros((1, 2))).field(found.coefficient_mm)[0, 2])


def plate(width_mm: float, height_mm: float, nu: float = 0.3) -> Shell:
    elements = (round(width_mm / 6.25), round(height_mm / 6.25))
    patch = SplinePatch(size_mm=(width_mm, height_mm), elements=elements)
    return Shell(patch=patch, thickness_mm=1.0, poisson=nu)


def test_clamped_plates_bend_as_thin_plates() -> None:
    rigidity, pressure = 1.0 / (12.0 * (1.0 - 0.3**2)), 1e-9
    for width, height, factor in (
        (100.0, 100.0, 0.001265),
        (150.0, 100.0, 0.002197),
        (100.0, 150.0, 0.002197),
    ):
        shell = plate(width, height)
        deflection = deflection_mm(shell, pressure * shell.patch.area_mm2)
        assert deflection * rigidity / (pressure * 100.0**4) == pytest.approx(factor, rel=2e-3)
    shell = plate(100.0, 100.0)
    deflection = deflection_mm(shell, 1e-6 * shell.patch.load(np.zeros((1, 2)), np.ones(1)))
    assert deflection * rigidity / (1e-6 * 100.0**2) == pytest.approx(0.00560, rel=5e-3)


def test_a_clamped_square_plate_stiffens_as_levy_found() -> None:
    load = np.array([17.79, 95.0, 184.0, 402.0])
    expected = np.array([0.237, 0.912, 1.323, 1.902])
    shell = plate(100.0, 100.0, 0.316)
    deflection = [deflection_mm(shell, q / 100.0**4 * shell.patch.area_mm2) for q in load]
    np.testing.assert_allclose(deflection, expected, rtol=0.026)


def test_pretension_stiffens_a_strip() -> None:
    """A long strip under even pressure q: w = q b^2 / (8 N) - q b / (2 N k) tanh(k b / 4), k^2 = N / D."""
    patch = SplinePatch(size_mm=(80.0, 20.0), elements=(40, 20))
    rigidity, pressure, width = 1.0 / (12.0 * (1.0 - 0.45**2)), 1e-6, 20.0
    shell = Shell(patch=patch, thickness_mm=1.0, pretension_over_E_mm=rigidity)
    expected = pressure / rigidity * (width**2 / 8.0 - width / 2.0 * np.tanh(width / 4.0))
    assert deflection_mm(shell, pressure * patch.area_mm2) == pytest.approx(expected, rel=0.01)


def test_invalid_sheets_raise() -> None:
    patch = SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7))
    with pytest.raises(ValueError, match="Poisson's ratio"):
        Shell(patch=patch, thickness_mm=3.0, poisson=0.5)
    with pytest.raises(ValueError, match="thickness"):
        Shell(patch=patch, thickness_mm=0.0)
