"""Compiled loops over markers in the plane of the sheet."""

import numpy as np

from manytouch.compilation import REORDER, inlined_kernel, kernel, no_type_check, u64
from manytouch.geometry.plane_table import PlaneNodes


@inlined_kernel(fastmath=REORDER)
@no_type_check
def _look_up(x: float, y: float, flat: np.ndarray, nodes: PlaneNodes) -> tuple[float, float]:
    """Where the ray of the pixel (x, y) meets the plane: x, y in mm. `flat` are the nodes, flattened."""
    rows, columns = nodes.node_mm.shape[0], nodes.node_mm.shape[1]
    per_px = 1.0 / nodes.step_px
    x, y = (x - nodes.low_px) * per_px, (y - nodes.low_px) * per_px
    if not (abs(x) < 1e9 and abs(y) < 1e9):
        return np.nan, np.nan
    column, row = int(min(max(x, 0.0), columns - 2.0)), int(min(max(y, 0.0), rows - 2.0))
    x, y = x - column, y - row
    # weights of value and slope at both ends of a unit interval
    rest, x_rest, y_rest = 1.0 - x, x * (1.0 - x), y * (1.0 - y)
    x0, x1, x2, x3 = (1.0 + 2.0 * x) * rest * rest, x_rest * rest, x * x * (3.0 - 2.0 * x), -x_rest * x
    rest = 1.0 - y
    y0, y1, y2, y3 = (1.0 + 2.0 * y) * rest * rest, y_rest * rest, y * y * (3.0 - 2.0 * y), -y_rest * y
    # the nodes of a row follow each other, eight numbers each: x and y, value and slope along y, along x
    a = u64(8 * (row * columns + column))
    b, c = a + u64(8), a + u64(8 * columns)
    d = c + u64(8)
    one_on, two_on, three_on, four_on = u64(1), u64(2), u64(3), u64(4)
    place_x = place_y = 0.0
    for k in range(2):
        value, slope = (y0, y1) if k == 0 else (y2, y3)
        one, two = (a, b) if k == 0 else (c, d)
        place_x += value * (
            x0 * flat[one] + x1 * flat[one + one_on] + x2 * flat[two] + x3 * flat[two + one_on]
        )
        place_x += slope * (
            x0 * flat[one + two_on]
            + x1 * flat[one + three_on]
            + x2 * flat[two + two_on]
            + x3 * flat[two + three_on]
        )
        one, two = one + four_on, two + four_on
        place_y += value * (
            x0 * flat[one] + x1 * flat[one + one_on] + x2 * flat[two] + x3 * flat[two + one_on]
        )
        place_y += slope * (
            x0 * flat[one + two_on]
            + x1 * flat[one + three_on]
            + x2 * flat[two + two_on]
            + x3 * flat[two + three_on]
        )
    return place_x, place_y


@kernel(fastmath=REORDER)
@no_type_check
def look_up(pixel: np.ndarray, nodes: PlaneNodes) -> np.ndarray:
    """(n, 2) mm in the plane where the rays of pixels (n, 2) meet it."""
    out, flat = np.empty((len(pixel), 2)), nodes.node_mm.reshape(-1)
    for m in range(len(pixel)):
        out[m, 0], out[m, 1] = _look_up(pixel[m, 0], pixel[m, 1], flat, nodes)
    return out


@kernel(fastmath=REORDER)
@no_type_check
def displacements_in_plane(
    pixel: np.ndarray,
    covariance_px2: np.ndarray,
    nodes: PlaneNodes,
    rest_mm: np.ndarray,
    plane_from_px: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (m, 2) in the plane, mm, and their covariances (m, 2, 2), mm^2.

    Args:
        pixel, covariance_px2: (m, 2), (m, 2, 2) in the image.
        nodes: of a `PlaneTable`.
        rest_mm: (m, 2) positions in the plane at rest.
        plane_from_px: (m, 2, 2) derivatives of positions in the plane with respect to pixels.
    """
    moved, out = np.empty((len(pixel), 2)), np.empty((len(pixel), 2, 2))
    flat = nodes.node_mm.reshape(-1)
    for m in range(len(pixel)):
        x, y = _look_up(pixel[m, 0], pixel[m, 1], flat, nodes)
        moved[m, 0], moved[m, 1] = x - rest_mm[m, 0], y - rest_mm[m, 1]
        matrix, covariance = plane_from_px[m], covariance_px2[m]
        a, b, c, d = matrix[0, 0], matrix[0, 1], matrix[1, 0], matrix[1, 1]
        xx, xy, yx, yy = covariance[0, 0], covariance[0, 1], covariance[1, 0], covariance[1, 1]
        top_x, top_y = a * xx + b * yx, a * xy + b * yy
        low_x, low_y = c * xx + d * yx, c * xy + d * yy
        out[m, 0, 0], out[m, 0, 1] = top_x * a + top_y * b, top_x * c + top_y * d
        out[m, 1, 0], out[m, 1, 1] = low_x * a + low_y * b, low_x * c + low_y * d
    return moved, out
