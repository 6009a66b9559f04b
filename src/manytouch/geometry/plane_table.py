"""Where the rays of pixels meet the sheet's plane, from a table: the distortion is inverted once per sensor.

Between the nodes of a coarse grid over the image, places follow the cubic that has the right values and
slopes at the four nodes around. Lenses bend so smoothly that this is exact to far below a thousandth
of a pixel, at a fraction of the cost of inverting the distortion point by point.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from manytouch.geometry.camera import onto_plane
from manytouch.values import Camera
from manytouch.values.arrays import Covariances2, Points2, read_only

_COARSEST_PX, _FINEST_PX = 64.0, 8.0
_TOLERANCE_PX = 2e-6  # largest error of the table
_HALF_PX = 0.5  # step of the derivatives


class PlaneNodes(NamedTuple):
    """The nodes of a table.

    Attributes:
        node_mm: (rows, columns, 2, 2, 2) at each node, for x and y: value and slope along x, and both of
            these differentiated along y; slopes are per step.
        step_px: between nodes.
        low_px: x and y of the first node.
    """

    node_mm: np.ndarray
    step_px: float
    low_px: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlaneTable:
    """Positions in the plane of the sheet for every pixel of an image.

    Attributes:
        nodes: positions are interpolated between.
    """

    nodes: PlaneNodes

    def __call__(self, pixel: Points2) -> Points2:
        """(n, 2) mm in the plane of the sheet for pixels (n, 2) of the image; NaN stays NaN."""
        from manytouch.geometry.plane_kernels import look_up

        return look_up(np.ascontiguousarray(pixel), self.nodes)


def plane_table(camera: Camera) -> PlaneTable:
    """The table of a camera, as coarse as its lens allows."""
    step_px = _COARSEST_PX
    while True:
        table = _table(camera, step_px)
        if step_px <= _FINEST_PX or _error_px(camera, table) < _TOLERANCE_PX:
            return table
        step_px /= 2.0


def plane_from_px(camera: Camera, pixel: Points2) -> Covariances2:
    """(n, 2, 2) derivatives of places in the plane with respect to pixels."""
    step = _HALF_PX * np.eye(2)
    columns = [_places(camera, pixel + h) - _places(camera, pixel - h) for h in step]
    return np.stack(columns, axis=-1)


def _places(camera: Camera, pixel: Points2) -> Points2:
    return onto_plane(camera, pixel)[:, :2]


def _table(camera: Camera, step_px: float) -> PlaneTable:
    low_px = -0.5 * step_px
    columns, rows = (int(np.ceil(size / step_px)) + 2 for size in (camera.width_px, camera.height_px))
    row, column = np.divmod(np.arange(rows * columns), columns)
    pixel = low_px + step_px * np.column_stack([column, row]).astype(np.float64)
    slope = step_px * plane_from_px(camera, pixel)
    half = np.array([0.0, _HALF_PX])
    up, down = (plane_from_px(camera, pixel + off)[:, :, 0] for off in (-half, half))
    value_row = np.stack([_places(camera, pixel), slope[:, :, 0]], axis=-1)
    slope_row = np.stack([slope[:, :, 1], step_px**2 * (down - up)], axis=-1)
    node = np.stack([value_row, slope_row], axis=-2)
    node_mm = read_only(np.ascontiguousarray(node.reshape(rows, columns, 2, 2, 2)))
    return PlaneTable(nodes=PlaneNodes(node_mm, step_px, low_px))


def _error_px(camera: Camera, table: PlaneTable) -> float:
    """Largest error of the table at the points farthest from its nodes."""
    x, y = (
        table.nodes.step_px * np.arange(int(size / table.nodes.step_px))
        for size in (camera.width_px, camera.height_px)
    )
    pixel = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    off_mm = np.abs(table(pixel) - _places(camera, pixel))
    mm_per_px = np.sqrt(np.abs(np.linalg.det(plane_from_px(camera, pixel))))
    return float((off_mm / mm_per_px[:, None]).max())
