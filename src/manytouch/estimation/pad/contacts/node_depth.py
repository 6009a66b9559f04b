"""What the nodes of a pad are too coarse to show of the depth under a patch."""

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import kernel, no_type_check
from manytouch.estimation.pad.patch_kernels import (
    CENTRE_X,
    CENTRE_Y,
    DENSE_POINTS,
    DENSEST_POINTS,
    POINTS,
    ROOT_XX,
    ROOT_YX,
    ROOT_YY,
    PadGrid,
    Profile,
    add_pressure,
    cubic,
    density,
)
from manytouch.mechanics.pad.patch_depth import PatchDepthTable, patch_depth

_FLAT = int(Profile.FLAT)


@kernel()
@no_type_check
def unresolved_depth(
    parameters: Float64[np.ndarray, "10"],
    profile: int,
    grid: PadGrid,
    table: PatchDepthTable,
    node_depth: Float64[np.ndarray, "px py"],
) -> float:
    """The depth of a layer under the pressure of a patch, less that on its nodes.

    Both are times E and per unit normal force, 1/mm: of the centre, under a flat face the work of the
    pressure over its force.

    Args:
        parameters, profile: of the patch.
        grid: of the pad.
        table, node_depth: `depth_table` and `node_depth` of `BondedPadModel`.
    """
    shape = (3, grid.count_x + 3, grid.count_y + 3)
    pressed, seen = np.zeros(shape), np.zeros(shape[1:])
    level = density(parameters, grid)
    points = DENSEST_POINTS if level == 2 else DENSE_POINTS if level == 1 else POINTS
    add_pressure(parameters, grid, points[profile], pressed)
    if profile == _FLAT:
        seen[:] = pressed[0]
    else:
        along_x, along_y, unused = np.empty(4), np.empty(4), np.empty(4)
        place_x = (parameters[CENTRE_X] - grid.corner_x) / grid.step_x
        place_y = (parameters[CENTRE_Y] - grid.corner_y) / grid.step_y
        first_x = cubic(place_x, grid.count_x, along_x, unused)
        first_y = cubic(place_y, grid.count_y, along_y, unused)
        for i in range(4):
            for j in range(4):
                seen[first_x + i, first_y + j] = along_x[i] * along_y[j]
    on_nodes = _seen_depth(seen, pressed[0], node_depth)
    return (
        patch_depth(parameters[ROOT_XX], parameters[ROOT_YX], parameters[ROOT_YY], profile, table) - on_nodes
    )


@kernel()
@no_type_check
def _seen_depth(
    seen: Float64[np.ndarray, "nx ny"],
    pressed: Float64[np.ndarray, "nx ny"],
    node_depth: Float64[np.ndarray, "px py"],
) -> float:
    """Depths by forces on nodes, weighted with `seen` and summed; none from half a period on."""
    total, (columns, rows) = 0.0, node_depth.shape
    for m in range(pressed.shape[0]):
        for n in range(pressed.shape[1]):
            force = pressed[m, n]
            if force == 0.0:
                continue
            for i in range(max(0, m - columns // 2), min(seen.shape[0], m + columns // 2 + 1)):
                for j in range(max(0, n - rows // 2), min(seen.shape[1], n + rows // 2 + 1)):
                    total += force * seen[i, j] * node_depth[abs(i - m), abs(j - n)]
    return total
