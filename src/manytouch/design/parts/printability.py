"""Checks whether parts can be printed: closed meshes, size, thin features, overhangs."""

import numpy as np

from manytouch.design.parts.casing import CasingChoices
from manytouch.design.parts.meshing import PartMesh
from manytouch.design.requirements import Printer
from manytouch.values import Sensor

STEEPEST_DEG = 45.0
"""Largest angle of a face from the vertical that prints without support."""
BRIDGE_MM = 8.0
"""An overhanging face is bridged if it is no wider than this."""


def open_edges(mesh: PartMesh) -> int:
    """Number of edges without exactly one triangle on each side; 0 for a watertight mesh."""
    a, b, c = mesh.triangle.T
    there = np.concatenate([np.column_stack(pair) for pair in ((a, b), (b, c), (c, a))])
    count = np.int64(len(mesh.vertex_mm))
    key, back = there[:, 0] * count + there[:, 1], there[:, 1] * count + there[:, 0]
    unique, times = np.unique(key, return_counts=True)
    return int((times != 1).sum() + (~np.isin(unique, back)).sum())


def overhang_mm2(mesh: PartMesh) -> float:
    """Area of overhangs of more than 45 degrees that are neither on the bed nor narrow enough to bridge."""
    corners = mesh.corners_mm
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(normal, axis=1)
    down = -normal[:, 2] / np.maximum(doubled, 1e-30)
    on_bed = corners[:, :, 2].max(axis=1) < corners[..., 2].min() + 1e-6
    hangs = (down > np.cos(np.deg2rad(90 - STEEPEST_DEG)) + 1e-3) & ~on_bed
    return float(sum(area for area, width in _patches(mesh, hangs, doubled / 2) if width > BRIDGE_MM))


def printability_warnings(
    sensor: Sensor, printer: Printer, choices: CasingChoices, meshes: dict[str, PartMesh]
) -> tuple[str, ...]:
    """Problems of printing the parts, one message each."""
    found = []
    layout = sensor.layout
    assert layout is not None
    radius, gap = float(layout.radius_mm[0]), float(layout.pitch_mm.min()) - 2 * float(layout.radius_mm[0])
    if choices.wall_mm < 3 * printer.nozzle_mm:
        found.append(
            f"the wall of the casing ({choices.wall_mm:g} mm) is thinner than three lines of "
            f"{printer.nozzle_mm:g} mm"
        )
    if 2 * radius < 2 * printer.nozzle_mm:
        found.append(f"markers ({2 * radius:.2f} mm) are narrower than two lines of {printer.nozzle_mm:g} mm")
    if gap < 2 * printer.nozzle_mm:
        found.append(
            f"the gap between markers ({gap:.2f} mm) is narrower than two lines of {printer.nozzle_mm:g} mm"
        )
    for name, mesh in meshes.items():
        size = np.ptp(mesh.vertex_mm, axis=0)
        if not _fits(size, printer.bed_mm):
            found.append(
                f"the {name} ({size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm) is larger than the bed of "
                f"the printer ({printer.bed_mm[0]:g} x {printer.bed_mm[1]:g} x {printer.bed_mm[2]:g} mm)"
            )
        if open_edges(mesh):
            found.append(f"the mesh of the {name} is not closed: {open_edges(mesh)} open edges")
        hanging = overhang_mm2(mesh)
        if hanging > 0 and name != "markers":  # markers are printed into or onto the sheet
            found.append(f"the {name} has {hanging:.0f} mm² of overhangs: print it with support")
    return tuple(found)


def _fits(size: np.ndarray, bed_mm: tuple[float, float, float]) -> bool:
    return bool(size[2] <= bed_mm[2] and np.all(np.sort(size[:2]) <= np.sort(bed_mm[:2])))


def _patches(mesh: PartMesh, chosen: np.ndarray, area_mm2: np.ndarray) -> list[tuple[float, float]]:
    """Area and width of each connected set of chosen triangles; the width is the smaller side of its box."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    number = np.flatnonzero(chosen)
    if len(number) == 0:
        return []
    triangle = mesh.triangle[number]
    rows = np.repeat(np.arange(len(number)), 3)
    by_vertex = coo_matrix((np.ones(len(rows)), (rows, triangle.ravel()))).tocsr()
    count, label = connected_components(by_vertex @ by_vertex.T, directed=False)
    found = []
    for patch in range(count):
        own = number[label == patch]
        box = np.ptp(mesh.corners_mm[own].reshape(-1, 3)[:, :2], axis=0)
        found.append((float(area_mm2[own].sum()), float(box.min())))
    return found
