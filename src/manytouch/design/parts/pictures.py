"""A picture of the parts to print in perspective, with their sizes."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float64

from manytouch.design.parts.casing import Part
from manytouch.design.parts.meshing import PartMesh
from manytouch.errors import MissingExtraError
from manytouch.values.arrays import Points2, Points3

TOGETHER = ("sheet", "markers")
TURN_DEG, RISE_DEG = 28.0, 38.0
ACROSS_PX = 1000
SAMPLES_PER_PX = 4.0
DARKEST = 0.45
"""Smallest grey level of black parts in the picture."""
AMBIENT = 0.35
LIGHT = np.array([-0.35, -0.45, 0.82])


def draw_parts(parts: Sequence[Part], meshes: Mapping[str, PartMesh], path: Path) -> None:
    """Draws all parts as a PNG; the sheet includes its markers.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError("pictures of parts", "matplotlib", "parts") from None
    groups = [[part for part in parts if part.name in TOGETHER]]
    groups += [[part] for part in parts if part.name not in TOGETHER]
    figure = Figure(figsize=(4.6 * len(groups), 4.0), layout="constrained")
    for axes, group in zip(np.atleast_1d(figure.subplots(1, len(groups))), groups, strict=True):
        corners = [meshes[part.name].corners_mm for part in group]
        axes.imshow(render_meshes(corners, [part.colour for part in group]), interpolation="antialiased")
        size = np.ptp(np.concatenate([part.reshape(-1, 3) for part in corners]), axis=0)
        name = " with ".join(part.name for part in group)
        axes.set_title(f"{name}\n{size[0]:.0f} x {size[1]:.0f} x {size[2]:.1f} mm, as printed", fontsize=11)
        axes.set_axis_off()
    figure.savefig(path, dpi=110)


def render_meshes(
    corners: Sequence[Float64[np.ndarray, "_ 3 3"]],
    colours: Sequence[str],
    *,
    rise_deg: float = RISE_DEG,
    across_px: int = ACROSS_PX,
) -> np.ndarray:
    """(h, w, 3) uint8 RGB picture of meshes, by a depth buffer of random points on their triangles.

    Args:
        corners: (t, 3, 3) triangles of each mesh, mm.
        colours: of each mesh.
        rise_deg: elevation of the viewer above the horizon.
        across_px: width of the meshes in the picture.
    """
    from matplotlib.colors import to_rgb

    view = _view(rise_deg)
    rotated = [part @ view.T for part in corners]
    low, high, px_per_mm = _extent(rotated, across_px)
    width, height = (int(np.ceil(side * px_per_mm)) + 3 for side in (high - low)[:2])
    nearest = np.full((height, width), -np.inf)
    picture = np.ones((height, width, 3))
    random = np.random.default_rng(0)
    for part, mesh, colour in zip(rotated, corners, colours, strict=True):
        edge = np.cross(mesh[:, 1] - mesh[:, 0], mesh[:, 2] - mesh[:, 0])
        normal = edge / np.maximum(np.linalg.norm(edge, axis=1, keepdims=True), 1e-12)
        shade = AMBIENT + (1.0 - AMBIENT) * np.clip(normal @ LIGHT, 0.0, 1.0)
        flat = np.linalg.det(part[:, 1:, :2] - part[:, :1, :2])
        count = np.where(flat > 0.0, np.ceil(SAMPLES_PER_PX * 0.5 * flat * px_per_mm**2) + 2, 0).astype(int)
        of = np.repeat(np.arange(len(part)), count)
        u, v = random.random((2, len(of)))
        u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
        place = (
            part[of, 0] + u[:, None] * (part[of, 1] - part[of, 0]) + v[:, None] * (part[of, 2] - part[of, 0])
        )
        column = np.rint((place[:, 0] - low[0]) * px_per_mm).astype(int) + 1
        row = np.rint((high[1] - place[:, 1]) * px_per_mm).astype(int) + 1
        order = np.argsort(place[:, 2])  # the nearest point is written last
        column, row, of, depth = column[order], row[order], of[order], place[order, 2]
        is_front = depth > nearest[row, column]
        column, row, of, depth = column[is_front], row[is_front], of[is_front], depth[is_front]
        nearest[row, column] = depth
        picture[row, column] = shade[of][:, None] * np.maximum(to_rgb(colour), DARKEST)
    # Points are scattered by random, so that some pixels get none.
    return np.asarray(cv2.medianBlur((255 * picture).astype(np.uint8), 3))


def places_px(
    corners: Sequence[Float64[np.ndarray, "_ 3 3"]], point_mm: Points3, *, rise_deg: float, across_px: int
) -> Points2:
    """(n, 2) column and row of points in the picture of `render_meshes` with the same arguments."""
    view = _view(rise_deg)
    low, high, px_per_mm = _extent([part @ view.T for part in corners], across_px)
    x, y, _ = view @ point_mm.T
    return np.column_stack([(x - low[0]) * px_per_mm + 1, (high[1] - y) * px_per_mm + 1])


def _extent(rotated: Sequence[np.ndarray], across_px: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Smallest and largest coordinates of all meshes, and the pixels per mm."""
    everything = np.concatenate([part.reshape(-1, 3) for part in rotated])
    low, high = everything.min(axis=0), everything.max(axis=0)
    return low, high, across_px / float((high - low)[0])


def _view(rise_deg: float) -> np.ndarray:
    """(3, 3) rotation to x right, y up, z towards the viewer."""
    turn, rise = np.deg2rad([TURN_DEG, 90.0 - rise_deg])
    about_z = np.array(
        [[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]]
    )
    about_x = np.array(
        [[1.0, 0.0, 0.0], [0.0, np.cos(rise), np.sin(rise)], [0.0, -np.sin(rise), np.cos(rise)]]
    )
    return np.asarray(about_x @ about_z)
