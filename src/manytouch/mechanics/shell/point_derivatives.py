"""Second derivatives of the energy of the shell at a Gauss point, compiled.

Derivation and symbols: docs/derivations/mechanics.md. The energy depends on five derivatives of the
displacements u and v, in the order x, y, xx, yy, xy, and on seven of the bending deflection b, in that of
`kernels.Tables`: wx, wy, xx, yy, xy, lx, ly.
"""

import numpy as np
from jaxtyping import Float

from manytouch.compilation import inlined_kernel, no_type_check
from manytouch.mechanics.shell.point_state import PointState

SecondDerivatives = Float[np.ndarray, "9 17 17"]
"""Second derivatives of the energy per area over E, times the weight, at the Gauss points of an element, mm.

They are the A of the derivation, from which the tangent is assembled: by five derivatives of u, five of v,
and seven of b, `FIRST` being the first one of each.
"""

FIRST = (0, 5, 10)


@inlined_kernel(fastmath=True)
@no_type_check
def set_derivatives(state: PointState, shear: float, sheared: float, second: SecondDerivatives) -> None:
    """Set the second derivatives (17, 17) at a point.

    Args:
        state: of the sheet there.
        shear: a, by which a unit of grad lap b changes the slope of b.
        sheared: derivative of the shear force by grad lap b.
        second: result.
    """
    normal, bending = state.normal, state.bending
    for g in range(6):
        row = 5 * (g // 2) + g % 2
        for h in range(g + 1):
            total, column = state.slopes[g, h], 5 * (h // 2) + h % 2
            for k in range(3):
                total += state.strain_by[k, g] * state.force_by[k, h]
                total += state.curvature_by[k, g] * state.bending_moment_by[k, h]
            if g // 2 == h // 2:
                total += state.force[g % 2 if g == h else 2]
            second[row, column] = second[column, row] = total
        for side in range(2):
            total = state.slopes[g, 4 + side]
            for k in range(3):
                total += state.bending_moment_by[k, g] * state.curvature_by[k, 4 + side]
            total *= shear
            for k in range(3):
                total += state.shear_by_strain[side, k] * state.strain_by[k, g]
            second[row, 15 + side] = second[15 + side, row] = total
        by = state.bending_moment_by
        _set_slope_and_second(state, row, g, (1.0, by[0, g], by[1, g], by[2, g]), second)
    _set_gradient_derivatives(state, shear, sheared, second)
    for c in range(3):
        for d in range(3):
            product = normal[c] * normal[d]
            for k in range(3):
                for m in range(3):
                    double = (2.0 if k == 2 else 1.0) * (2.0 if m == 2 else 1.0)
                    second[5 * c + 2 + k, 5 * d + 2 + m] = double * product * bending[k, m]


@inlined_kernel(fastmath=True)
@no_type_check
def _set_gradient_derivatives(
    state: PointState, shear: float, sheared: float, second: SecondDerivatives
) -> None:
    """Set those by grad lap b alone, and by it and second derivatives; arguments as in `set_derivatives`."""
    bending = state.bending
    for side in range(2):
        by0 = by1 = by2 = 0.0  # the bending moment by the slope of b
        for m in range(3):
            turned = shear * state.curvature_by[m, 4 + side]
            by0, by1, by2 = (
                by0 + bending[0, m] * turned,
                by1 + bending[1, m] * turned,
                by2 + bending[2, m] * turned,
            )
        _set_slope_and_second(state, 15 + side, 4 + side, (shear, by0, by1, by2), second)
        for other in range(2):
            total = by0 * state.curvature_by[0, 4 + other] + by1 * state.curvature_by[1, 4 + other]
            total += by2 * state.curvature_by[2, 4 + other] + shear * state.slopes[4 + side, 4 + other]
            second[15 + side, 15 + other] = shear * total + (sheared if side == other else 0.0)


@inlined_kernel(fastmath=True)
@no_type_check
def _set_slope_and_second(
    state: PointState,
    row: int,
    g: int,
    by_slope: tuple[float, float, float, float],
    second: SecondDerivatives,
) -> None:
    """Set those by slope g, or what changes it, and by second derivatives.

    Args:
        state: of the sheet.
        row: number of the former among the 17 derivatives.
        g: number of the slope.
        by_slope: derivatives by it of the slope and of the three moments.
        second: result.
    """
    bending_moment, turn = state.bending_moment, state.turn
    share, by0, by1, by2 = by_slope
    for c in range(3):
        along, turned = state.normal[c], share * turn[g, c]
        column = 5 * c + 2
        second[row, column] = second[column, row] = along * by0 + bending_moment[0] * turned
        second[row, column + 1] = second[column + 1, row] = along * by1 + bending_moment[1] * turned
        second[row, column + 2] = second[column + 2, row] = 2.0 * (along * by2 + bending_moment[2] * turned)
