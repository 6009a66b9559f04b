"""The compiled surface at the markers of a frame, from their images.

It is one call, because each call of compiled code gives the interpreter to other threads: a live session has
several, and waits until one of them returns it.
"""

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.estimation.perimeter.interpolation_kernels import interpolate_unseen
from manytouch.estimation.perimeter.law_inputs import Rays
from manytouch.estimation.perimeter.law_kernels import surface_at_markers
from manytouch.estimation.perimeter.surface_inputs import InterpolationRule, SurfaceInputs
from manytouch.estimation.perimeter.view_kernels import estimate_motion, median_std
from manytouch.geometry.plane_kernels import displacements_in_plane
from manytouch.geometry.plane_table import PlaneNodes
from manytouch.values.arrays import Flags, Floats


@kernel()
@no_type_check
def surface_of_markers(
    pixel: Floats, covariance_px2: Floats, is_seen: Flags, given: SurfaceInputs
) -> tuple[Floats, Floats, Floats, Floats, float]:
    """The surface at the markers (m,); all arrays are empty where too few are seen.

    Args:
        pixel, covariance_px2: (m, 2), (m, 2, 2) centres in the image.
        is_seen: (m,).
        given: of sensor and parameters.

    Returns:
        Positions (m, 3), displacements (m, 3) and covariances (m, 3, 3) without the motion of the view;
        displacements (m, 2) in the plane of the sheet with it, and their median standard deviation.
    """
    given = SurfaceInputs(*given)
    if is_seen.sum() < given.least:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3, 3)), np.empty((0, 2)), np.nan
    rays = Rays(*given.rays)
    moved, covariance = displacements_in_plane(
        pixel, covariance_px2, PlaneNodes(*given.nodes), rays.rest, given.plane_from_px
    )
    if not is_seen.all():
        rule = InterpolationRule(*given.interpolation)
        moved, covariance = interpolate_unseen(moved, covariance, is_seen, rule)
    std = median_std(covariance, is_seen)
    view = estimate_motion(rays.rest, moved, is_seen, std, given.search)
    displacement, spread = surface_at_markers(moved, view, given.rays, given.cells, covariance, given.errors)
    return given.rest + displacement, displacement, spread, moved, std
