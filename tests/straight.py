"""A camera without distortion that looks straight at the sheet, for tests in which the lens is no matter."""

import numpy as np

from manytouch.values import Camera


def straight_camera(
    width_px: int,
    height_px: int,
    *,
    focal_px: float,
    distance_mm: float,
    principal_px: tuple[float, float] | None = None,
) -> Camera:
    """Its principal point is the middle of the image unless another one is given."""
    middle_px = (0.5 * (width_px - 1), 0.5 * (height_px - 1))
    cx_px, cy_px = middle_px if principal_px is None else principal_px
    return Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=cx_px,
        cy_px=cy_px,
        distortion=np.zeros(5),
        rotation_vector=np.zeros(3),
        translation_mm=np.array([0.0, 0.0, distance_mm]),
    )
