"""Contact: its linearisation, its balance, and its read-out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_info, threadpool_limits

from manytouch.simulation.fem.contact.forces import (
    ContactField,
    ContactLaw,
    PosedShape,
    add_contact,
    touched_face,
)
from manytouch.simulation.fem.contact.indenters import (
    Indenter,
    RoundPunch,
    Sphere,
    SquarePunch,
    pack,
    signed_distance,
)
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.elements.mesh import sheet_mesh
from manytouch.simulation.fem.loading import IndenterPath, Loading, PressurePatch, press
from manytouch.simulation.fem.sheet import SheetModel, sheet_solver, solve_sheet
from manytouch.simulation.fem.solver.balance import NO_FRICTION, NO_TANGENT, ForceBalance, Substep
from manytouch.simulation.fem.solver.multifrontal import Factorisation, MultifrontalSolver
from manytouch.simulation.fem.solver.newton import NewtonSolver
from manytouch.simulation.fem.state import SheetState

THICKNESS_MM = 3.0
MODEL = SheetModel(
    size_mm=(24.0, 20.0),
    thickness_mm=THICKNESS_MM,
    material=NeoHooke(young_MPa=3.0, poisson=0.45),
    element_mm=2.0,
)


@cache
def solver(model: SheetModel = MODEL) -> NewtonSolver:
    return sheet_solver(model)


def touch(
    indenter: Indenter, *path_mm: tuple[float, float, float], friction: float = 0.0, yaw: float = 0.0
) -> IndenterPath:
    path = np.array(path_mm)
    return press(
        indenter,
        thickness_mm=THICKNESS_MM,
        path_mm=path,
        friction=friction,
        yaw_rad=np.linspace(0.0, yaw, len(path)),
    )


@cache
def pressed() -> SheetState:
    loading = Loading(touches=(touch(Sphere(radius_mm=5.0), (1.3, -0.7, 2.0)),))
    return list(solve_sheet(solver(), loading))[-1]


def test_the_step_is_solved_and_nothing_is_left_over() -> None:
    state = pressed()
    assert state.status == "ok"
    assert state.reached == 1.0
    balance = state.contacts[0].force_N + state.support_N
    assert np.abs(balance).max() < 1e-9


def test_the_fronts_are_factorised_in_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    threads = []

    def factorise(self: MultifrontalSolver, tangent: np.ndarray, *, is_symmetric: bool) -> Factorisation:
        threads.extend(each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas")
        return plain(self, tangent, is_symmetric=is_symmetric)

    plain = MultifrontalSolver.factorise
    monkeypatch.setattr(MultifrontalSolver, "factorise", factorise)
    loading = Loading(touches=(touch(Sphere(radius_mm=5.0), (0.0, 0.0, 0.2)),))
    with threadpool_limits(limits=2, user_api="blas"):
        assert list(solve_sheet(solver(), loading))[-1].status == "ok"
    assert threads
    assert set(threads) == {1}


def test_the_contact_lies_under_the_indenter_and_pushes_down() -> None:
    contact = pressed().contacts[0]
    np.testing.assert_allclose(contact.centre_mm, [1.3, -0.7], atol=0.15)
    assert contact.normal_force_N > 0.0
    touching_mm2 = (pressed().pressure_MPa[0] > 0.0) * touched_face(solver().body.mesh).area_mm2
    assert contact.area_mm2 == pytest.approx(touching_mm2.sum(), rel=0.3)
    assert contact.penetration_mm < 0.05
    assert abs(contact.torque_Nmm) < 1e-3 * contact.normal_force_N


def test_the_sheet_goes_down_with_the_indenter_and_not_through_it() -> None:
    displacement, gradient = pressed().camera_side(np.array([[1.3, -0.7], [12.0, 0.0]]))
    assert -2.1 < displacement[0, 2] < -1.6
    np.testing.assert_allclose(displacement[1], 0.0, atol=1e-12)
    assert np.linalg.det(gradient[0]) == pytest.approx(1.0, abs=0.1)


def test_a_mirrored_press_gives_the_mirrored_sheet() -> None:
    loading = Loading(touches=(touch(Sphere(radius_mm=5.0), (-1.3, -0.7, 2.0)),))
    mirrored = list(solve_sheet(solver(), loading))[-1]
    place = np.random.default_rng(0).uniform(-9.0, 9.0, (20, 2))
    one, _ = pressed().camera_side(place)
    other, _ = mirrored.camera_side(place * [-1.0, 1.0])
    np.testing.assert_allclose(other, one * [-1.0, 1.0, 1.0], atol=1e-4)


def test_a_sheet_twice_as_stiff_takes_twice_the_force_and_the_same_shape() -> None:
    model = replace(MODEL, material=NeoHooke(young_MPa=6.0, poisson=0.45))
    loading = Loading(touches=(touch(Sphere(radius_mm=5.0), (1.3, -0.7, 2.0)),))
    state = list(solve_sheet(sheet_solver(model), loading))[-1]
    np.testing.assert_allclose(state.displacement_mm, pressed().displacement_mm, atol=1e-5)
    np.testing.assert_allclose(
        state.contacts[0].force_N, 2.0 * pressed().contacts[0].force_N, rtol=1e-4, atol=1e-4
    )


def test_an_indenter_that_leaves_leaves_nothing_behind() -> None:
    path = ((0.0, 0.0, 1.5), (0.0, 0.0, -0.5))
    last = list(solve_sheet(solver(), Loading(touches=(touch(Sphere(radius_mm=5.0), *path),))))[-1]
    assert last.contacts[0].normal_force_N == 0.0
    assert np.isnan(last.contacts[0].centre_mm).all()
    assert np.abs(last.displacement_mm).max() < 1e-5


def test_without_friction_the_way_does_not_matter() -> None:
    path = ((3.0, 0.0, 2.5), (1.3, -0.7, 2.0))
    last = list(solve_sheet(solver(), Loading(touches=(touch(Sphere(radius_mm=5.0), *path),))))[-1]
    np.testing.assert_allclose(last.displacement_mm, pressed().displacement_mm, atol=1e-4)


def test_a_dragged_punch_pulls_until_it_slides() -> None:
    friction = 0.4
    path = ((0.0, 0.0, 1.5), (0.05, 0.0, 1.5), (3.0, 0.0, 1.5))
    loading = Loading(touches=(touch(Sphere(radius_mm=6.0), *path, friction=friction),))
    still, begun, sliding = (state.contacts[0] for state in solve_sheet(solver(), loading))
    assert abs(still.force_N[0]) < 0.02 * still.normal_force_N
    assert 0.02 * begun.normal_force_N < begun.force_N[0] < friction * begun.normal_force_N
    assert sliding.force_N[0] == pytest.approx(friction * sliding.normal_force_N, rel=0.15)
    assert abs(sliding.force_N[1]) < 0.01 * sliding.force_N[0]


def test_a_twisted_punch_turns_the_sheet_with_it() -> None:
    path = ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    loading = Loading(touches=(touch(SquarePunch(side_mm=(8.0, 8.0)), *path, friction=1.0, yaw=0.1),))
    before, after = (state.contacts[0] for state in solve_sheet(solver(), loading))
    assert abs(before.torque_Nmm) < 1e-2 * after.torque_Nmm
    assert 0.0 < after.torque_Nmm < after.normal_force_N * 4.0 * np.sqrt(2.0)


def test_a_patch_is_read_with_its_own_force_and_place() -> None:
    patch = PressurePatch(
        centre_mm=(2.0, -3.0), size_mm=(6.0, 4.0), outline="rectangle", force_N=np.array([[0.1, 0.0, -1.0]])
    )
    state = list(solve_sheet(solver(), Loading(patches=(patch,))))[-1]
    contact = state.contacts[0]
    np.testing.assert_allclose(contact.force_N, [0.1, 0.0, -1.0])
    np.testing.assert_allclose(contact.centre_mm, [2.0, -3.0], atol=0.05)
    assert contact.area_mm2 == pytest.approx(24.0, rel=0.1)
    assert np.abs(contact.force_N + state.support_N).max() < 1e-6


def test_the_frame_carries_the_weight() -> None:
    model = replace(MODEL, gravity=(0.0, 0.0, -1.0))
    loading = Loading(touches=(touch(Sphere(radius_mm=5.0), (0.0, 0.0, -5.0)),))
    state = list(solve_sheet(sheet_solver(model), loading))[-1]
    assert state.support_N[2] == pytest.approx(24.0 * 20.0 * 3.0 * 960e-9 * 9.80665, rel=1e-6)
    assert state.displacement_mm[:, 2].min() < 0.0


def test_steps_of_several_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="steps"):
        Loading(
            touches=(
                touch(Sphere(radius_mm=5.0), (0.0, 0.0, 1.0)),
                touch(Sphere(radius_mm=5.0), *[(0.0, 0.0, 1.0)] * 2),
            )
        )


@pytest.mark.parametrize(
    ("indenter", "friction"),
    [
        pytest.param(Sphere(radius_mm=4.0), 0.0, id="sphere-smooth"),
        pytest.param(RoundPunch(radius_mm=3.0), 0.3, id="punch-rough"),
        pytest.param(Sphere(radius_mm=4.0), 0.3, id="sphere-rough", marks=pytest.mark.slow),
        pytest.param(RoundPunch(radius_mm=3.0), 0.0, id="punch-smooth", marks=pytest.mark.slow),
    ],
)
def test_the_tangent_agrees_with_differences(indenter: Indenter, friction: float) -> None:
    """In mid-step, with points that stick, slide, arrive and leave."""
    solver_ = solver()
    loading = Loading(
        touches=(touch(indenter, (0.4, 0.3, 1.0), (0.45, 0.35, 1.2), friction=friction, yaw=0.05),)
    )
    state = solver_.step(solver_.start(loading), loading, 0)
    balance = ForceBalance(
        body=solver_.body,
        face=touched_face(solver_.body.mesh),
        loading=loading,
        stiffness_MPa_per_mm=30.0,
        rounding_mm=0.02,
    )
    substep: Substep = balance.load_step(state, 1, (0.0, 0.0, 0.0)).substep(1.0, state)
    rng = np.random.default_rng(2)
    bent = state.displacement_mm + 0.01 * rng.standard_normal(state.displacement_mm.shape) * solver_.is_free
    along = rng.standard_normal(bent.shape) * solver_.is_free
    step = 1e-7
    above, _, _ = balance.residual(state, substep, bent + step * along, solver_.is_free)
    below, _, _ = balance.residual(state, substep, bent - step * along, solver_.is_free)
    tangent = balance.tangent(state, substep, bent)
    product, element = np.zeros_like(bent), solver_.body.mesh.element
    flat = along[element].reshape(len(tangent), 60)
    np.add.at(product, element, np.einsum("eij,ej->ei", tangent, flat).reshape(-1, 20, 3))
    numeric = (above - below) / (2 * step)
    np.testing.assert_allclose(
        np.where(solver_.is_free, product, 0.0), numeric, atol=2e-6 * np.abs(numeric).max()
    )
    assert np.abs(numeric).max() > 1.0


@pytest.mark.parametrize("rounding_mm", [0.02, 0.5])
def test_the_kernel_agrees_with_the_penalty_law_in_numpy(rounding_mm: float) -> None:
    rng = np.random.default_rng(5)
    mesh, ball, stiffness = sheet_mesh((8.0, 6.0), THICKNESS_MM), Sphere(radius_mm=4.0), 30.0
    face, bent = touched_face(mesh), 0.05 * rng.standard_normal(mesh.node_mm.shape)
    position, rotation = np.array([0.3, -0.2, 2.5]), Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    shape = face.area_mm2.shape
    field = ContactField(np.zeros(shape), np.zeros((*shape, 3)), np.zeros((*shape, 3)))
    kind, numbers = pack((ball,))
    force = np.zeros_like(bent)
    deepest = add_contact(
        bent,
        face.arrays(mesh),
        PosedShape(kind[0], numbers[0], position, rotation),
        ContactLaw(0.0, stiffness, rounding_mm, 1.0),
        NO_FRICTION,
        field,
        force,
        NO_TANGENT,
    )
    local = (face.displaced(mesh, bent) - position) @ rotation
    distance, gradient, _ = signed_distance(ball, local.reshape(-1, 3))
    depth = np.maximum(-distance, 0.0).reshape(shape)
    assert deepest == pytest.approx(depth.max(), rel=1e-12)
    soft, hard = 0.5 * depth**2 / rounding_mm, depth - 0.5 * rounding_mm
    pressure = stiffness * np.where(depth < rounding_mm, soft, hard)
    np.testing.assert_allclose(field.pressure_MPa, pressure, atol=1e-12)
    assert (pressure > 0.0).sum() > 10
    traction = pressure[..., None] * (gradient @ rotation.T).reshape(*shape, 3)
    np.testing.assert_allclose(force, face.nodal_force_N(mesh, traction), atol=1e-12)
