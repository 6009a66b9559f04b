"""Contact of the touched face with rigid indenters: penalty at the face's quadrature points.

Normal traction per undeformed area p = P(-d) along the gradient n of the indenter's distance d, where
P grows with the square of the penetration up to `rounding_mm` and with `stiffness` from there on: it
has a potential, and its tangent is continuous. Coulomb friction by a return map of
t = P_n (turned old t - stiffness * slip), |t| <= friction * p (J. C. Simo and T. A. Laursen 1992,
doi:10.1016/0045-7949(92)90540-G). Linearised exactly, with the curvature of the indenter.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import kernel, no_type_check
from manytouch.simulation.fem.contact.distance import signed_distance
from manytouch.simulation.fem.elements.mesh import HexMesh, reference_nodes, shape_functions
from manytouch.values.arrays import read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TouchedFace:
    """Quadrature points of the touched face, at which contact is evaluated.

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
        """Present places (f, q, 3) of the points under nodal displacements (n, 3), mm."""
        nodal = displacement_mm[mesh.element[self.owner[:, None], self.local]]  # (f, 8, 3)
        return np.asarray(self.rest_mm + np.einsum("qn,fni->fqi", self.value, nodal))

    def arrays(self, mesh: HexMesh) -> "FaceArrays":
        """The face as the kernels read it."""
        return FaceArrays(mesh.element, self.owner, self.local, self.value, self.area_mm2, self.rest_mm)

    def nodal_force_N(
        self, mesh: HexMesh, traction_MPa: Float64[np.ndarray, "f q 3"]
    ) -> Float64[np.ndarray, "nodes 3"]:
        """Nodal forces (n, 3) in N that are equivalent to a traction (f, q, 3) per undeformed area."""
        force = np.zeros_like(mesh.node_mm)
        share = np.einsum("fq,qn,fqi->fni", self.area_mm2, self.value, traction_MPa)
        np.add.at(force, mesh.element[self.owner[:, None], self.local], share)
        return force


def touched_face(mesh: HexMesh, *, points: int = 4, rule: str = "gauss") -> TouchedFace:
    """The touched face of a mesh.

    Args:
        mesh: the mesh.
        points: quadrature points along each edge of an element.
        rule: "gauss", or "middles" for the middles of points x points equal cells.
    """
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


class FaceArrays(NamedTuple):
    """The touched face as the kernels read it: nodes (e, 20) of all elements, and `TouchedFace`'s arrays."""

    node: np.ndarray
    owner: np.ndarray
    local: np.ndarray
    value: np.ndarray
    area_mm2: np.ndarray
    rest_mm: np.ndarray


class PosedShape(NamedTuple):
    """One indenter where it is now.

    Attributes:
        kind, numbers: its shape, see `distance.signed_distance`.
        position_mm: (3,) of its lowest point, sheet frame.
        rotation: (3, 3) sheet_from_indenter.
    """

    kind: int
    numbers: np.ndarray
    position_mm: np.ndarray
    rotation: np.ndarray


class ContactLaw(NamedTuple):
    """Penalty and friction of one contact.

    Attributes:
        friction: Coulomb's coefficient.
        stiffness_MPa_per_mm: of the penalty.
        rounding_mm: penetration below which the penalty softens.
        curvature_factor: 1, or 0 to leave the indenter's curvature out of the derivative, which then is
            positive definite.
    """

    friction: float
    stiffness_MPa_per_mm: float
    rounding_mm: float
    curvature_factor: float


class FrictionHistory(NamedTuple):
    """What friction needs of the last equilibrium; not read without friction.

    Attributes:
        contact_fraction: (f, q) share of the step during which a point is in contact.
        trial_MPa: (f, q, 3) the last friction, turned with the indenter.
        anchor_mm: (f, q, 3) where the points would be had they moved with the indenter.
    """

    contact_fraction: np.ndarray
    trial_MPa: np.ndarray
    anchor_mm: np.ndarray


class ContactField(NamedTuple):
    """Tractions per undeformed area at the points of the face, and the indenter's normals there.

    Attributes:
        pressure_MPa: (f, q).
        shear_MPa: (f, q, 3) friction.
        normal: (f, q, 3) out of the indenter; valid where the pressure is positive.
    """

    pressure_MPa: np.ndarray
    shear_MPa: np.ndarray
    normal: np.ndarray


class _Surface(NamedTuple):
    """An indenter's surface at one point in contact.

    Attributes:
        normal, curvature: (3,), (3, 3) gradient and Hessian of its distance, sheet frame.
        pressure_MPa, rise_MPa_per_mm: penalty pressure and its derivative by the penetration.
    """

    normal: np.ndarray
    curvature: np.ndarray
    pressure_MPa: float
    rise_MPa_per_mm: float


@kernel()
@no_type_check
def _multiply(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    out = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                out[i, j] += A[i, k] * B[k, j]
    return out


@kernel()
@no_type_check
def _add_friction(
    trial: np.ndarray,
    surface: _Surface,
    friction: float,
    spring: float,
    traction: np.ndarray,
    slope: np.ndarray,
) -> None:
    """Return map; fills the tangential traction (3,) and subtracts its derivative (3, 3) from `slope`."""
    normal, curvature = surface.normal, surface.curvature
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
    limit = friction * surface.pressure_MPa
    if size > limit and size > 0.0:
        direction = traction / size
        ratio = limit / size
        projected = np.empty((3, 3))
        for i in range(3):
            for j in range(3):
                projected[i, j] = ratio * ((1.0 if i == j else 0.0) - direction[i] * direction[j])
        derivative = _multiply(projected, derivative)
        for i in range(3):
            traction[i] *= ratio
            for j in range(3):
                derivative[i, j] -= friction * surface.rise_MPa_per_mm * direction[i] * normal[j]
    for i in range(3):
        for j in range(3):
            slope[i, j] -= derivative[i, j]


@kernel()
@no_type_check
def _displaced_point(f: int, q: int, displacement: np.ndarray, face: FaceArrays, point: np.ndarray) -> None:
    """Fill the present place (3,) of one point of the face."""
    e = face.owner[f]
    for i in range(3):
        point[i] = face.rest_mm[f, q, i]
        for n in range(8):
            point[i] += face.value[q, n] * displacement[face.node[e, face.local[n]], i]


@kernel()
@no_type_check
def _distance_to(
    shape: PosedShape, point: np.ndarray, local: np.ndarray, normal: np.ndarray, curvature: np.ndarray
) -> float:
    """Distance of a place (3,) in the sheet frame; gradient and Hessian in the indenter's frame.

    `local` (3,) is filled with the place in the indenter's frame.
    """
    for i in range(3):
        local[i] = 0.0
        for j in range(3):
            local[i] += shape.rotation[j, i] * (point[j] - shape.position_mm[j])
    return signed_distance(shape.kind, shape.numbers, local, normal, curvature)


@kernel()
@no_type_check
def _penalty(distance: float, law: ContactLaw) -> tuple[float, float]:
    """Pressure in MPa and its derivative by the penetration, MPa/mm, at a negative distance."""
    stiffness, rounding = law.stiffness_MPa_per_mm, law.rounding_mm
    if -distance < rounding:
        return 0.5 * stiffness * distance * distance / rounding, -stiffness * distance / rounding
    return stiffness * (-distance - 0.5 * rounding), stiffness


@kernel()
@no_type_check
def _add_traction(
    f: int,
    q: int,
    face: FaceArrays,
    field: ContactField,
    slope: np.ndarray,
    force: np.ndarray,
    tangent: np.ndarray,
) -> None:
    """Add one point's traction to the nodal forces and `slope` (3, 3) to the element's tangent."""
    e = face.owner[f]
    p = field.pressure_MPa[f, q]
    for n in range(8):
        share = face.area_mm2[f, q] * face.value[q, n]
        for i in range(3):
            traction = p * field.normal[f, q, i] + field.shear_MPa[f, q, i]
            force[face.node[e, face.local[n]], i] += share * traction
        if tangent.shape[0] > 0:
            for m in range(8):
                weight = share * face.value[q, m]
                for i in range(3):
                    for j in range(3):
                        tangent[e, 3 * face.local[n] + i, 3 * face.local[m] + j] += weight * slope[i, j]


@kernel()
@no_type_check
def add_contact(
    displacement: np.ndarray,
    face: FaceArrays,
    shape: PosedShape,
    law: ContactLaw,
    history: FrictionHistory,
    field: ContactField,
    force: np.ndarray,
    tangent: np.ndarray,
) -> float:
    """Add one indenter's forces on the nodes, and minus their derivative.

    Args:
        displacement: (n, 3) of the nodes, mm.
        face: the touched face.
        shape: the indenter.
        law: penalty and friction.
        history: of the friction.
        field: filled.
        force: (n, 3), added to, N.
        tangent: (e, 60, 60), added to, N/mm; or (0, 60, 60), then left alone.

    Returns:
        The deepest penetration in mm, 0 without contact.
    """
    point, local, trial, slope = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    local_normal, local_curvature, normal = np.empty(3), np.empty((3, 3)), np.empty(3)
    rotation = shape.rotation
    deepest = 0.0
    field.pressure_MPa[:] = 0.0
    field.shear_MPa[:] = 0.0
    for f in range(face.owner.shape[0]):
        for q in range(face.value.shape[0]):
            _displaced_point(f, q, displacement, face, point)
            distance = _distance_to(shape, point, local, local_normal, local_curvature)
            if distance >= 0.0:
                continue
            deepest = max(deepest, -distance)
            for i in range(3):
                normal[i] = 0.0
                for j in range(3):
                    normal[i] += rotation[i, j] * local_normal[j]
            curvature = law.curvature_factor * _multiply(_multiply(rotation, local_curvature), rotation.T)
            p, rise = _penalty(distance, law)
            field.pressure_MPa[f, q] = p
            for i in range(3):
                field.normal[f, q, i] = normal[i]
                for j in range(3):
                    slope[i, j] = rise * normal[i] * normal[j] - p * curvature[i, j]
            if law.friction > 0.0:
                spring = law.stiffness_MPa_per_mm * history.contact_fraction[f, q]
                for i in range(3):
                    moved = point[i] - history.anchor_mm[f, q, i]
                    trial[i] = history.trial_MPa[f, q, i] - spring * moved
                surface = _Surface(normal, curvature, p, rise)
                _add_friction(trial, surface, law.friction, spring, field.shear_MPa[f, q], slope)
            _add_traction(f, q, face, field, slope, force, tangent)
    return deepest
