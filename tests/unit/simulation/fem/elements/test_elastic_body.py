"""The elements: what any solid must do, and how fast they approach a known solution."""

import numpy as np
import pytest

from manytouch.simulation.fem.elements.elastic_body import ElasticBody, elastic_body, irons_rule
from manytouch.simulation.fem.elements.material import NeoHooke, Yeoh
from manytouch.simulation.fem.elements.mesh import (
    HexMesh,
    reference_nodes,
    shape_functions,
    sheet_mesh,
    tensor_mesh,
)
from manytouch.simulation.fem.solver.multifrontal import MultifrontalSolver

X, Y, Z = np.array([0.0, 1.0, 2.5, 3.0]), np.array([-1.0, 0.2, 1.0]), np.array([0.0, 1.0, 1.6])


def block(poisson: float = 0.45, pretension: float = 0.0) -> ElasticBody:
    material = NeoHooke(young_MPa=1.3, poisson=poisson)
    return elastic_body(tensor_mesh(X, Y, Z), material, pretension_N_per_mm=pretension)


def on_surface(mesh: HexMesh) -> np.ndarray:
    ends = [np.isin(mesh.node_mm[:, axis], line[[0, -1]]) for axis, line in enumerate(mesh.lines_mm)]
    return np.logical_or.reduce(ends)


def rotation() -> np.ndarray:
    q, r = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))
    q *= np.sign(np.diag(r))
    return np.asarray(q * np.sign(np.linalg.det(q)))


def test_shape_functions_are_one_at_their_node_and_sum_to_one() -> None:
    value, slope = shape_functions(reference_nodes())
    np.testing.assert_allclose(value, np.eye(20), atol=1e-12)
    value, slope = shape_functions(np.random.default_rng(0).random((30, 3)))
    np.testing.assert_allclose(value.sum(axis=1), 1.0)
    np.testing.assert_allclose(slope.sum(axis=1), 0.0, atol=1e-12)


def test_the_rule_integrates_polynomials_of_degree_five() -> None:
    point, weight = irons_rule()
    for i, j, k in [(0, 0, 0), (2, 0, 0), (4, 0, 0), (2, 2, 0), (5, 0, 0), (2, 2, 1), (1, 1, 1), (0, 4, 1)]:
        exact = 1.0 / ((i + 1) * (j + 1) * (k + 1))
        assert np.prod(point ** [i, j, k], axis=1) @ weight == pytest.approx(exact, rel=1e-12)


def test_the_mesh_fills_the_sheet_and_knows_its_faces() -> None:
    mesh = sheet_mesh((9.0, 6.5), 3.0, element_mm=2.0, layers=2)
    body = elastic_body(mesh, NeoHooke(young_MPa=1.0, poisson=0.3))
    assert body.point_volume_mm3.sum() == pytest.approx(9.0 * 6.5 * 3.0)
    assert len(mesh.touched) == len(mesh.camera_side) == 5 * 4
    assert mesh.node_mm[mesh.element[mesh.touched]].min(axis=(0, 1))[2] == 1.5
    assert mesh.node_mm[mesh.element[mesh.camera_side]].max(axis=(0, 1))[2] == 1.5
    side = np.abs(np.abs(mesh.node_mm[:, :2]) - [4.5, 3.25]).min(axis=1) < 1e-9
    np.testing.assert_array_equal(mesh.is_on_outline, side)


def test_rigid_motions_cost_nothing() -> None:
    body = block()
    turn = rotation()
    moved = body.mesh.node_mm @ turn.T + [1.0, -2.0, 0.5] - body.mesh.node_mm
    energy, force, _ = body.forces(moved)
    assert abs(energy) < 1e-12
    assert np.abs(force).max() < 1e-12


def test_there_are_six_rigid_modes_and_no_others() -> None:
    mesh = tensor_mesh(np.array([0.0, 1.0]), np.array([0.0, 1.3]), np.array([0.0, 0.7]))
    body = elastic_body(mesh, NeoHooke(young_MPa=1.0, poisson=0.45))
    _, tangent = body.forces_and_tangent(np.zeros((20, 3)))
    modes = np.linalg.eigvalsh(tangent[0])
    assert np.abs(modes[:6]).max() < 1e-10
    assert modes[6] > 1e-3


def test_forces_and_energy_do_not_depend_on_the_frame() -> None:
    body, turn = block(), rotation()
    bent = 0.05 * np.random.default_rng(3).standard_normal(body.mesh.node_mm.shape)
    energy, force, _ = body.forces(bent)
    turned = (body.mesh.node_mm + bent) @ turn.T - body.mesh.node_mm
    energy_turned, force_turned, _ = body.forces(turned)
    assert energy_turned == pytest.approx(energy, rel=1e-10)
    np.testing.assert_allclose(force_turned, force @ turn.T, atol=1e-11)


STIFFENING = Yeoh(young_MPa=1.3, poisson=0.45, second=0.4, third=0.1)


@pytest.mark.parametrize("material", [NeoHooke(young_MPa=1.3, poisson=0.45), STIFFENING], ids=type)
@pytest.mark.parametrize("pretension", [0.0, 0.2])
def test_forces_are_the_slope_of_the_energy_and_the_tangent_theirs(
    pretension: float, material: NeoHooke
) -> None:
    body = elastic_body(tensor_mesh(X, Y, Z), material, pretension_N_per_mm=pretension)
    rng = np.random.default_rng(1)
    bent = 0.05 * rng.standard_normal(body.mesh.node_mm.shape)
    along = rng.standard_normal(bent.shape)
    _, force, smallest = body.forces(bent)
    assert smallest > 0.0
    step = 1e-5
    (above, force_above, _), (below, force_below, _) = (
        body.forces(bent + step * along),
        body.forces(bent - step * along),
    )
    assert (above - below) / (2 * step) == pytest.approx(np.vdot(force, along), rel=1e-6)
    again, tangent = body.forces_and_tangent(bent)
    np.testing.assert_array_equal(again, force)
    np.testing.assert_allclose(tangent, tangent.transpose(0, 2, 1), atol=1e-12)
    product = np.zeros_like(bent)
    flat = along[body.mesh.element].reshape(len(tangent), 60)
    np.add.at(product, body.mesh.element, np.einsum("eij,ej->ei", tangent, flat).reshape(-1, 20, 3))
    numeric = (force_above - force_below) / (2 * step)
    np.testing.assert_allclose(product, numeric, atol=1e-7 * np.abs(numeric).max())


def reference_energy_and_force(body: ElasticBody, bent: np.ndarray) -> tuple[float, np.ndarray]:
    """The formulae of docs/derivations/fem.md in numpy, all elements and points at once."""
    grad, w, mode = body.gradient_per_mm, body.point_volume_mm3, body.pressure_mode
    F = np.diag(body.stretch) + np.einsum("eai,eqaj->eqij", bent[body.mesh.element], grad)
    J = np.linalg.det(F)
    volume = np.einsum("eq,eqm,eq->em", w, mode, J - 1.0)
    pressure = body.bulk_MPa * np.einsum("em,eqm->eq", volume, mode)
    invariant = np.einsum("eqij,eqij->eq", F, F)
    modulus = body.shear_MPa * J ** (-2.0 / 3.0)
    energy = 0.5 * body.bulk_MPa * (volume**2).sum()
    energy += 0.5 * (w * (modulus * invariant - 3.0 * body.shear_MPa)).sum()
    h = np.einsum("eqji,eqaj->eqai", np.linalg.inv(F), grad)
    s = np.einsum("eqij,eqaj->eqai", F, grad)
    deviator = modulus[..., None, None] * (s - invariant[..., None, None] / 3.0 * h)
    force = np.zeros_like(bent)
    stress = w[..., None, None] * (deviator + (pressure * J)[..., None, None] * h)
    np.add.at(force, body.mesh.element, stress.sum(axis=1))
    return float(energy), force


@pytest.mark.parametrize("pretension", [0.0, 0.2])
def test_the_kernel_agrees_with_its_formulae_in_numpy(pretension: float) -> None:
    body = block(pretension=pretension)
    bent = 0.05 * np.random.default_rng(8).standard_normal(body.mesh.node_mm.shape)
    energy, force, _ = body.forces(bent)
    expected_energy, expected_force = reference_energy_and_force(body, bent)
    assert energy == pytest.approx(expected_energy, rel=1e-11)
    np.testing.assert_allclose(force, expected_force, atol=1e-11 * np.abs(expected_force).max())


def test_a_folded_element_is_recognised_by_its_volume() -> None:
    body = block()
    energy, _, smallest = body.forces(-1.5 * body.mesh.node_mm)
    assert smallest < 0.0
    assert energy == np.inf


@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_patch_a_constant_strain_is_found_exactly(poisson: float) -> None:
    body = block(poisson)
    mesh = body.mesh
    strain = np.array([[0.15, 0.1, 0.0], [0.02, -0.1, 0.05], [0.0, 0.08, 0.05]])
    exact = mesh.node_mm @ strain.T
    free = np.repeat(~on_surface(mesh)[:, None], 3, axis=1)
    found = np.where(free, 0.8 * exact, exact)
    order = MultifrontalSolver(mesh=mesh, is_free=free)
    for _ in range(12):
        force, tangent = body.forces_and_tangent(found)
        found = found - order.factorise(tangent, is_symmetric=True).solve(np.where(free, force, 0.0))
    np.testing.assert_allclose(found, exact, atol=1e-12)


def plane_wave_errors(cells: int, poisson: float) -> tuple[float, float]:
    """L2 and H1 errors of u = d sin(k.x) with d at right angles to k, held on the surface of a cube."""
    line = np.linspace(0.0, 1.0, cells + 1)
    material = NeoHooke(young_MPa=1.0, poisson=poisson)
    body = elastic_body(tensor_mesh(line, line, line), material)
    mesh, size = body.mesh, 1e-7
    wave, way = np.array([1.5, -1.0, 2.0]), size * np.array([2.0, 1.0, -1.0])
    exact = np.sin(mesh.node_mm @ wave)[:, None] * way
    node, weight = np.polynomial.legendre.leggauss(5)
    point = 0.5 + 0.5 * np.stack(np.meshgrid(node, node, node), axis=-1).reshape(-1, 3)
    share = np.einsum("i,j,k->ijk", weight, weight, weight).ravel() / 8.0 / cells**3
    value, slope = shape_functions(point)
    place = np.einsum("qn,eni->eqi", value, mesh.node_mm[mesh.element])
    load = np.zeros_like(exact)
    stiffness = material.shear_MPa * wave @ wave
    np.add.at(
        load, mesh.element, np.einsum("q,qn,eq,i->eni", share, value, np.sin(place @ wave), stiffness * way)
    )
    free = np.repeat(~on_surface(mesh)[:, None], 3, axis=1)
    found = np.where(free, 0.0, exact)
    force, tangent = body.forces_and_tangent(found)
    order = MultifrontalSolver(mesh=mesh, is_free=free)
    found = found + order.factorise(tangent, is_symmetric=True).solve(np.where(free, load - force, 0.0))
    there = np.einsum("qn,eni->eqi", value, found[mesh.element])
    gradient = cells * np.einsum("qnj,eni->eqij", slope, found[mesh.element])
    miss = there - np.sin(place @ wave)[..., None] * way
    miss_gradient = gradient - np.cos(place @ wave)[..., None, None] * np.outer(way, wave)
    l2 = np.sqrt(np.einsum("q,eqi->", share, miss**2)) / size
    return float(l2), float(np.sqrt(np.einsum("q,eqij->", share, miss_gradient**2)) / size)


@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_errors_fall_with_the_third_power_in_place_and_the_second_in_strain(poisson: float) -> None:
    coarse, fine = plane_wave_errors(3, poisson), plane_wave_errors(6, poisson)
    assert np.log2(coarse[0] / fine[0]) > 2.7
    assert np.log2(coarse[1] / fine[1]) > 1.8


def test_near_incompressibility_does_not_lock() -> None:
    """The same solution is met as well with Poisson's ratio 0.49 as with 0.3."""
    assert plane_wave_errors(4, 0.49)[1] < 1.3 * plane_wave_errors(4, 0.3)[1]


def test_a_pretension_pulls_with_its_force_and_lets_the_sheet_lie_still() -> None:
    tension = 0.15
    mesh = sheet_mesh((10.0, 8.0), 2.0, element_mm=2.0)
    body = elastic_body(mesh, NeoHooke(young_MPa=2.0, poisson=0.45), pretension_N_per_mm=tension)
    _, force, _ = body.forces(np.zeros_like(mesh.node_mm))
    assert np.abs(force[~mesh.is_on_outline]).max() < 1e-12
    right = np.isclose(mesh.node_mm[:, 0], 5.0)
    assert force[right, 0].sum() == pytest.approx(tension * 8.0, rel=1e-9)


def test_yeohs_energy_of_a_uniform_stretch() -> None:
    body = elastic_body(tensor_mesh(X, Y, Z), STIFFENING)
    stretch = np.array([1.2, 0.9, 0.95])
    excess = np.prod(stretch) ** (-2 / 3) * (stretch**2).sum() - 3.0
    density = 0.5 * STIFFENING.shear_MPa * (excess + 0.4 * excess**2 + 0.1 * excess**3)
    density += 0.5 * STIFFENING.bulk_MPa * (np.prod(stretch) - 1.0) ** 2
    energy, _, _ = body.forces(body.mesh.node_mm * (stretch - 1.0))
    assert energy == pytest.approx(density * 3.0 * 2.0 * 1.6, rel=1e-10)


def test_yeohs_pretension_lets_the_sheet_lie_still() -> None:
    mesh = sheet_mesh((10.0, 8.0), 2.0, element_mm=2.0)
    body = elastic_body(mesh, STIFFENING, pretension_N_per_mm=0.15)
    _, force, _ = body.forces(np.zeros_like(mesh.node_mm))
    assert np.abs(force[~mesh.is_on_outline]).max() < 1e-12
    assert force[np.isclose(mesh.node_mm[:, 0], 5.0), 0].sum() == pytest.approx(0.15 * 8.0, rel=1e-9)


def test_a_small_pretension_is_hookes_law() -> None:
    material = NeoHooke(young_MPa=2.0, poisson=0.4)
    stretch = material.prestretch(1e-4, 2.0)
    assert stretch[0] - 1.0 == pytest.approx((1 - 0.4) / 2.0 * 1e-4 / 2.0, rel=1e-3)
    assert stretch[2] - 1.0 == pytest.approx(-2 * 0.4 / 2.0 * 1e-4 / 2.0, rel=1e-3)


@pytest.mark.parametrize(("young", "poisson"), [(0.0, 0.4), (1.0, 0.5), (1.0, -0.1)])
def test_an_impossible_material_is_refused(young: float, poisson: float) -> None:
    with pytest.raises(ValueError, match="expected"):
        NeoHooke(young_MPa=young, poisson=poisson)
