"""The depth of a pad under one fitted patch, and its derivatives by what was fitted."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.estimation.pad.contacts.node_depth import unresolved_depth
from manytouch.estimation.pad.contacts.pad_shape import PadShape, large_strain
from manytouch.estimation.pad.pad_model import BondedPadModel
from manytouch.estimation.pad.patch_fit import PadFit
from manytouch.estimation.pad.patch_forces import (
    FORCE,
    PARAMETER_COUNT,
    fill_basis,
    fill_effects,
    pressing_work,
)
from manytouch.estimation.pad.patch_kernels import ROOT_XX, ROOT_YX, ROOT_YY, SHAPE, Profile
from manytouch.values.arrays import Points2, read_only_view

_RING_ROOTS = (1.0, 1.0, np.sqrt(2.0))
"""For each profile, the radius at which the pad may be deeper than at the centre of the patch, in roots of
its second moment."""
_STICKING_ROOTS = (2.0, np.sqrt(7.0 / 3.0), 0.0)
"""For each profile, the radius at which the mean lateral displacement by a patch is that of a rigid object
that sticks and has the same shear, in roots of the second moment of the patch. It is 0 for a rim, inside
which the displacement is nearly constant."""
_RING = np.array([[0.0, 0.0]] + [[np.cos(angle), np.sin(angle)] for angle in 2.0 * np.pi * np.arange(8) / 8])
"""The centre of a circle with radius 1, and eight points on it."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactDepth:
    """The depth of a contact.

    Attributes:
        depth_mm: largest depth of the contact face; under a rigid flat face, its only depth.
        by_parameter: derivatives of the depth by the PARAMETER_COUNT parameters of the contact, then by those
            of the pad in their standard deviations (`PadFit.sheet`).
        centre_mm: (3,) displacement of the object at the centre of the contact, sheet frame.
    """

    depth_mm: float
    by_parameter: Float64[np.ndarray, " p"]
    centre_mm: Float64[np.ndarray, "3"]


def contact_depth(model: BondedPadModel, fit: PadFit, shape: PadShape, number: int) -> ContactDepth:
    """The depth of one contact of a fit.

    A rigid flat face is everywhere as deep as the work of its traction over its force (E. Betti 1872).
    Elsewhere the depth is the largest one of the centre of the patch and of the points on a circle around it.
    An object that sticks moves laterally by the mean displacement of a shear that is distributed as the
    pressure, weighted with the shear of a rigid disc, which is 1 / sqrt(a^2 - r^2) on a half-space. To second
    order this mean is the displacement at r = sqrt(2 / 3) a.
    """
    parameters, profile = read_only_view(fit.patches.parameters)[number], int(fit.patches.profile[number])
    root = np.array([[parameters[ROOT_XX], 0.0], [parameters[ROOT_YX], parameters[ROOT_YY]]])
    rings = np.concatenate([_RING_ROOTS[profile] * _RING, _STICKING_ROOTS[profile] * _RING[1:]])
    node, value = _basis(model, parameters[:2] + rings @ root.T)
    moved_mm = np.einsum("kn,kni->ki", value, shape.coefficient_mm[node])
    deepest = int(np.argmin(moved_mm[: len(_RING), 2]))
    centre_mm = np.array([*moved_mm[len(_RING) :, :2].mean(axis=0), moved_mm[0, 2]])
    is_face, press_mm2 = profile == Profile.FLAT, max(float(parameters[FORCE]), 1e-9)
    moved_by_force = model.by_place(shape.linear_mm) / press_mm2
    # called for every profile, so that it is compiled with the first contact of any
    linear_mm = pressing_work(parameters, profile, model.grid, moved_by_force)
    if is_face:
        deepest, effect = 0, 2.0 * moved_by_force
    else:
        linear_mm = -float(value[deepest] @ shape.linear_mm[node[deepest], 2])
        # the response of the face to nodal forces is symmetric, so that a row of it is a column
        by_node = (value[deepest] @ model.face[node[deepest], 2].reshape(16, -1)).reshape(-1, 3)
        effect = -model.by_place(by_node)
    by_parameter = np.zeros(PARAMETER_COUNT + len(fit.sheet))
    fill_effects(parameters, profile, model.grid, effect, by_parameter[:PARAMETER_COUNT])
    by_parameter[FORCE] -= linear_mm / press_mm2 if is_face else 0.0
    # called for every profile too
    root_slope = np.empty(3)
    per_force = unresolved_depth(
        parameters, profile, model.grid, model.depth_table, model.node_depth, root_slope
    )
    if deepest == 0 or profile != Profile.RIM:
        linear_mm += per_force * press_mm2
        by_parameter[FORCE] += per_force
        by_parameter[ROOT_XX:SHAPE] += press_mm2 * root_slope
    depth_mm = float(large_strain(np.array([linear_mm]), model.thickness_mm)[0])
    by_pad = model.depth_by_parameter[:, node[deepest]] @ -shape.nodal_mm2[:, 2]
    by_parameter[PARAMETER_COUNT : PARAMETER_COUNT + len(by_pad)] = by_pad @ value[deepest]
    by_parameter *= depth_mm / max(linear_mm, 1e-9)
    return ContactDepth(depth_mm=depth_mm, by_parameter=by_parameter, centre_mm=centre_mm)


def _basis(
    model: BondedPadModel, place_mm: Points2
) -> tuple[Int64[np.ndarray, "k 16"], Float64[np.ndarray, "k 16"]]:
    """Numbers of the nodes and values of the B-splines that are not 0 at places (k, 2) on the pad."""
    first, value = np.empty((len(place_mm), 2), dtype=np.int64), np.empty((len(place_mm), 4, 4))
    fill_basis(place_mm, model.grid, first, value)
    along_x, along_y = (first[:, axis, None] + np.arange(4) for axis in range(2))
    rows, columns = model.grid.count_x + 3, model.grid.count_y + 3
    if model.patch.is_x_slow:
        node = along_x[:, :, None] * columns + along_y[:, None, :]
    else:
        node = along_x[:, :, None] + along_y[:, None, :] * rows
    return node.reshape(-1, 16), value.reshape(-1, 16)
