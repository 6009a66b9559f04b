"""The shell: derivatives, rigid motions, and plates whose deflection is known.

Plates: S. Timoshenko and S. Woinowsky-Krieger, Theory of Plates and Shells (1959), tables 35 and 37;
large deflection: S. Levy, NACA TN 847 (1942).
"""

from dataclasses import replace

import numpy as np
import pytest

import spline_reference as reference
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell import material as material_kernels
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.mechanics.shell.shell import Shell
from manytouch.mechanics.shell.stretched import stretched_moduli
from slab import free_face

H = 1e-5


def direction(shell: Shell) -> np.ndarray:
    rough = np.random.default_rng(7).normal(size=(shell.patch.node_count, 3))
    return rough * shell.patch.is_free


def gauss_points(patch: SplinePatch) -> tuple[np.ndarray, np.ndarray]:
    """Places (k, 2) and areas (k,) of 3 x 3 Gauss points of each element."""
    place, weight = np.polynomial.legendre.leggauss(3)
    axes, lengths = [], []
    for length, count, corner in zip(patch.size_mm, patch.elements, patch.corner_mm, strict=True):
        step = length / count
        axes.append(((np.arange(count)[:, None] + 0.5 * (place + 1.0)) * step).ravel() + corner)
        lengths.append(np.tile(0.5 * weight * step, count))
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2), np.outer(*lengths).ravel()


def energy_reference(shell: Shell, coefficient_mm: np.ndarray) -> float:
    """Energy over E by numpy and scipy: two points across the thickness, pretension, shear, springs."""
    patch, nu, t = shell.patch, shell.poisson, shell.thickness_mm
    point_mm, area_mm2 = gauss_points(patch)

    def field(along_x: int, along_y: int) -> np.ndarray:
        return reference.derivative(patch, coefficient_mm, point_mm, along_x, along_y)

    grad_lap = [reference.laplacian(patch, coefficient_mm, point_mm, *way) for way in ((1, 0), (0, 1))]
    a1, a2 = field(1, 0), field(0, 1)
    stretched = a1[:, 0] + a2[:, 1]
    a1[:, 0] += 1.0
    a2[:, 1] += 1.0
    fibre = np.cross(a1, a2)  # of slopes of b
    for base, axis in ((a1, 0), (a2, 1)):
        base[:, 2] -= patch.shear_mm2 * grad_lap[axis]  # w = b - a lap b
    normal = np.cross(a1, a2)
    strain = np.array(
        [0.5 * ((a1**2).sum(axis=1) - 1.0), 0.5 * ((a2**2).sum(axis=1) - 1.0), (a1 * a2).sum(axis=1)]
    )
    second = np.stack([field(2, 0), field(0, 2), 2.0 * field(1, 1)])
    curvature = (second * fibre).sum(axis=2) / (fibre**2).sum(axis=1)
    square = shell.thickness_mm**2 / 12.0 * (1.0 + nu) / (1.0 - nu)
    strain = strain + 0.5 * square * np.array(
        [
            curvature[0] ** 2 + 0.25 * curvature[2] ** 2,
            curvature[1] ** 2 + 0.25 * curvature[2] ** 2,
            curvature[2] * (curvature[0] + curvature[1]),
        ]
    )
    moduli = stretched_moduli(nu, shell.pretension_over_E_mm / t)
    mu, bulk = 0.5 / (1.0 + moduli.poisson), 1.0 / (3.0 * (1.0 - 2.0 * moduli.poisson))
    mu, bulk = moduli.young * mu, moduli.young * bulk
    rigidity = shell.bending_factor * moduli.young * t**3 / (12.0 * (1.0 - moduli.poisson**2))
    lever = t * np.sqrt(shell.bending_factor / 12.0)
    layers = [
        [material_kernels.energy_density(*point, mu, bulk) for point in (strain + z * curvature).T]
        for z in (-lever, lever)
    ]
    sheared = (
        0.5 * rigidity * patch.shear_mm2 * (grad_lap[0] ** 2 + grad_lap[1] ** 2) / (normal**2).sum(axis=1)
    )
    tension = shell.pretension_over_E_mm * (strain[0] + strain[1] - stretched)  # balanced at rest
    springs = np.where(patch.is_soft_edge, shell.support_per_mm * patch.area_mm2, 0.0)
    density = 0.5 * t * np.sum(layers, axis=0) + sheared + tension
    ends = 0.5 * rigidity * outline_integral(shell, coefficient_mm)
    return float(area_mm2 @ density + 0.5 * (springs[:, None] * coefficient_mm**2).sum()) + ends


def outline_integral(shell: Shell, coefficient_mm: np.ndarray) -> float:
    """Of e0 b_nn^2 + 2 e1 b_nn b_nnn - e2 b_nnn^2 over a clamped outline."""
    patch = shell.patch
    if patch.boundary != "clamped":
        return 0.0
    (e0, e1, e2), total = patch.clamped_end, 0.0
    place, weight = np.polynomial.legendre.leggauss(4)
    for across in (0, 1):
        along, step = 1 - across, patch.size_mm[1 - across] / patch.elements[1 - across]
        at = (np.arange(patch.elements[along])[:, None] + 0.5 * (place + 1.0)).ravel() * step
        for inward in (1, -1):
            point_mm = np.tile(patch.corner_mm, (len(at), 1))
            point_mm[:, along] += at
            if inward < 0:
                point_mm[:, across] += patch.size_mm[across]
            second, third = (
                reference.derivative(patch, coefficient_mm, point_mm, *((n, 0) if across == 0 else (0, n)))[
                    :, 2
                ]
                * inward**n
                for n in (2, 3)
            )
            density = e0 * second**2 + 2.0 * e1 * second * third - e2 * third**2
            total += float(np.tile(0.5 * step * weight, patch.elements[along]) @ density)
    return total


def test_the_energy_is_the_integral_of_its_density(shell: Shell, bent_mm: np.ndarray) -> None:
    assert shell.energy(bent_mm) == pytest.approx(energy_reference(shell, bent_mm), rel=1e-11)


def deep(shell: Shell) -> np.ndarray:
    """Coefficients of a dent about 3 thicknesses deep, with slopes above 1."""
    away = shell.patch.place_mm - np.array(shell.patch.centre_mm)
    dent = np.exp(-(away**2).sum(axis=1) / 40.0)
    return np.outer(dent, [0.4, -0.3, -4.0 * shell.thickness_mm]) * shell.patch.is_free


def test_the_tangent_of_a_deep_shape(shell: Shell) -> None:
    dent, way = deep(shell), direction(shell)
    point_mm, _ = gauss_points(shell.patch)
    assert np.abs(reference.derivative(shell.patch, dent, point_mm, 1, 0)[:, 2]).max() > 1.0
    gain = (shell.energy(dent + H * way) - shell.energy(dent - H * way)) / (2 * H)
    assert (shell.forces(dent) * way).sum() == pytest.approx(gain, rel=1e-6)
    force, tangent = np.empty_like(dent), shell.empty_tangent()
    shell.forces_and_tangent(dent, force, tangent)
    np.testing.assert_allclose(force, shell.forces(dent), atol=1e-11)
    change = (shell.forces(dent + H * way) - shell.forces(dent - H * way)) / (2 * H)
    _, found = shell.products(tangent, np.stack([force, way]))
    np.testing.assert_allclose(found, change, atol=1e-7 * np.abs(change).max())


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
    _, found = shell.products(tangent, np.stack([force, way]))
    np.testing.assert_allclose(found, change, atol=1e-7 * np.abs(change).max())


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


@pytest.mark.parametrize("elements", [(9, 7), (7, 9)])
def test_a_bent_sheet_that_is_turned_has_the_same_energy(elements: tuple[int, int]) -> None:
    patch = SplinePatch(size_mm=(40.0, 30.0), elements=elements, boundary="soft")
    shell = Shell(patch=patch, thickness_mm=3.0, support_per_mm=0.0, shear_factor=0.0)
    place = np.column_stack([patch.place_mm, np.zeros(patch.node_count)])
    x, y = patch.place_mm.T / 20.0
    bent = np.column_stack([0.4 * x * y, 0.6 * y**2, 2.0 * x**2 - 1.5 * x * y + y**2 + 0.7 * x**3])
    cos, sin = np.cos(0.7), np.sin(0.7)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    energy = shell.energy(bent)
    assert energy > 1.0
    assert shell.energy((place + bent) @ turn.T - place) == pytest.approx(energy, rel=1e-12)


def test_springs_act_on_a_soft_boundary_only() -> None:
    shells = [
        Shell(patch=SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7), boundary=kind), thickness_mm=3.0)
        for kind in ("clamped", "soft")
    ]
    for shell, count in zip(shells, (0, 12 * 10 - 8 * 6), strict=True):
        aside = np.tile([1.0, 0.0, 0.0], (shell.patch.node_count, 1))
        assert shell.patch.is_soft_edge.sum() == count
        without = replace(shell, support_per_mm=0.0)
        gain = shell.energy(aside) - without.energy(aside)
        edge_mm2 = shell.patch.area_mm2[shell.patch.is_soft_edge].sum()
        assert gain == pytest.approx(0.5 * shell.support_per_mm * edge_mm2, abs=1e-12)


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
    """Deflection of the middle under nodal forces downwards (nodes,)."""
    force = np.column_stack([np.zeros((len(load), 2)), -load])
    found = equilibrium(shell, force)
    assert found.status == "ok"
    return -float(reference.moved(shell.patch, found.coefficient_mm, np.zeros((1, 2)))[0, 2])


def point_load(patch: SplinePatch) -> np.ndarray:
    """Nodal forces (nodes,) of a force of 1 in the middle."""
    return patch.load(np.zeros((1, 2)), np.array([[0.0, 0.0, 1.0]]))[:, 2]


def plate(width_mm: float, height_mm: float, nu: float = 0.3) -> Shell:
    elements = (round(width_mm / 6.25), round(height_mm / 6.25))
    patch = SplinePatch(size_mm=(width_mm, height_mm), elements=elements)
    return Shell(patch=patch, thickness_mm=1.0, poisson=nu, shear_factor=0.0)


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
    deflection = deflection_mm(shell, 1e-6 * point_load(shell.patch))
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
    tension, pressure, width = 0.1, 1e-6, 20.0
    shell = Shell(patch=patch, thickness_mm=1.0, pretension_over_E_mm=tension, shear_factor=0.0)
    k = np.sqrt(tension / shell.rigidity_mm3)
    expected = pressure / tension * (width**2 / 8.0 - width / (2.0 * k) * np.tanh(k * width / 4.0))
    assert deflection_mm(shell, pressure * patch.area_mm2) == pytest.approx(expected, rel=0.01)


def even_pressure(patch: SplinePatch) -> np.ndarray:
    """Nodal forces (nodes,) of a pressure of 1."""
    point_mm, area_mm2 = gauss_points(patch)
    return patch.load(point_mm, np.outer(area_mm2, [0.0, 0.0, 1.0]))[:, 2]


@pytest.mark.parametrize("shear_factor", [0.0, 0.2, 1.0])
def test_a_clamped_strip_is_sheared(shear_factor: float) -> None:
    """Even pressure q on a strip of width 2 l: D b = q (y^4 + p y^2 + s) / 24, y from the middle."""
    width, t = 12.0, 1.0
    patch = SplinePatch(size_mm=(60.0, width), elements=(40, 16))
    shell = Shell(patch=patch, thickness_mm=t, shear_factor=shear_factor)
    rigidity, half, pressure = t**3 / (12.0 * (1.0 - 0.45**2)), 0.5 * width, 1e-8
    a, (e0, e1, e2) = shell.shear_mm2, shell.patch.clamped_end
    # the inward derivatives at y = l are those by -y
    p = -(4.0 * half**3 + 12.0 * e0 * half**2 - 24.0 * e1 * half) / (2.0 * half + 2.0 * e0)
    second, third = 12.0 * half**2 + 2.0 * p, 24.0 * half
    s = (a - e1) * second - e2 * third - half**4 - p * half**2
    expected = pressure / (24.0 * rigidity) * (s - 2.0 * a * p)
    if shear_factor != 0.2:
        known = pressure * half**4 / (24.0 * rigidity) * (1.0 + 12.0 * a / half**2)
        assert expected == pytest.approx(known, rel=1e-12)
    assert deflection_mm(shell, pressure * even_pressure(shell.patch)) == pytest.approx(expected, rel=2e-3)


def test_the_clamp_holds_the_face() -> None:
    """Deflection along the clamp: 0, but for a part of the second derivative along it."""
    t = 3.0
    shell = Shell(patch=SplinePatch(size_mm=(120.0, 80.0), elements=(30, 20)), thickness_mm=t)
    found = equilibrium(shell, np.outer(even_pressure(shell.patch), [0.0, 0.0, -1e-4])).coefficient_mm
    deepest = -reference.moved(shell.patch, found, np.zeros((1, 2)))[0, 2]
    along = np.linspace(-40.0, 40.0, 41)
    for point in (np.column_stack([along, np.full(41, 40.0)]), np.column_stack([np.full(41, 60.0), along])):
        edge = reference.moved(shell.patch, found, point)[:, 2]
        assert np.abs(edge).max() < 0.005 * deepest


WAVES_KT = (0.05, 0.2, 0.5, 0.8, 1.0)


def wave_response(shell: Shell, wave_per_mm: float) -> tuple[float, float]:
    """Pressure over deflection of the face, and displacement of the face along x over that along z.

    The load and the shape are waves along x; they are compared in the middle, far from the free outline.
    """
    patch, k = shell.patch, wave_per_mm
    x = patch.place_mm[:, 0]
    greville = np.unique(x.round(9))
    along = reference.spline(patch.size_mm[0], patch.elements[0])(greville - patch.corner_mm[0])
    fitted = np.linalg.solve(along, np.cos(k * greville))
    wave = np.zeros((patch.node_count, 3))
    wave[:, 2] = fitted[np.searchsorted(greville, x - 1e-6)]
    tangent = shell.empty_tangent()
    shell.forces_and_tangent(np.zeros_like(wave), np.empty_like(wave), tangent)
    reply = shell.products(tangent, wave[None])[0][:, 2]
    point_mm, area_mm2 = gauss_points(patch)
    per_load = patch.load(point_mm, np.outer(area_mm2 * np.cos(k * point_mm[:, 0]), [0.0, 0.0, 1.0]))[:, 2]
    inner = np.all(np.abs(patch.place_mm) < 0.25 * np.array(patch.size_mm), axis=1)
    pressure = float(per_load[inner] @ reply[inner] / (per_load[inner] @ per_load[inner]))
    assert np.abs(reply - pressure * per_load)[inner].max() < 5e-3 * np.abs(reply[inner]).max()
    period_mm = 2.0 * np.pi / k * np.arange(48) / 48.0
    face = Face(shell=shell, point_mm=np.column_stack([period_mm - np.pi / k, np.zeros(48)]))
    moved = face.displacement(1e-6 * wave) / 1e-6
    phase = k * face.point_mm[:, 0]
    deflection, aside = 2.0 * np.mean(moved[:, 2] * np.cos(phase)), 2.0 * np.mean(moved[:, 0] * np.sin(phase))
    return pressure / float(deflection), float(aside / deflection)


@pytest.mark.parametrize(
    "poisson", [0.0, *(pytest.param(poisson, marks=pytest.mark.slow) for poisson in (0.3, 0.45)), 0.49]
)
@pytest.mark.parametrize("wave_kt", WAVES_KT)
def test_waves_are_those_of_an_exact_slab(poisson: float, wave_kt: float) -> None:
    """Deflection, and displacement in the plane, of the face that is not loaded."""
    t, k = 2.0, wave_kt / 2.0
    patch = SplinePatch(size_mm=(5.0 * np.pi / k, 2.0 * np.pi / k), elements=(48, 12), boundary="soft")
    for strain, within in ((0.0, 0.01), (0.005, 0.015), (0.05, 0.03)):  # tension over E t
        shell = Shell(
            patch=patch,
            thickness_mm=t,
            poisson=poisson,
            pretension_over_E_mm=strain * t,
            support_per_mm=0.0,
        )
        exact = free_face(k, t, poisson, strain * t)
        stiffness, aside = wave_response(shell, k)
        assert stiffness == pytest.approx(exact.stiffness_per_mm, rel=within)
        assert aside == pytest.approx(exact.in_plane, rel=min(within, 0.015))
    if wave_kt == min(WAVES_KT):
        thin = t**3 / (12.0 * (1.0 - poisson**2)) * k**4
        assert wave_response(replace(shell, pretension_over_E_mm=0.0), k)[0] == pytest.approx(thin, rel=2e-3)


def test_a_thin_plate_is_much_too_stiff_under_a_short_wave() -> None:
    t, k = 2.0, 0.5
    patch = SplinePatch(size_mm=(32.0, 24.0), elements=(48, 12), boundary="soft")
    thin = Shell(patch=patch, thickness_mm=t, shear_factor=0.0, support_per_mm=0.0)
    assert wave_response(thin, k)[0] > 1.15 * free_face(k, t, 0.45).stiffness_per_mm


def test_invalid_sheets_raise() -> None:
    patch = SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7))
    with pytest.raises(ValueError, match="Poisson's ratio"):
        Shell(patch=patch, thickness_mm=3.0, poisson=0.5)
    with pytest.raises(ValueError, match="thickness"):
        Shell(patch=patch, thickness_mm=0.0)
