"""How long the finite elements take: one linear system, one sphere to 10 mm, six contacts.

Run with OMP_NUM_THREADS=1 for one thread: `python benchmarks/bench_fem.py [--sphere] [--six]`.
"""

import argparse
import resource
import time
from collections.abc import Callable

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from manytouch.simulation.fem.contact.indenters import (
    Fingertip,
    LyingCylinder,
    RoundPunch,
    Sphere,
    SquarePunch,
    convex_hull,
)
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.fem.sheet import SheetModel, sheet_solver, solve_sheet
from manytouch.simulation.fem.solver.multifrontal import MultifrontalSolver
from manytouch.simulation.fem.solver.newton import NewtonSolver

MODEL = SheetModel(size_mm=(120.0, 80.0), thickness_mm=3.0, material=NeoHooke(young_MPa=3.1, poisson=0.45))
DEPTHS_MM = np.array([2.0, 4.0, 6.0, 8.0, 10.0])


def best_s(work: Callable[[], object], times: int = 3) -> float:
    taken = []
    for _ in range(times):
        begin = time.perf_counter()
        work()
        taken.append(time.perf_counter() - begin)
    return min(taken)


def linear_system(solver: NewtonSolver) -> None:
    body, free = solver.body, solver.is_free
    still = np.zeros_like(body.mesh.node_mm)
    _, tangent = body.forces_and_tangent(still)
    order = MultifrontalSolver(mesh=body.mesh, is_free=free)
    print(f"forces                {best_s(lambda: body.forces(still)):8.3f} s")
    print(f"forces and tangent    {best_s(lambda: body.forces_and_tangent(still)):8.3f} s")
    for name, is_symmetric in (("Cholesky", True), ("LU", False)):
        taken = best_s(lambda wanted=is_symmetric: order.factorise(tangent, is_symmetric=wanted))
        print(f"fronts, {name:<14}{taken:8.3f} s")
    factors = order.factorise(tangent, is_symmetric=True)
    print(f"substitution          {best_s(lambda: factors.solve(still + 1.0)):8.3f} s")
    unknown = (3 * body.mesh.element[:, :, None] + np.arange(3)).reshape(-1, 60)
    place = (np.repeat(unknown, 60, axis=1).ravel(), np.tile(unknown, 60).ravel())
    matrix = scipy.sparse.coo_matrix((tangent.ravel(), place)).tocsc()
    kept = np.flatnonzero(free.ravel())
    matrix = matrix[kept][:, kept]

    def superlu() -> object:
        return scipy.sparse.linalg.splu(
            matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )

    print(f"SuperLU, MMD_AT_PLUS_A{best_s(superlu, 1):8.3f} s  ({matrix.shape[0]} unknowns)")


def presses(solver: NewtonSolver, name: str, loading: Loading) -> None:
    begin = time.perf_counter()
    states = list(solve_sheet(solver, loading))
    taken, systems = time.perf_counter() - begin, sum(state.newton_steps for state in states)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{name}: {taken:.1f} s, {systems} linear systems, {memory:.2f} GB, {states[-1].status}")
    for contact in states[-1].contacts:
        print(f"    {contact.normal_force_N:7.3f} N, {contact.area_mm2:6.1f} mm2 at {contact.centre_mm}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sphere", action="store_true", help="one sphere to 10 mm")
    parser.add_argument("--six", action="store_true", help="six shapes to 5-10 mm, and six spheres to 10 mm")
    options = parser.parse_args()
    solver = sheet_solver(MODEL)
    linear_system(solver)

    def touches(shapes: list, places: list, shares: list) -> Loading:
        paths = [
            np.column_stack([np.full(5, x), np.full(5, y), share * DEPTHS_MM])
            for (x, y), share in zip(places, shares, strict=True)
        ]
        return Loading(
            touches=tuple(
                press(shape, thickness_mm=3.0, path_mm=path)
                for shape, path in zip(shapes, paths, strict=True)
            )
        )

    if options.sphere:
        presses(solver, "sphere of 5 mm to 10 mm", touches([Sphere(radius_mm=5.0)], [(3.0, 2.0)], [1.0]))
    if options.six:
        places = [(-38.0, -20.0), (0.0, -19.0), (37.0, -21.0), (-36.0, 20.0), (1.0, 21.0), (38.0, 19.0)]
        cube = np.array([[x, y, z] for x in (-4.0, 4.0) for y in (-4.0, 4.0) for z in (0.0, 8.0)])
        shapes = [
            Sphere(radius_mm=5.0),
            RoundPunch(radius_mm=5.0),
            SquarePunch(side_mm=(8.0, 8.0)),
            LyingCylinder(radius_mm=4.0, length_mm=12.0),
            Fingertip(semi_axes_mm=(7.0, 9.0, 6.0)),
            convex_hull(cube, edge_radius_mm=0.5),
        ]
        spheres = [Sphere(radius_mm=4.0 + number) for number in range(6)]
        presses(solver, "six spheres to 10 mm", touches(spheres, places, [1.0] * 6))
        presses(solver, "six shapes", touches(shapes, places, [1.0, 0.8, 0.6, 0.7, 0.9, 0.5]))


if __name__ == "__main__":
    main()
