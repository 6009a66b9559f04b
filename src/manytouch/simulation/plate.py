"""The pressed sheet as a linear clamped plate: a Ritz series of clamped-beam functions.

Kirchhoff's plate under small deflection and pretension, D lap lap w - N lap w = p, w = dw/dn = 0 on
the outline. With w = sum a_ij phi_i(x) psi_j(y) its energy is stationary where K a = b,

    K = D (int phi_i'' phi_k'' int psi_j psi_l + 2 int phi_i' phi_k' int psi_j' psi_l'
           + int phi_i phi_k int psi_j'' psi_l'')
        + N (int phi_i' phi_k' int psi_j psi_l + int phi_i phi_k int psi_j' psi_l'),

(the twisting terms of a clamped plate are of the same form), b = int p phi_i psi_j. Source: W. Ritz,
J. reine angew. Math. 135 (1909); beam functions: D. Young, J. Appl. Mech. 17 (1950).

It is *linear*: depth is proportional to force at any depth, and the tension is the same everywhere. A
real sheet is stretched further by deep presses, so presses of a few mm take less force here.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from manytouch.values import Sheet
from manytouch.values.arrays import Counts, Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchLoad:
    """A frictionless fingertip: pressure p = 2 F / (pi R^2) (1 - r^2 / R^2) on a disc.

    Attributes:
        centre_mm: x, y in the sheet, which is its force centroid too.
        radius_mm: R; 0 is a point load.
        force_N: pressing force F, positive in compression (towards -z).
    """

    centre_mm: tuple[float, float]
    radius_mm: float
    force_N: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlateField:
    """The deflected middle surface at n points.

    Attributes:
        depth_mm: (n,) -z deflection, positive when pressed.
        slope: (n, 2) d depth / dx, d depth / dy.
    """

    depth_mm: Scalars
    slope: Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlateModes:
    """The series' functions at n points: a frame's field is then a matrix product.

    Points of a lattice share their x and y, so the functions along x are kept once for each x.

    Attributes:
        along_x: (2, k, functions) value and derivative at the k different x.
        place_x: (n,) which of them each point has.
        along_y: (2, n, functions) value and derivative at each point.
    """

    along_x: np.ndarray
    place_x: Counts
    along_y: np.ndarray

    def field(self, coefficients: np.ndarray) -> PlateField:
        """Depth and slope for series coefficients (i, j)."""
        value, change = (self.along_x @ coefficients)[:, self.place_x]
        return PlateField(
            depth_mm=np.einsum("nj,nj->n", value, self.along_y[0]),
            slope=np.column_stack(
                [
                    np.einsum("nj,nj->n", change, self.along_y[0]),
                    np.einsum("nj,nj->n", value, self.along_y[1]),
                ]
            ),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Plate:
    """A clamped rectangular plate, centred on the origin.

    Attributes:
        size_mm: (2,) outline along x and y.
        bending_stiffness_Nmm: D = E t^3 / (12 (1 - nu^2)).
        pretension_N_per_mm: N, equal in all directions.
        functions: number of beam functions along x and y; the shortest half wave that the series
            follows is size / functions, which should be below the radius of the loads.
    """

    size_mm: tuple[float, float]
    bending_stiffness_Nmm: float
    pretension_N_per_mm: float = 0.0
    functions: tuple[int, int] = (36, 24)
    _factor: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        matrix, _ = cho_factor(self._stiffness(), lower=True)
        object.__setattr__(self, "_factor", read_only(matrix))

    def coefficients(self, loads: tuple[PatchLoad, ...]) -> np.ndarray:
        """Series coefficients (i, j) in mm of the depth under loads."""
        right = np.zeros(self.functions)
        for load in loads:
            point_mm, weight = patch_points(load)
            along_x = self._along(0, point_mm[:, 0], 0)
            along_y = self._along(1, point_mm[:, 1], 0)
            right += load.force_N * (along_x * weight[:, None]).T @ along_y
        return np.asarray(cho_solve((self._factor, True), right.ravel())).reshape(self.functions)

    def modes_at(self, point_mm: Points2) -> PlateModes:
        """The series' functions at points (n, 2), to be kept for as long as the points stay."""
        x_mm, place_x = np.unique(np.round(point_mm[:, 0], 9), return_inverse=True)
        return PlateModes(
            along_x=np.stack([self._along(0, x_mm, order) for order in (0, 1)]),
            place_x=place_x,
            along_y=np.stack([self._along(1, point_mm[:, 1], order) for order in (0, 1)]),
        )

    def _along(self, axis: int, position_mm: Scalars, order: int) -> np.ndarray:
        """(n, functions) derivatives of the beam functions along an axis."""
        size = self.size_mm[axis]
        return np.asarray(beam_functions(position_mm / size + 0.5, self.functions[axis], order) / size**order)

    def _stiffness(self) -> np.ndarray:
        integrals = []
        for axis in (0, 1):
            count, size = self.functions[axis], self.size_mm[axis]
            node, weight = np.polynomial.legendre.leggauss(4 * count + 16)
            basis = [beam_functions(0.5 * (node + 1), count, order) / size**order for order in range(3)]
            integrals.append([(b * (0.5 * size * weight)[:, None]).T @ b for b in basis])
        (x0, x1, x2), (y0, y1, y2) = integrals
        bending = np.kron(x2, y0) + 2 * np.kron(x1, y1) + np.kron(x0, y2)
        stretching = np.kron(x1, y0) + np.kron(x0, y1)
        return np.asarray(self.bending_stiffness_Nmm * bending + self.pretension_N_per_mm * stretching)


def clamped_plate(sheet: Sheet) -> Plate:
    """The plate of a sheet whose material is known; a pretension that is not known counts as none.

    Raises:
        ValueError: the sheet has no Young's modulus or Poisson's ratio.
    """
    if sheet.young_MPa is None or sheet.poisson is None:
        raise ValueError("a plate needs the sheet's young_MPa and poisson")
    factor = 1.0 if sheet.bending_factor is None else sheet.bending_factor
    stiffness = factor * sheet.young_MPa * sheet.thickness_mm**3 / (12 * (1 - sheet.poisson**2))
    return Plate(
        size_mm=(float(sheet.size_mm[0]), float(sheet.size_mm[1])),
        bending_stiffness_Nmm=stiffness,
        pretension_N_per_mm=sheet.pretension_N_per_mm or 0.0,
    )


def patch_points(load: PatchLoad) -> tuple[Points2, Scalars]:
    """Quadrature of a patch: points (n, 2) in mm and their shares of its force, which sum to 1.

    With s = r^2 / R^2 uniform rings have equal area, so int p dA = F int 2 (1 - s) ds.
    """
    node, weight = np.polynomial.legendre.leggauss(5)
    square = 0.5 * (node + 1)
    share = weight * (1 - square)
    angle = 2 * np.pi * (np.arange(12) + 0.5) / 12
    radius_mm = load.radius_mm * np.sqrt(square)
    offset_mm = radius_mm[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.array(load.centre_mm) + offset_mm.reshape(-1, 2), np.repeat(share / share.sum() / 12, 12)


def beam_functions(position: Scalars, count: int, order: int) -> np.ndarray:
    """(n, count) derivatives (order 0, 1, 2) of the clamped-clamped beam's modes on 0..1.

    phi = cosh bx - cos bx - s (sinh bx - sin bx) with cosh b cos b = 1, written with decaying
    exponentials alone, since the hyperbolic functions cancel for the higher modes.
    """
    number = np.arange(1, count + 1)
    beta = (number + 0.5) * np.pi
    for _ in range(20):
        beta = (number + 0.5) * np.pi + np.where(number % 2 == 1, 1, -1) * np.arcsin(1 / np.cosh(beta))
    sigma = (np.cosh(beta) - np.cos(beta)) / (np.sinh(beta) - np.sin(beta))
    argument = np.asarray(position)[:, None] * beta
    falling = 0.5 * (1 + sigma) * np.exp(-argument)
    rising = _growth(beta) * np.exp(argument - beta)
    turn = argument + 0.5 * np.pi * order
    return np.asarray((rising + (-1) ** order * falling - np.cos(turn) + sigma * np.sin(turn)) * beta**order)


def _growth(beta: np.ndarray) -> np.ndarray:
    """(1 - s) e^b / 2 without cancellation: 1 - s = (cos b - sin b - e^-b) / (sinh b - sin b)."""
    return np.asarray(
        (np.cos(beta) - np.sin(beta) - np.exp(-beta))
        / (1 - np.exp(-2 * beta) - 2 * np.exp(-beta) * np.sin(beta))
    )
