"""Watertight meshes of solids by manifold3d, and STL and 3MF files by trimesh (extra `parts`)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.design.parts.solids import Box, CrossHole, Pins, Primitive, Solid, Taper
from manytouch.errors import MissingExtraError, OutputError

if TYPE_CHECKING:
    from manifold3d import Manifold
    from trimesh import Trimesh

SEGMENT_MM = 0.25
"""Approximate length of the edges of the polygons that replace circles; these have at least 16 edges."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PartMesh:
    """A closed surface of triangles, which are counterclockwise when viewed from outside.

    Attributes:
        vertex_mm: (v, 3).
        triangle: (t, 3) indices of vertices.
    """

    vertex_mm: Float64[np.ndarray, "v 3"]
    triangle: Int64[np.ndarray, "t 3"]

    @property
    def corners_mm(self) -> Float64[np.ndarray, "t 3 3"]:
        """(t, 3, 3) corners of each triangle."""
        return np.asarray(self.vertex_mm[self.triangle])

    @property
    def volume_mm3(self) -> float:
        """Enclosed volume (divergence theorem)."""
        a, b, c = np.moveaxis(self.corners_mm, 1, 0)
        return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def make_mesh(solid: Solid) -> PartMesh:
    """The closed mesh of a solid.

    Circles become polygons of equal area, so that volumes are exact.

    Raises:
        MissingExtraError: manifold3d is not installed.
        ValueError: the solid is empty.
    """
    try:
        from manifold3d import Manifold, OpType
    except ModuleNotFoundError:
        raise MissingExtraError("meshes of parts", "manifold3d", "parts") from None
    joined = Manifold.batch_boolean([_manifold(item) for item in solid.joined], OpType.Add)
    if solid.removed:
        removed = Manifold.batch_boolean([_manifold(item) for item in solid.removed], OpType.Add)
        joined = joined - removed
    found = joined.to_mesh64()
    if len(found.tri_verts) == 0:
        raise ValueError("the solid is empty: the removed primitives cover all of it")
    return PartMesh(
        vertex_mm=np.asarray(found.vert_properties, dtype=np.float64)[:, :3],
        triangle=np.asarray(found.tri_verts, dtype=np.int64),
    )


def write_stl(mesh: PartMesh, path: Path) -> None:
    """Writes a binary STL file, mm.

    Raises:
        OutputError: the file cannot be written.
        MissingExtraError: trimesh is not installed.
    """
    shape = _trimesh(mesh)
    from trimesh.exchange.stl import export_stl

    _write(export_stl(shape), path)


def write_3mf(meshes: Sequence[tuple[str, PartMesh, str]], path: Path) -> None:
    """Writes a 3MF file of named objects with colours (#RRGGBB), mm, that a slicer opens as one print.

    Raises:
        OutputError: the file cannot be written.
        MissingExtraError: trimesh is not installed.
    """
    shapes = [(name, _trimesh(mesh), colour) for name, mesh, colour in meshes]
    import trimesh

    scene = trimesh.Scene()
    for name, shape, colour in shapes:
        rgb = [int(colour[place : place + 2], 16) for place in (1, 3, 5)]
        shape.visual = trimesh.visual.ColorVisuals(shape, face_colors=[*rgb, 255])
        shape.units = "millimeter"
        scene.add_geometry(shape, node_name=name, geom_name=name)
    scene.units = "millimeter"
    _write(scene.export(file_type="3mf"), path)  # type: ignore[no-untyped-call]


def _trimesh(mesh: PartMesh) -> "Trimesh":
    try:
        import trimesh
    except ModuleNotFoundError:
        raise MissingExtraError("files of parts", "trimesh", "parts") from None
    return trimesh.Trimesh(vertices=mesh.vertex_mm, faces=mesh.triangle, process=False)


def _write(content: bytes, path: Path) -> None:
    try:
        path.write_bytes(content)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}") from None


def _manifold(item: Primitive) -> "Manifold":
    match item:
        case Box():
            return _block(item.x_mm, item.y_mm, item.z_mm)
        case Taper():
            return _taper(item)
        case Pins():
            return _pins(item)
        case CrossHole():
            return _cross_hole(item)


def _block(x_mm: tuple[float, float], y_mm: tuple[float, float], z_mm: tuple[float, float]) -> "Manifold":
    from manifold3d import Manifold

    low, high = np.transpose([x_mm, y_mm, z_mm])
    return Manifold.cube((high - low).tolist()).translate(low.tolist())


def _taper(item: Taper) -> "Manifold":
    from manifold3d import Manifold

    corners: list[Any] = [
        [sx * size[0] / 2, sy * size[1] / 2, z]
        for size, z in ((item.lower_mm, item.z_mm[0]), (item.upper_mm, item.z_mm[1]))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    return Manifold.hull_points(np.array(corners))


def _circle(radius_mm: float) -> np.ndarray:
    """(n, 2) corners of a polygon with the area of the circle."""
    count = max(16, 4 * math.ceil(math.tau * radius_mm / SEGMENT_MM / 4))
    angle = math.tau * (np.arange(count) + 0.5) / count
    outer = radius_mm * math.sqrt(math.tau / count / math.sin(math.tau / count))
    return outer * np.column_stack([np.cos(angle), np.sin(angle)])


def _pins(item: Pins) -> "Manifold":
    from manifold3d import CrossSection, Manifold, OpType

    height = item.z_mm[1] - item.z_mm[0]
    share = item.upper_radius_mm / item.radius_mm
    one = Manifold.extrude(CrossSection([_circle(item.radius_mm)]), height, scale_top=(share, share))
    moved = [one.translate([float(x), float(y), item.z_mm[0]]) for x, y in item.centre_mm]
    return Manifold.batch_boolean(moved, OpType.Add)


def _cross_hole(item: CrossHole) -> "Manifold":
    from manifold3d import CrossSection, Manifold

    length = item.y_mm[1] - item.y_mm[0]
    lying = Manifold.extrude(CrossSection([_circle(item.radius_mm)]), length).rotate([-90.0, 0.0, 0.0])
    return lying.translate([item.x_mm, item.y_mm[0], item.z_mm])
