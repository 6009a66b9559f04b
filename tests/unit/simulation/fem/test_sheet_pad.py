"""A bonded pad of finite elements against the closed form of the infinite bonded layer, and its meshes.

The layer (R. Merkel et al., Biophys. J. 93 (2007) 3314): thickness h, wave number k, q = k h, tractions
t_L sin kx along x and t_z cos kx along z on its free face; shear across k decouples.
"""

import numpy as np
import pytest

from manytouch.simulation.fem.contact.forces import touched_face
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.elements.elastic_body import elastic_body
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.elements.mesh import tensor_mesh
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.fem.sheet import PadModel, Refinement, pad_model, sheet_solver, solve_sheet
from manytouch.simulation.fem.solver.multifrontal import MultifrontalSolver
from manytouch.simulation.fem.state import SheetState

THICKNESS_MM = 4.0


def closed_form(q: float, poisson: float) -> tuple[np.ndarray, float]:
    """[[u_L of t_L, u_L of t_z], [u_z of t_L, u_z of t_z]] and u_T of t_T, times shear modulus times k."""
    sinh, cosh, drained = np.sinh(q), np.cosh(q), 3.0 - 4.0 * poisson
    denominator = drained * cosh**2 + q**2 + (1.0 - 2.0 * poisson) ** 2
    along = (1.0 - poisson) * (drained * sinh * cosh + q) / denominator
    normal = (1.0 - poisson) * (drained * sinh * cosh - q) / denominator
    coupling = (q**2 - (1.0 - 2.0 * poisson) * drained * sinh**2) / (2.0 * denominator)
    return np.array([[along, -coupling], [-coupling, normal]]), float(np.tanh(q))


def strip(q: float, poisson: float, amplitude: np.ndarray) -> np.ndarray:
    """Amplitudes (3,) of the face's displacement under tractions t_L sin kx, t_T cos kx, t_z cos kx."""
    k = q / THICKNESS_MM
    x_mm = np.linspace(0.0, np.pi / k, max(9, round(2.5 * np.pi / q) + 1))
    mesh = tensor_mesh(x_mm, np.array([0.0, 1.0]), np.linspace(0.0, THICKNESS_MM, 9))
    rubber = NeoHooke(young_MPa=0.3, poisson=poisson)
    is_free = np.ones_like(mesh.node_mm, dtype=bool)
    is_free[mesh.node_mm[:, 2] == 0.0] = False
    is_shear_across = amplitude[1] != 0.0
    is_free[:, [0, 2] if is_shear_across else [1]] = False
    if not is_shear_across:  # half a wave, between two planes of symmetry
        is_free[np.isin(mesh.node_mm[:, 0], x_mm[[0, -1]]), 0] = False
    face = touched_face(mesh)
    phase = k * face.rest_mm[:, :, 0]
    waves = np.stack([np.sin(phase), np.cos(phase), np.cos(phase)], axis=-1)
    force_N = np.where(is_free, face.nodal_force_N(mesh, waves * amplitude), 0.0)
    _, tangent = elastic_body(mesh, rubber).forces_and_tangent(np.zeros_like(mesh.node_mm))
    moved_mm = (
        MultifrontalSolver(mesh=mesh, is_free=is_free).factorise(tangent, is_symmetric=True).solve(force_N)
    )
    top = mesh.node_mm[:, 2] == THICKNESS_MM
    phase = k * mesh.node_mm[top, 0]
    waves = np.stack([np.sin(phase), np.cos(phase), np.cos(phase)], axis=-1)
    found: np.ndarray = (moved_mm[top] * waves).sum(axis=0) / (waves**2).sum(axis=0) * rubber.shear_MPa * k
    return found


@pytest.mark.parametrize("poisson", [0.3, 0.45, 0.49])
@pytest.mark.parametrize("q", [0.3, 0.64, 1.5, 3.0])
def test_a_pad_under_waves_is_the_bonded_layer(q: float, poisson: float) -> None:
    expected, across = closed_form(q, poisson)
    by_shear, by_pressure = (strip(q, poisson, np.array(load)) for load in ((1.0, 0, 0), (0, 0, 1.0)))
    np.testing.assert_allclose(
        [by_shear[[0, 2]], by_pressure[[0, 2]]], expected.T, rtol=5e-3, atol=2e-3 * abs(expected).max()
    )
    assert strip(q, poisson, np.array([0.0, 1.0, 0.0]))[1] == pytest.approx(across, rel=2e-3)


def pad(
    element_mm: float, layers: int, refined: tuple[Refinement, ...] = (), poisson: float = 0.48
) -> PadModel:
    rubber = NeoHooke(young_MPa=0.3, poisson=poisson)
    return pad_model(
        (12.0, 10.0),
        THICKNESS_MM,
        rubber,
        marker_depth_mm=0.5,
        element_mm=element_mm,
        layers=layers,
        refined=refined,
    )


def ball(path_mm: list[list[float]], friction: float = 0.0) -> Loading:
    sphere = Sphere(radius_mm=4.0)
    touch = press(sphere, thickness_mm=THICKNESS_MM, path_mm=np.array(path_mm), friction=friction)
    return Loading(touches=(touch,))


def last(model: PadModel, loading: Loading) -> SheetState:
    *_, state = solve_sheet(sheet_solver(model), loading)
    return state


def test_lines_meet_the_markers_and_are_dense_where_bodies_touch() -> None:
    fine = Refinement(low_mm=(-1.0, 0.0), high_mm=(1.0, 2.0), element_mm=0.5)
    x_mm, y_mm, z_mm = (np.array(line) for line in pad(2.0, 4, (fine,)).lines_mm)
    for line_mm, half_mm, inside_mm in ((x_mm, 6.0, 0.0), (y_mm, 5.0, 1.0)):
        np.testing.assert_allclose(line_mm[[0, -1]], [-half_mm, half_mm])
        width_mm, middle_mm = np.diff(line_mm), 0.5 * (line_mm[1:] + line_mm[:-1])
        assert width_mm[np.abs(middle_mm - inside_mm) < 1.0].max() <= 0.5
        assert 1.0 < width_mm.max() <= 2.0
    np.testing.assert_allclose(z_mm, [0.0, 0.875, 1.75, 2.625, 3.5, 4.0])


def test_a_press_is_carried_by_the_window_and_squeezes_the_pad_outward() -> None:
    model = pad(1.5, 3)
    state = last(model, ball([[0.0, 0.0, 0.3], [0.0, 0.0, 0.6]]))
    assert state.status == "ok"
    np.testing.assert_allclose(state.support_N, -state.contacts[0].force_N, atol=1e-4)
    node_mm, moved_mm = state.mesh.node_mm, state.displacement_mm
    assert np.all(moved_mm[node_mm[:, 2] == 0.0] == 0.0)
    side = (np.abs(node_mm[:, 0]) == 6.0) & (node_mm[:, 2] > 1.0)
    assert np.all(moved_mm[side, 0] * node_mm[side, 0] > 0.0)  # the sides are free and bulge


@pytest.mark.parametrize(("element_mm", "layers"), [(2.0, 2), pytest.param(1.5, 3, marks=pytest.mark.slow)])
def test_shear_of_a_sticking_ball_is_limited_by_friction(element_mm: float, layers: int) -> None:
    moves = [[0.0, 0.0, 0.25], [0.0, 0.0, 0.5], [0.1, 0.0, 0.5], [0.2, 0.0, 0.5]]
    sticking, sliding = (
        last(pad(element_mm, layers), ball(moves, friction)).contacts[0] for friction in (1.0, 0.05)
    )
    assert 0.2 < sticking.force_N[0] / sticking.normal_force_N < 0.8
    assert sliding.force_N[0] / sliding.normal_force_N == pytest.approx(0.05, rel=0.2)


@pytest.mark.slow
def test_a_finer_mesh_changes_little() -> None:
    fine = Refinement(low_mm=(-1.0, -1.0), high_mm=(1.0, 1.0), element_mm=0.5)
    finer = Refinement(low_mm=(-1.0, -1.0), high_mm=(1.0, 1.0), element_mm=0.3)
    loading = ball([[0.0, 0.0, 0.1], [0.0, 0.0, 0.4]])
    coarse, halved = (
        list(solve_sheet(sheet_solver(model), loading))
        for model in (pad(1.5, 4, (fine,)), pad(1.0, 6, (finer,)))
    )
    for one, other in zip(coarse, halved, strict=True):
        assert one.contacts[0].normal_force_N == pytest.approx(other.contacts[0].normal_force_N, rel=5e-3)
