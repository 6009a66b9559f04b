"""The finite elements against clamped plates, a ball on a block, and themselves on finer meshes.

Plates: S. Timoshenko and S. Woinowsky-Krieger, Theory of Plates and Shells (1959), tables 35 and 37;
large deflection: S. Levy, NACA TN 847 (1942). Ball: K. L. Johnson, Contact Mechanics (1985), eq. 4.22-4.24.
"""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.elements.elastic_body import elastic_body
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.elements.mesh import HexMesh, tensor_mesh
from manytouch.simulation.fem.loading import Loading, PressurePatch, press
from manytouch.simulation.fem.sheet import SheetModel, sheet_solver, solve_sheet
from manytouch.simulation.fem.solver.newton import NewtonSolver

CENTRE = np.zeros((1, 2))


def plate(width: float, height: float, thickness: float, element: float, poisson: float = 0.3) -> SheetModel:
    material = NeoHooke(young_MPa=1000.0, poisson=poisson)
    return SheetModel(size_mm=(width, height), thickness_mm=thickness, material=material, element_mm=element)


def deflections_mm(model: SheetModel, size_mm: tuple[float, float], forces_N: np.ndarray) -> np.ndarray:
    force = np.zeros((len(forces_N), 3))
    force[:, 2] = -forces_N
    patch = PressurePatch(centre_mm=(0.0, 0.0), size_mm=size_mm, outline="rectangle", force_N=force)
    states = list(solve_sheet(sheet_solver(model), Loading(patches=(patch,))))
    assert all(state.status == "ok" for state in states)
    return np.array([-state.camera_side(CENTRE)[0][0, 2] for state in states])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "patch", "factor", "within"),
    [
        ((100.0, 100.0), (100.0, 100.0), 0.00126, 0.01),
        ((150.0, 100.0), (150.0, 100.0), 0.00220, 0.01),
        ((100.0, 100.0), (3.0, 3.0), 0.00560, 0.02),
    ],
    ids=["even, square", "even, 1.5:1", "in the middle"],
)
def test_clamped_plates_bend_as_thin_plates(
    size: tuple[float, float], patch: tuple[float, float], factor: float, within: float
) -> None:
    thickness, poisson = 1.0, 0.3
    model = plate(*size, thickness, 2.5, poisson)
    stiffness = 1000.0 * thickness**3 / (12.0 * (1.0 - poisson**2))
    force = 1e-3
    short = min(size)
    per_load = force * short**2 if patch != size else force / np.prod(size) * short**4
    deflection = deflections_mm(model, patch, np.array([force]))[0]
    assert deflection * stiffness / per_load == pytest.approx(factor, rel=within)


@pytest.mark.slow
def test_a_clamped_square_plate_stiffens_as_levy_found() -> None:
    load = np.array([17.79, 38.3, 63.4, 95.0, 134.9, 184.0, 245.0, 318.0, 402.0])
    expected = np.array([0.237, 0.471, 0.695, 0.912, 1.121, 1.323, 1.521, 1.714, 1.902])
    side, thickness = 100.0, 1.0
    force = load * 1000.0 * thickness**4 / side**4 * side**2
    deflection = deflections_mm(plate(side, side, thickness, 5.0, 0.316), (side, side), force) / thickness
    np.testing.assert_allclose(deflection, expected, rtol=0.03)


def quarter(mesh: HexMesh, material: NeoHooke, *, holds_bottom: bool) -> NewtonSolver:
    """Mirrored at x = 0 and y = 0, held at the far sides and, for a block, at the bottom."""
    (x, y, _), node = mesh.lines_mm, mesh.node_mm
    free = np.ones_like(node, dtype=np.bool_)
    free[np.isclose(node[:, 0], 0.0), 0] = False
    free[np.isclose(node[:, 1], 0.0), 1] = False
    far = np.isclose(node[:, 0], x[-1]) | np.isclose(node[:, 1], y[-1])
    free[far | (holds_bottom & np.isclose(node[:, 2], 0.0))] = False
    return NewtonSolver(body=elastic_body(mesh, material), is_free=free)


@pytest.mark.slow
@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_a_ball_on_a_thick_block_follows_hertz(poisson: float) -> None:
    radius, size = 10.0, 24.0
    line = np.concatenate(
        [np.linspace(0.0, 1.5, 7), 1.5 + (size - 1.5) * np.linspace(0.0, 1.0, 7)[1:] ** 2.2]
    )
    material = NeoHooke(young_MPa=1.0, poisson=poisson)
    solver = replace(
        quarter(tensor_mesh(line, line, size - line[::-1]), material, holds_bottom=True),
        contact_stiffness_per_mm=100.0,
    )
    touch = press(Sphere(radius_mm=radius), thickness_mm=size, path_mm=np.array([[0.0, 0.0, 0.1]]))
    state = list(solve_sheet(solver, Loading(touches=(touch,))))[-1]
    assert state.status == "ok"
    modulus = 1.0 / (1.0 - poisson**2)
    force = 4.0 * state.contacts[0].normal_force_N
    peak = (6.0 * force * modulus**2 / (np.pi**3 * radius**2)) ** (1.0 / 3.0)
    assert state.pressure_MPa.max() == pytest.approx(peak, rel=0.03)
    contact = (3.0 * force * radius / (4.0 * modulus)) ** (1.0 / 3.0)
    assert 4.0 * state.contacts[0].area_mm2 == pytest.approx(np.pi * contact**2, rel=0.1)
    approach = contact**2 / radius
    far = 4.0 / 3.0 * contact / (np.pi * size) * approach  # of a half space at the distance of the bottom
    assert approach + far == pytest.approx(0.1, rel=0.06)  # the sides are held, which a half space is not


@pytest.mark.slow
@pytest.mark.parametrize("radius", [5.0, 10.0])
def test_halving_the_elements_changes_little(radius: float) -> None:
    """A quarter of the sheet of 120 x 80 x 3 mm, 2 mm and one layer against 1 mm and two."""
    material = NeoHooke(young_MPa=3.1, poisson=0.45)
    depth_mm = np.array([2.0, 6.0, 10.0])
    path = np.column_stack([np.zeros((3, 2)), depth_mm])
    results = []
    for halves in (1, 2):
        x, y = np.linspace(0.0, 60.0, 30 * halves + 1), np.linspace(0.0, 40.0, 20 * halves + 1)
        solver = quarter(tensor_mesh(x, y, np.linspace(0.0, 3.0, halves + 1)), material, holds_bottom=False)
        touch = press(Sphere(radius_mm=radius), thickness_mm=3.0, path_mm=path)
        states = list(solve_sheet(solver, Loading(touches=(touch,))))
        assert all(state.status == "ok" for state in states)
        results.append(
            [(state.contacts[0].normal_force_N, -state.camera_side(CENTRE)[0][0, 2]) for state in states]
        )
    coarse, fine = np.array(results)
    np.testing.assert_allclose(coarse[:, 0], fine[:, 0], rtol=0.02)
    np.testing.assert_allclose(coarse[:, 1], fine[:, 1], rtol=0.01)


@pytest.mark.slow
def test_a_press_does_not_lock_near_incompressibility() -> None:
    """Between nu = 0.45 and 0.49 the force of a coarse mesh changes as that of a fine one does."""
    path = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 5.0]])
    loading = Loading(touches=(press(Sphere(radius_mm=6.0), thickness_mm=3.0, path_mm=path),))
    rise = []
    for element in (4.0, 2.0):
        force = [
            list(
                solve_sheet(
                    sheet_solver(
                        SheetModel(
                            size_mm=(48.0, 40.0),
                            thickness_mm=3.0,
                            material=NeoHooke(young_MPa=3.1, poisson=poisson),
                            element_mm=element,
                        )
                    ),
                    loading,
                )
            )[-1]
            .contacts[0]
            .normal_force_N
            for poisson in (0.45, 0.49)
        ]
        rise.append(force[1] / force[0])
    assert rise[0] == pytest.approx(rise[1], rel=0.01)
    assert rise[1] < 1.08
