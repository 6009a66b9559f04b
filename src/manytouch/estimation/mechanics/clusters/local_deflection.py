"""What the elements of the sheet cannot show of the dent under a contact.

Under a narrow load the deflection of the camera-side face is sharper than splines with elements of about a
thickness. The difference to the deflection of elements a third as long is local, linear in the force, and
depends on where the force is within its element: it is computed once for each sensor, on a small patch of the
same sheet, and added where depth is read.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import kernel, no_type_check
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell.equilibrium import tangent_factor
from manytouch.mechanics.shell.shell import Shell
from manytouch.values.arrays import Points2, Scalars

_ELEMENTS = 10  # of the small patch, along each side
_FINER = 3
_OFFSETS = 3  # places of the force from a knot to the middle of an element, along each axis
_REACH = 2.5  # elements, from the force
_STEPS = 21
_ROOT = 2.0 * np.cos(np.pi * np.arange(1, 6) / 6.0)  # Gauss points of a semicircle, in standard deviations
_SHARE = np.sin(np.pi * np.arange(1, 6) / 6.0) ** 2 / 3.0
_DISC = np.stack(np.meshgrid(_ROOT, _ROOT, indexing="ij"), axis=-1).reshape(-1, 2)
_SHARES = np.outer(_SHARE, _SHARE).ravel()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LocalDeflection:
    """The missing depth per force over E, around point forces.

    Attributes:
        corner_mm: (2,) of the first element of the sheet.
        element_mm: (2,) size of the elements.
        table_per_mm: (3, 3, 21, 21) by the offset of the force from a knot along x and y (0 to half an
            element), and by the offset of the place from the force (-2.5 to 2.5 elements).
    """

    corner_mm: Float64[np.ndarray, "2"]
    element_mm: Float64[np.ndarray, "2"]
    table_per_mm: Float64[np.ndarray, "3 3 21 21"]

    def depth_mm(self, clusters: Clusters, place_mm: Points2) -> Scalars:
        """(k,) missing depth at places (k, 2) under clusters whose pressure is known."""
        known = np.flatnonzero(np.isfinite(clusters.covariance[:, 0, 0]) & ~clusters.is_face)
        size, axes = np.linalg.eigh(clusters.spread_mm2[known])
        root = axes * np.sqrt(np.maximum(size, 0.0))[:, None]
        away_mm = _DISC @ root.transpose(0, 2, 1)
        return _missing_depths(
            (clusters.centre_mm[known] - self.corner_mm) / self.element_mm,
            away_mm / self.element_mm,
            clusters.normal_mm2[known],
            (place_mm - self.corner_mm) / self.element_mm,
            self.table_per_mm,
        )


@kernel()
@no_type_check
def _missing_depths(
    centre: Points2,
    away: Float64[np.ndarray, "c k 2"],
    force_mm2: Scalars,
    place: Float64[np.ndarray, "m 2"],
    table_per_mm: Float64[np.ndarray, "3 3 21 21"],
) -> Float64[np.ndarray, " m"]:
    """(m,) missing depth under pressures, each of point forces with `_SHARES` around its centre."""
    found = np.zeros(len(place))
    near = np.empty(len(place), np.int64)
    for c in range(len(centre)):
        reach = np.full(2, 0.0)
        for k in range(away.shape[1]):
            for axis in range(2):
                reach[axis] = max(reach[axis], _REACH + abs(away[c, k, axis]))
        count = 0
        for m in range(len(place)):
            if abs(place[m, 0] - centre[c, 0]) < reach[0] and abs(place[m, 1] - centre[c, 1]) < reach[1]:
                near[count] = m
                count += 1
        if count > 0:
            own = near[:count]
            found[own] += missing_depth(centre[c] + away[c], force_mm2[c] * _SHARES, place[own], table_per_mm)
    return found


@kernel()
@no_type_check
def missing_depth(
    force_at: Points2,
    force_mm2: Scalars,
    place: Float64[np.ndarray, "m 2"],
    table_per_mm: Float64[np.ndarray, "3 3 21 21"],
) -> Float64[np.ndarray, " m"]:
    """(m,) missing depth of point forces (mm) by linear interpolation of `LocalDeflection.table_per_mm`.

    Args:
        force_at: (k, 2) places of the forces, in elements from the first corner.
        force_mm2: (k,) forces over E.
        place: (m, 2) where the depth is needed, in elements.
        table_per_mm: depth per force.
    """
    found = np.zeros(len(place))
    first, part, sign = np.empty(2, np.int64), np.empty(2), np.empty(2)
    share, mixed = np.empty((2, 2)), np.empty((2, 2))  # of the tables at the four nearest offsets; their sum
    for k in range(len(force_at)):
        for axis in range(2):
            inside = force_at[k, axis] - np.floor(force_at[k, axis])
            sign[axis] = -1.0 if inside > 0.5 else 1.0
            offset = (1.0 - inside if inside > 0.5 else inside) * 2.0 * (_OFFSETS - 1)
            first[axis] = min(int(offset), _OFFSETS - 2)
            part[axis] = offset - first[axis]
        for i in range(2):
            for j in range(2):
                share[i, j] = abs(1 - i - part[0]) * abs(1 - j - part[1]) * force_mm2[k]
        near = table_per_mm[first[0] : first[0] + 2, first[1] : first[1] + 2]
        for m in range(len(place)):
            x = (sign[0] * (place[m, 0] - force_at[k, 0]) / _REACH + 1.0) * 0.5 * (_STEPS - 1)
            y = (sign[1] * (place[m, 1] - force_at[k, 1]) / _REACH + 1.0) * 0.5 * (_STEPS - 1)
            if 0.0 <= x <= _STEPS - 1 and 0.0 <= y <= _STEPS - 1:
                i, j = min(int(x), _STEPS - 2), min(int(y), _STEPS - 2)
                x, y = x - i, y - j
                for a in range(2):
                    for b in range(2):
                        total = (
                            share[0, 0] * near[0, 0, i + a, j + b] + share[0, 1] * near[0, 1, i + a, j + b]
                        )
                        total += share[1, 0] * near[1, 0, i + a, j + b]
                        mixed[a, b] = total + share[1, 1] * near[1, 1, i + a, j + b]
                found[m] += (1.0 - x) * ((1.0 - y) * mixed[0, 0] + y * mixed[0, 1])
                found[m] += x * ((1.0 - y) * mixed[1, 0] + y * mixed[1, 1])
    return found


def local_deflection(shell: Shell) -> LocalDeflection:
    """Compute the missing depth for a sheet at rest."""
    patch = shell.patch
    element_mm = np.array(patch.size_mm) / np.array(patch.elements)
    size_mm = _ELEMENTS * element_mm
    coarse, fine = (
        replace(
            shell,
            patch=SplinePatch(
                size_mm=(float(size_mm[0]), float(size_mm[1])),
                elements=(_ELEMENTS * factor, _ELEMENTS * factor),
            ),
        )
        for factor in (1, _FINER)
    )
    offset = np.linspace(0.0, 0.5, _OFFSETS)
    forces_mm = np.stack(np.meshgrid(offset, offset, indexing="ij"), axis=-1).reshape(-1, 2) * element_mm
    away = np.linspace(-_REACH, _REACH, _STEPS)
    grid_mm = np.stack(np.meshgrid(away, away, indexing="ij"), axis=-1).reshape(-1, 2) * element_mm
    table = np.zeros((len(forces_mm), len(grid_mm)))
    for sheet, sign in ((fine, 1.0), (coarse, -1.0)):
        unit = sheet.patch
        tangent, force = sheet.empty_tangent(), np.zeros((unit.node_count, 3))
        sheet.forces_and_tangent(force.copy(), force, tangent)
        loads = np.stack([unit.load(place[None], np.array([[0.0, 0.0, -1.0]])) for place in forces_mm])
        loads *= unit.is_free
        found = tangent_factor(sheet, tangent).solve(loads.reshape(len(loads), -1))
        for number, (place, coefficient) in enumerate(zip(forces_mm, found, strict=True)):
            face = Face(shell=sheet, point_mm=np.ascontiguousarray(place + grid_mm))
            small = 1e-3 * coefficient.reshape(-1, 3)
            table[number] -= sign * 1e3 * face.displacement(small)[:, 2]
    # a smooth end, so that no step is added where the table ends
    fade = np.cos(0.5 * np.pi * np.clip((np.abs(away) / _REACH - 0.6) / 0.4, 0.0, 1.0)) ** 2
    shaped = table.reshape(_OFFSETS, _OFFSETS, _STEPS, _STEPS) * np.outer(fade, fade)
    return LocalDeflection(corner_mm=patch.corner_mm, element_mm=element_mm, table_per_mm=shaped)
