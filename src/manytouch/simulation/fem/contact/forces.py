"""Contact of the touched face with rigid indenters: penalty at the face's quadrature points.

Normal traction per undeformed area p = P(-d) along the gradient n of the indenter's distance d, where
P grows with the square of the penetration up to `rounding_mm` and with `stiffness` from there on: it
has a potential, and its tangent is continuous. Coulomb friction by a return map of
t = P_n (turned old t - stiffness * slip), |t| <= friction * p (J. C. Simo and T. A. Laursen 1992,
doi:10.1016/0045-7949(92)90540-G). Linearised exactly, with the curvature of the indenter.
"""

# ruff: noqa: PLR0912, PLR0917 - compiled functions are long and called with positional arguments

import itertools
import math
from dataclasses import dataclass
from typing import no_type_check

import numpy as np
from jaxtyping import Float64, Int64
from numba import njit

from manytouch.simulation.fem.contact.distance import signed_distance
from manytouch.simulation.fem.elements.mesh import HexMesh, reference_nodes, shape_functions
from manytouch.values.arrays import read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TouchedFace:
    """Points of the touched face at which contact is asked for.

    Attributes:
        owner: (f,) element of each face.
        local: (8,) which of the element's 20 nodes lie on the face.
        value: (q, 8) their shape functions.
        area_mm2: (f, q) undeformed area of each point.
        rest_mm: (f, q, 3) undeformed places.
    """

    owner: Int64[np.ndarray, " f"]
    local: Int64[np.ndarray, "8"]
    value: Float64[np.ndarray, "q 8"]
    area_mm2: Float64[np.ndarray, "f q"]
    rest_mm: Float64[np.ndarray, "f q 3"]

    def displaced(
        self, mesh: HexMesh, displacement_mm: Float64[np.ndarray, "nodes 3"]
    ) -> Float64[np.ndarray, "f q 3"]:
        """Where the points are now."""
        nodal = displacement_mm[mesh.element[self.owner[:, None], self.local]]  # (f, 8, 3)
        return np.asarray(self.rest_mm + np.einsum("qn,fni->fqi", self.value, nodal))

    def nodal_force_N(
        self, mesh: HexMesh, traction_MPa: Float64[np.ndarray, "f q 3"]
    ) -> Float64[np.ndarray, "nodes 3"]:
        """The nodal forces (n, 3) that do the same work as a traction per undeformed area."""
        force = np.zeros_like(mesh.node_mm)
        share = np.einsum("fq,qn,fqi->fni", self.area_mm2, self.value, traction_MPa)
        np.add.at(force, mesh.element[self.owner[:, None], self.local], share)
        return force


def touched_face(mesh: HexMesh, *, points: int = 4, rule: str = "gauss") -> TouchedFace:
    """The touched face with points x points Gauss points per element, or the middles of so many cells."""
    node, weight = np.polynomial.legendre.leggauss(points)
    if rule == "middles":
        node, weight = (2.0 * np.arange(points) + 1.0) / points - 1.0, np.full(points, 2.0 / points)
    place = np.array([(0.5 + 0.5 * x, 0.5 + 0.5 * y, 1.0) for x, y in itertools.product(node, node)])
    local = np.flatnonzero(reference_nodes()[:, 2] == 1.0)
    value = shape_functions(place)[0][:, local]
    corner_mm = mesh.node_mm[mesh.element[mesh.touched[:, None], local]]  # (f, 8, 3)
    extent_mm = np.ptp(corner_mm[:, :, :2], axis=1)
    return TouchedFace(
        owner=mesh.touched,
        local=read_only(local.astype(np.int64)),
        value=read_only(np.ascontiguousarray(value)),
        area_mm2=read_only(0.25 * np.prod(extent_mm, axis=1)[:, None] * np.outer(weight, weight).ravel()),
        rest_mm=read_only(np.einsum("qn,fni->fqi", value, corner_mm)),
    )


@njit(cache=True)
@no_type_check
def _times(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    out = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                out[i, j] += A[i, k] * B[k, j]
    return out


@njit(cache=True)
@no_type_check
def _friction(
    trial: np.ndarray,
    normal: np.ndarray,
    curvature: np.ndarray,
    pressure: float,
    rise: float,
    friction: float,
    spring: float,
    traction: np.ndarray,
    slope: np.ndarray,
) -> None:
    """Return map; fills the tangential traction (3,) and subtracts its derivative (3, 3) from `slope`."""
    along = 0.0
    turned = np.zeros(3)
    for i in range(3):
        along += trial[i] * normal[i]
        for j in range(3):
            turned[i] += curvature[i, j] * trial[j]
    derivative = np.empty((3, 3))
    size = 0.0
    for i in range(3):
        traction[i] = trial[i] - along * normal[i]
        size += traction[i] ** 2
        for j in range(3):
            projector = (1.0 if i == j else 0.0) - normal[i] * normal[j]
            derivative[i, j] = -spring * projector - along * curvature[i, j] - normal[i] * turned[j]
    size = math.sqrt(size)
    if size > friction * pressure and size > 0.0:
        direction = traction / size
        ratio = friction * pressure / size
        projected = np.empty((3, 3))
        for i in range(3):
            for j in range(3):
                projected[i, j] = ratio * ((1.0 if i == j else 0.0) - direction[i] * direction[j])
        derivative = _times(projected, derivative)
        for i in range(3):
            traction[i] *= ratio
            for j in range(3):
                derivative[i, j] -= friction * rise * direction[i] * normal[j]
    for i in range(3):
        for j in range(3):
            slope[i, j] -= derivative[i, j]


@njit(cache=True)
@no_type_check
def add_contact(
    displacement: np.ndarray,
    element: np.ndarray,
    owner: np.ndarray,
    local: np.ndarray,
    value: np.ndarray,
    area: np.ndarray,
    rest: np.ndarray,
    kind: int,
    numbers: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    friction: float,
    stiffness: float,
    rounding: float,
    bending: float,
    held: np.ndarray,
    old_trial: np.ndarray,
    anchor: np.ndarray,
    force: np.ndarray,
    tangent: np.ndarray,
    pressure: np.ndarray,
    shear: np.ndarray,
    gradient: np.ndarray,
) -> float:
    """Add one indenter's forces on the nodes to `force` (n, 3) and minus their derivative to `tangent`.

    `bending` is 1, or 0 to leave the indenter's curvature out of the derivative, which then is positive
    definite. `held` (f, q) is the share of the step during which a point touches, `old_trial` (f, q, 3)
    the old friction turned with the indenter, `anchor` (f, q, 3) where the points would be had they
    moved with it. Fills pressure (f, q), shear and gradient (f, q, 3); returns the deepest penetration.
    """
    wants_tangent = tangent.shape[0] > 0
    point, at = np.empty(3), np.empty(3)
    normal_there, curvature_there = np.empty(3), np.empty((3, 3))
    normal, trial, slope = np.empty(3), np.empty(3), np.empty((3, 3))
    deepest = 0.0
    pressure[:] = 0.0
    shear[:] = 0.0
    for f in range(owner.shape[0]):
        e = owner[f]
        for q in range(value.shape[0]):
            for i in range(3):
                point[i] = rest[f, q, i]
                for n in range(8):
                    point[i] += value[q, n] * displacement[element[e, local[n]], i]
            for i in range(3):
                at[i] = 0.0
                for j in range(3):
                    at[i] += rotation[j, i] * (point[j] - position[j])
            distance = signed_distance(kind, numbers, at, normal_there, curvature_there)
            if distance >= 0.0:
                continue
            deepest = max(deepest, -distance)
            for i in range(3):
                normal[i] = 0.0
                for j in range(3):
                    normal[i] += rotation[i, j] * normal_there[j]
            curvature = bending * _times(_times(rotation, curvature_there), rotation.T)
            if -distance < rounding:
                p, rise = 0.5 * stiffness * distance * distance / rounding, -stiffness * distance / rounding
            else:
                p, rise = stiffness * (-distance - 0.5 * rounding), stiffness
            pressure[f, q] = p
            for i in range(3):
                gradient[f, q, i] = normal[i]
                for j in range(3):
                    slope[i, j] = rise * normal[i] * normal[j] - p * curvature[i, j]
            if friction > 0.0:
                spring = stiffness * held[f, q]
                for i in range(3):
                    trial[i] = old_trial[f, q, i] - spring * (point[i] - anchor[f, q, i])
                _friction(trial, normal, curvature, p, rise, friction, spring, shear[f, q], slope)
            for n in range(8):
                share = area[f, q] * value[q, n]
                for i in range(3):
                    force[element[e, local[n]], i] += share * (p * normal[i] + shear[f, q, i])
                if wants_tangent:
                    for m in range(8):
                        weight = share * value[q, m]
                        for i in range(3):
                            for j in range(3):
                                tangent[e, 3 * local[n] + i, 3 * local[m] + j] += weight * slope[i, j]
    return deepest
