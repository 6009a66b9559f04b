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

    A shape maps the unit disc to the ellipse, as in `render_discs`.
    """
    middle = corner_px.mean(axis=1)
    here = corner_px - middle[:, None, :]
    following = np.roll(here, -1, axis=1)
    cross = here[:, :, 0] * following[:, :, 1] - here[:, :, 1] * following[:, :, 0]
    twice_area = cross.sum(axis=1)
    centroid = np.einsum("nc,nci->ni", cross, here + following) / (3 * twice_area[:, None])
    both = here + following
    second = (
        np.einsum("nc,nci,ncj->nij", cross, both, both)
        + np.einsum("nc,nci,ncj->nij", cross, here, here)
        + np.einsum("nc,nci,ncj->nij", cross, following, following)
    ) / (12 * twice_area[:, None, None])
    covariance = second - centroid[:, :, None] * centroid[:, None, :]
    return middle + centroid, 2 * np.linalg.cholesky(covariance)
