"""STEP files of solids by build123d (extra `parts`), for further work in CAD."""

from pathlib import Path
from typing import Any

from manytouch.design.parts.solids import Box, CrossHole, Pins, Primitive, Solid, Taper
from manytouch.errors import MissingExtraError, OutputError


def write_step(solid: Solid, path: Path) -> None:
    """Writes a STEP file with exact cylinders and planes, mm.

    Raises:
        MissingExtraError: build123d is not installed.
        OutputError: the file cannot be written.
    """
    try:
        from build123d import export_step
    except ModuleNotFoundError:
        raise MissingExtraError("STEP files", "build123d", "parts") from None
    shape = _union(solid.joined)
    if solid.removed:
        shape -= _union(solid.removed)
    try:
        written = export_step(shape, str(path))
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}") from None
    except RuntimeError:  # of build123d where a file cannot be opened
        written = False
    if not written:
        raise OutputError(f"cannot write {path}: check that its folder exists and may be written to")


def _union(items: tuple[Primitive, ...]) -> Any:
    first, *others = [shape for item in items for shape in _shapes(item)]
    return first.fuse(*others) if others else first


def _shapes(item: Primitive) -> list[Any]:
    import build123d as cad

    match item:
        case Box():
            (x0, x1), (y0, y1), (z0, z1) = item.x_mm, item.y_mm, item.z_mm
            return [cad.Pos(x0, y0, z0) * cad.Solid.make_box(x1 - x0, y1 - y0, z1 - z0)]
        case Taper():
            ends = [
                cad.Plane(origin=(0, 0, z)) * cad.Rectangle(*size)
                for size, z in ((item.lower_mm, item.z_mm[0]), (item.upper_mm, item.z_mm[1]))
            ]
            return [cad.Solid.make_loft([end.wire() for end in ends], ruled=True)]
        case Pins():
            height = item.z_mm[1] - item.z_mm[0]
            one = (
                cad.Solid.make_cylinder(item.radius_mm, height)
                if item.radius_mm == item.upper_radius_mm
                else cad.Solid.make_cone(item.radius_mm, item.upper_radius_mm, height)
            )
            return [cad.Pos(float(x), float(y), item.z_mm[0]) * one for x, y in item.centre_mm]
        case CrossHole():
            plane = cad.Plane(origin=(item.x_mm, item.y_mm[0], item.z_mm), z_dir=(0, 1, 0))
            return [cad.Solid.make_cylinder(item.radius_mm, item.y_mm[1] - item.y_mm[0], plane=plane)]
