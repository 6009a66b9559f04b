"""What the page shows in addition to a reading: the load on the sheet, and where markers support a map."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool
from scipy.spatial import cKDTree

from manytouch.sinks.display_grid import DisplayGrid
from manytouch.sinks.viewer.update_format import number
from manytouch.values import ESTIMATES, Contact, Layout
from manytouch.values.arrays import Mask

SUPPORT_PITCH = 1.05
"""A point without a marker that is seen within this distance is not supported: one lost marker of a lattice
leaves no such point, two adjacent ones do."""
NEIGHBOURS = 6
_NORMAL_FORCE = ESTIMATES.index("normal_force")


def total_load(contacts: Sequence[Contact]) -> dict[str, Any] | None:
    """Force of all contacts on the sheet and its torque about the sheet's normal at the origin.

    The contacts' errors are taken as independent. None where no force is known.
    """
    loads = [contact for contact in contacts if np.isfinite(contact.force_N[2])]
    if not loads:
        return None
    force_N = np.sum([contact.force_N for contact in loads], axis=0)
    variance = sum(contact.covariance[_NORMAL_FORCE, _NORMAL_FORCE] for contact in loads)
    torque = sum(
        contact.torque_Nmm
        + contact.centre_mm[0] * contact.force_N[1]
        - contact.centre_mm[1] * contact.force_N[0]
        for contact in loads
    )
    return {
        "normal_N": number(-float(force_N[2])),
        "normal_std_N": number(float(np.sqrt(variance))),
        "shear_N": [number(float(force_N[0])), number(float(force_N[1]))],
        "torque_Nmm": number(float(torque)),
    }


def marker_support(layout: Layout, grid: DisplayGrid) -> Callable[[Mask], Bool[np.ndarray, "ny nx"]]:
    """A function from which markers are seen (m,) to where on a grid (ny, nx) one of them is near."""
    scale = 1.0 / (SUPPORT_PITCH * layout.pitch_mm)
    present = np.flatnonzero(~layout.is_missing)
    x_mm, y_mm = np.meshgrid(grid.x_mm, grid.y_mm)
    points = np.column_stack([x_mm.ravel(), y_mm.ravel()]) * scale
    shape = x_mm.shape
    if len(present) == 0:
        return lambda _: np.zeros(shape, dtype=np.bool_)
    tree = cKDTree(layout.rest_mm[present, :2] * scale)
    _, found = tree.query(points, k=NEIGHBOURS, distance_upper_bound=1.0)
    nearest = np.append(present, len(layout.rest_mm))[found]  # the last one: there are fewer within reach
    everywhere = np.asarray((nearest < len(layout.rest_mm)).any(axis=1).reshape(shape))  # with all markers

    def supported(is_seen: Mask) -> Bool[np.ndarray, "ny nx"]:
        if is_seen.all():
            return everywhere
        is_near = np.append(is_seen, False)[nearest]
        return np.asarray(is_near.any(axis=1).reshape(shape))

    return supported
