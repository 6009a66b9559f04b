"""The image of each round marker on the bent sheet, as an ellipse.

Its centroid is not the image of the marker's centre: perspective and bending distort the outline, which
is moved with the sheet, projected as a polygon, and replaced by the ellipse of the same area centroid and
second moments.
"""

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.camera import project
from manytouch.values import Camera
from manytouch.values.arrays import Matrices2, Points2, Points3, Scalars

CORNERS = 24
EQUAL_SECOND_MOMENT_SCALE = float(
    np.sqrt(3 / (2 + np.cos(2 * np.pi / CORNERS)))
)  # the polygon's second moment is the disc's
ANGLES = 2 * np.pi * np.arange(CORNERS) / CORNERS


def outlines(rest_mm: Points3, radius_mm: Scalars) -> Float64[np.ndarray, "corners 3"]:
    """Corners (n * CORNERS, 3) of the discs' outlines on the sheet at rest, disc after disc."""
    circle = EQUAL_SECOND_MOMENT_SCALE * np.column_stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros(CORNERS)])
    return (rest_mm[:, None, :] + radius_mm[:, None, None] * circle).reshape(-1, 3)


def dot_ellipses(camera: Camera, outline_mm: Float64[np.ndarray, "corners 3"]) -> tuple[Points2, Matrices2]:
    """Image ellipses of moved outlines: centroids (n, 2) px, shapes (n, 2, 2) as `render_discs` takes."""
    return polygon_ellipses(project(camera, outline_mm).reshape(-1, CORNERS, 2))


def polygon_ellipses(corner_px: np.ndarray) -> tuple[Points2, Matrices2]:
    """Centroids (n, 2) and shapes (n, 2, 2), px, of the ellipses with the moments of polygons (n, c, 2).

    A shape maps the unit disc to the ellipse, as in `render_discs`; NaN where a polygon has no area.
    """
    middle = corner_px.mean(axis=1)
    x, y = np.ascontiguousarray(np.moveaxis(corner_px - middle[:, None, :], 2, 0))
    next_x, next_y = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    sum_x, sum_y = x + next_x, y + next_y
    cross = x * next_y - y * next_x
    twice_area, centroid, shape = cross.sum(axis=1), np.empty((len(x), 2)), np.zeros((len(x), 2, 2))
    with np.errstate(invalid="ignore", divide="ignore"):  # NaN where a polygon has no area
        centroid[:, 0] = (cross * sum_x).sum(axis=1) / (3 * twice_area)
        centroid[:, 1] = (cross * sum_y).sum(axis=1) / (3 * twice_area)
        xx, xy, yy = (
            (cross * (of_sums + here + following)).sum(axis=1) / (12 * twice_area)
            for of_sums, here, following in (
                (sum_x * sum_x, x * x, next_x * next_x),
                (sum_x * sum_y, x * y, next_x * next_y),
                (sum_y * sum_y, y * y, next_y * next_y),
            )
        )
        # twice Cholesky's factor of the covariance
        shape[:, 0, 0] = 2 * np.sqrt(xx - centroid[:, 0] ** 2)
        shape[:, 1, 0] = 4 * (xy - centroid[:, 0] * centroid[:, 1]) / shape[:, 0, 0]
        shape[:, 1, 1] = np.sqrt(4 * (yy - centroid[:, 1] ** 2) - shape[:, 1, 0] ** 2)
    return middle + centroid, shape
