"""Constants of the clamped outline of a slab by finite elements; see `mechanics.shell.clamped_end`.

    python benchmarks/clamped_end.py [--elements 32] [--length L --layers N]

A slab of thickness 1 in plane strain, whose side face is held, is bent by a couple and by a force at its
other end. Straight lines are fitted to what its camera-side face moves beyond a beam, far from both ends. The
table has e0, e1 from both loads, which must agree by reciprocity, and e2, and then the polynomials that the
shell uses; below it are polynomials of degree 5 that were fitted to the table. The column "tension" is the
length of the slab that does not stretch where it is pulled. With --length (over the thickness) the slab has
even elements of that length, quadratic as those of the solids in `manytouch.simulation`.
"""

import argparse

import numpy as np
import skfem
from skfem.models.elasticity import lame_parameters, linear_elasticity

from manytouch.mechanics.shell.clamped_end import clamped_end
from manytouch.mechanics.shell.shell import SHEAR_FACTOR

LENGTH = 7.0
FAR = (2.0, LENGTH - 2.0)
POISSON = (0.0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.43, 0.45, 0.47, 0.48, 0.49, 0.495, 0.499)


def graded(elements: int) -> skfem.MeshQuad:
    """A slab with small elements at its corners, `elements` across half its thickness."""
    beyond = np.linspace(1.0, LENGTH, 4 * elements)[1:]
    along = np.concatenate([np.linspace(0.0, 1.0, 2 * elements + 1) ** 1.5, beyond])
    from_face = 0.5 - 0.5 * np.linspace(1.0, 0.0, elements + 1) ** 1.5
    across = np.unique(np.round(np.concatenate([from_face - 0.5, 0.5 - from_face]), 12))
    return skfem.MeshQuad.init_tensor(along, across)


def even(length: float, layers: int) -> skfem.MeshQuad:
    """A slab with equal elements."""
    along = np.linspace(0.0, LENGTH, round(LENGTH / length) + 1)
    return skfem.MeshQuad.init_tensor(along, np.linspace(-0.5, 0.5, layers + 1))


def end_constants(
    poisson: float, mesh: skfem.MeshQuad, element: skfem.Element
) -> tuple[float, float, float, float, float]:
    """e0, e1 by the couple, e1 by the force, e2, and the length that is not stretched; thickness 1."""
    basis = skfem.Basis(mesh, skfem.ElementVector(element), intorder=6)
    stiffness = linear_elasticity(*lame_parameters(1.0, poisson)).assemble(basis)
    end = basis.boundary(mesh.facets_satisfying(lambda place: np.isclose(place[0], LENGTH)))
    held = basis.get_dofs(lambda place: np.isclose(place[0], 0.0)).all()
    rigidity = 1.0 / (12.0 * (1.0 - poisson**2))
    face = basis.get_dofs(
        lambda place: np.isclose(place[1], -0.5) & (place[0] > FAR[0]) & (place[0] < FAR[1])
    ).all("u^2")
    x = basis.doflocs[0, face]

    def solved(load: skfem.LinearForm) -> np.ndarray:
        return np.asarray(skfem.solve(*skfem.condense(stiffness, load.assemble(end), D=held)))

    def moved(load: skfem.LinearForm) -> np.ndarray:
        return solved(load)[face]

    by_couple = moved(skfem.LinearForm(lambda v, at: -12.0 * rigidity * at.x[1] * v[0]))
    by_force = moved(skfem.LinearForm(lambda v, at: 1.5 * rigidity * (1.0 - 4.0 * at.x[1] ** 2) * v[1]))
    # couple: b_nn = 1, b_nnn = 0 and w = b - a; force: b_nn = LENGTH - x, b_nnn = -1 and w = b - a b_nn
    slope, value = np.polyfit(x, by_couple + SHEAR_FACTOR - 0.5 * x**2, 1)
    beam = 0.5 * LENGTH * x**2 - x**3 / 6.0
    slope_2, value_2 = np.polyfit(x, by_force + SHEAR_FACTOR * (LENGTH - x) - beam, 1)
    pulled = np.asarray(end.interpolate(solved(skfem.LinearForm(lambda v, _: v[0]))))[0]
    tension = LENGTH - float((pulled * end.dx).sum() / end.dx.sum()) / (1.0 - poisson**2)
    return slope, SHEAR_FACTOR - value, slope * LENGTH - slope_2, value * LENGTH - value_2, tension


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--elements", type=int, default=32, help="across half the thickness")
    parser.add_argument("--length", type=float, help="of even elements, over the thickness")
    parser.add_argument("--layers", type=int, default=1, help="of even elements")
    given = parser.parse_args()
    mesh, element = graded(given.elements), skfem.ElementQuad2()
    if given.length is not None:
        mesh, element = even(given.length, given.layers), skfem.ElementQuadS2()
    rows = []
    print(
        f"{'nu':>6}{'e0':>10}{'e1 (C)':>10}{'e1 (F)':>10}{'e2':>10}{'tension':>10}   of the shell: e0, e1, e2"
    )
    for poisson in POISSON:
        rows.append(end_constants(poisson, mesh, element))
        of_shell = "".join(f"{each:10.5f}" for each in clamped_end(1.0, poisson))
        print(f"{poisson:6.3f}" + "".join(f"{each:10.5f}" for each in rows[-1]) + "   " + of_shell)
    found = np.array(rows)
    for name, column in (("e0", 0), ("e1", 2), ("e2", 3)):
        fitted = np.polyfit(POISSON, found[:, column], 5)
        off = np.abs(np.polyval(fitted, POISSON) - found[:, column]).max()
        print(f"{name}: {fitted.round(5).tolist()}, off by at most {off:.5f}")


if __name__ == "__main__":
    main()
