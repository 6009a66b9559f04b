"""Marker images of a patch under its own loads, and their derivatives by its parameters, compiled.

Both are sums over the points of a quadrature. Markers far from a patch get the few points of `FAR_POINTS`,
which have the moments of `POINTS` up to the fifth order.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import REORDER, kernel, no_type_check
from manytouch.estimation.pad.patch_forces import (
    FORCE,
    PARAMETER_COUNT,
    RADIAL_SHEAR,
    TORQUE,
    add_scaled,
    add_tractions,
    fill_force_slopes,
    image_load_of,
)
from manytouch.estimation.pad.patch_kernels import (
    CENTRE_X,
    CENTRE_Y,
    FAR_POINTS,
    POINTS,
    ROOT_XX,
    ROOT_YX,
    ROOT_YY,
    LayerTable,
    Markers,
    PadGrid,
    density,
    moment_trace,
    radial_arm_slopes,
    radial_arms,
    spread_of,
)

_FAR_ROOTS = 4.0  # distance from the centre of a patch, in its largest roots, from which on a marker is far
_EXTENT = 2.4  # of the points, in the same
_ROOT_STEP = 1e-6  # relative, in differences of the spread of points


class PatchPad(NamedTuple):
    """What images of patches on a pad depend on.

    Attributes:
        grid, table, markers: see their classes.
        by_sides: (3, nx, ny, 2 m) change of the marker images per nodal force by the free sides of the pad.
    """

    grid: PadGrid
    table: LayerTable
    markers: Markers
    by_sides: Float64[np.ndarray, "3 nx ny r"]


@kernel()
@no_type_check
def _window(grid: PadGrid, parameters: Float64[np.ndarray, "10"]) -> tuple[int, int, int, int]:
    """First and last node + 1 along x and y that a patch can load, with a margin for moved shapes."""
    reach_x = 2.6 * abs(parameters[ROOT_XX])
    yx, yy = parameters[ROOT_YX], parameters[ROOT_YY]
    reach_y = 2.6 * np.sqrt(yx * yx + yy * yy)
    low_x = int(np.floor((parameters[CENTRE_X] - reach_x - grid.corner_x) / grid.step_x))
    high_x = int(np.floor((parameters[CENTRE_X] + reach_x - grid.corner_x) / grid.step_x)) + 4
    low_y = int(np.floor((parameters[CENTRE_Y] - reach_y - grid.corner_y) / grid.step_y))
    high_y = int(np.floor((parameters[CENTRE_Y] + reach_y - grid.corner_y) / grid.step_y)) + 4
    low_x = min(max(low_x, 0), grid.count_x - 1)
    low_y = min(max(low_y, 0), grid.count_y - 1)
    high_x = max(min(high_x, grid.count_x + 3), low_x + 4)
    high_y = max(min(high_y, grid.count_y + 3), low_y + 4)
    return low_x, high_x, low_y, high_y


@kernel()
@no_type_check
def _along_radius(
    table: LayerTable, blob: float, value: Float64[np.ndarray, "n 5"], slope: Float64[np.ndarray, "n 5"]
) -> None:
    """The table for one root of the Gaussians, and its derivative by this root."""
    rate = np.log(table.root[1] / table.root[0])
    place = np.log(blob / table.root[0]) / rate
    low = min(int(place), len(table.root) - 2)
    above = place - low
    per_mm = 1.0 / (rate * blob)
    for n in range(len(value)):
        for j in range(5):
            below, over = table.value[low, n, j], table.value[low + 1, n, j]
            value[n, j] = (1.0 - above) * below + above * over
            slope[n, j] = (over - below) * per_mm


@kernel()
@no_type_check
def _place_points(
    points: Float64[np.ndarray, "q 3"],
    spread: tuple[float, float, float, float, float],
    load: tuple[float, float, float, float, float, float, float],
    placed: Float64[np.ndarray, "q 5"],
) -> None:
    """Places of the points from the centre, their weights, and their tractions along x and y."""
    _, xx, yx, yy, _ = spread
    _, shear_x, shear_y, turn, arm_xx, arm_yx, arm_yy = load
    for k in range(len(points)):
        ax, ay = xx * points[k, 0], yx * points[k, 0] + yy * points[k, 1]
        placed[k, 0], placed[k, 1], placed[k, 2] = ax, ay, points[k, 2]
        placed[k, 3] = points[k, 2] * (shear_x + arm_xx * ax + (arm_yx - turn) * ay)
        placed[k, 4] = points[k, 2] * (shear_y + (arm_yx + turn) * ax + arm_yy * ay)


@kernel()
@no_type_check
def _far_from(spread: tuple[float, float, float, float, float], reach_mm: float) -> tuple[float, float]:
    """Squared distances between which a marker is far from a patch; the layer ends at `reach_mm`."""
    blob, xx, yx, yy, _ = spread
    trace, area = xx * xx + yx * yx + yy * yy, xx * yy
    largest = 0.5 * trace + np.sqrt(max(0.25 * trace * trace - area * area, 0.0)) + blob * blob
    inside_mm = max(reach_mm - _EXTENT * np.sqrt(largest), 0.0)
    return _FAR_ROOTS * _FAR_ROOTS * largest, inside_mm * inside_mm


@kernel(fastmath=REORDER)
@no_type_check
def add_image(
    parameters: Float64[np.ndarray, "10"], profile: int, pad: PatchPad, image: Float64[np.ndarray, " r"]
) -> None:
    """Add the marker images (2 m,) of a contact, px.

    Args:
        parameters: (PARAMETER_COUNT,) of the contact.
        profile: of its pressure.
        pad: the pad.
        image: result.
    """
    table, markers = pad.table, pad.markers
    spread = spread_of(parameters, profile, table.root[0], table.root[-1])
    load = image_load_of(parameters, spread[4])
    count = table.value.shape[1]
    along, by_root = np.empty((count, 5)), np.empty((count, 5))
    _along_radius(table, spread[0], along, by_root)
    points, far_points = POINTS[profile], FAR_POINTS[profile]
    near, far = np.empty((len(points), 5)), np.empty((len(far_points), 5))
    _place_points(points, spread, load, near)
    _place_points(far_points, spread, load, far)
    near2, far2 = _far_from(spread, (count - 1) * table.step)
    per_step, press = 1.0 / table.step, load[0]
    for m in range(len(markers.place)):
        px, py = markers.place[m, 0] - parameters[CENTRE_X], markers.place[m, 1] - parameters[CENTRE_Y]
        placed = far if near2 < px * px + py * py < far2 else near
        ux = uy = uz = 0.0
        for k in range(len(placed)):
            dx, dy = px - placed[k, 0], py - placed[k, 1]
            distance = np.sqrt(dx * dx + dy * dy)
            first = int(distance * per_step)
            if first >= count - 1:
                continue
            share = distance * per_step - first
            rest = 1.0 - share
            inverse = 1.0 / max(distance, 1e-12)
            c, s = dx * inverse, dy * inverse
            force, tx, ty = press * placed[k, 2], placed[k, 3], placed[k, 4]
            out = rest * along[first, 0] + share * along[first + 1, 0]
            up = rest * along[first, 1] + share * along[first + 1, 1]
            even = rest * along[first, 2] + share * along[first + 1, 2]
            turned = rest * along[first, 3] + share * along[first + 1, 3]
            lifted = rest * along[first, 4] + share * along[first + 1, 4]
            double_c, double_s = turned * (c * c - s * s), 2.0 * turned * s * c
            ux += tx * (even + double_c) + ty * double_s - force * out * c
            uy += tx * double_s + ty * (even - double_c) - force * out * s
            uz += (tx * c + ty * s) * lifted - force * up
        for axis in range(2):
            slope = markers.slope[m, axis]
            image[2 * m + axis] += slope[0] * ux + slope[1] * uy + slope[2] * uz
    shape = pad.by_sides.shape
    unit, nodal = np.empty((3, shape[1], shape[2])), np.zeros((3, shape[1], shape[2]))
    add_tractions(parameters, profile, pad.grid, density(parameters, pad.grid), unit, nodal)
    low_x, high_x, low_y, high_y = _window(pad.grid, parameters)
    for axis in range(3):
        for i in range(low_x, high_x):
            for j in range(low_y, high_y):
                if unit[0, i, j] != 0.0:
                    add_scaled(nodal[axis, i, j], pad.by_sides[axis, i, j], image)


@kernel()
@no_type_check
def _spread_slopes(
    parameters: Float64[np.ndarray, "10"], profile: int, table: LayerTable, slope: Float64[np.ndarray, "3 5"]
) -> None:
    """Derivatives of the spread of points by the three roots of the shape."""
    moved = parameters.copy()
    for j in range(3):
        step = _ROOT_STEP * (abs(parameters[ROOT_XX]) + abs(parameters[ROOT_YY]))
        moved[ROOT_XX + j] = parameters[ROOT_XX + j] + step
        above = spread_of(moved, profile, table.root[0], table.root[-1])
        moved[ROOT_XX + j] = parameters[ROOT_XX + j] - step
        below = spread_of(moved, profile, table.root[0], table.root[-1])
        moved[ROOT_XX + j] = parameters[ROOT_XX + j]
        for k in range(5):
            slope[j, k] = (above[k] - below[k]) / (2.0 * step)


@kernel(fastmath=REORDER)
@no_type_check
def fill_slopes(  # noqa: PLR0915 - one pass over all pairs of markers and points
    parameters: Float64[np.ndarray, "10"], profile: int, pad: PatchPad, slope: Float64[np.ndarray, "10 r"]
) -> None:
    """Derivatives of the marker images by the shape of a contact, and images by its unit loads.

    Args:
        parameters: (PARAMETER_COUNT,) of the contact.
        profile: of its pressure.
        pad: the pad.
        slope: result; the last row is for unit radial shear as a force.
    """
    table, markers = pad.table, pad.markers
    spread = spread_of(parameters, profile, table.root[0], table.root[-1])
    load = image_load_of(parameters, spread[4])
    chain, count = np.empty((3, 5)), table.value.shape[1]
    _spread_slopes(parameters, profile, table, chain)
    along, by_root = np.empty((count, 5)), np.empty((count, 5))
    _along_radius(table, spread[0], along, by_root)
    points, far_points = POINTS[profile], FAR_POINTS[profile]
    near, far = np.empty((len(points), 5)), np.empty((len(far_points), 5))
    _place_points(points, spread, load, near)
    _place_points(far_points, spread, load, far)
    near2, far2 = _far_from(spread, (count - 1) * table.step)
    per_step = 1.0 / table.step
    press, _, _, turn, arm_xx, arm_yx, arm_yy = load
    scale_turn, (unit_xx, unit_yx, unit_yy) = 1.0 / moment_trace(parameters), radial_arms(parameters)
    radial, arm_slope = press * parameters[RADIAL_SHEAR], np.empty((3, 3))
    radial_arm_slopes(parameters, arm_slope)
    by_arm = np.empty((3, 3))
    total, by_load, by_spread = np.empty((PARAMETER_COUNT, 3)), np.empty((4, 3)), np.empty((5, 3))
    for m in range(len(markers.place)):
        px, py = markers.place[m, 0] - parameters[CENTRE_X], markers.place[m, 1] - parameters[CENTRE_Y]
        is_far = near2 < px * px + py * py < far2
        placed, unit = (far, far_points) if is_far else (near, points)
        out_x = out_y = out_z = 0.0
        xx = xy = yy = xz = yz = 0.0
        p_xx = p_xy = p_yy = p_xz = p_yz = 0.0
        q_xx = q_xy = q_yy = q_xz = q_yz = 0.0
        gx0 = gx1 = gx2 = gy0 = gy1 = gy2 = 0.0
        pgx0 = pgx1 = pgx2 = pgy0 = pgy1 = pgy2 = qgy0 = qgy1 = qgy2 = 0.0
        h0 = h1 = h2 = 0.0
        for k in range(len(placed)):
            dx, dy = px - placed[k, 0], py - placed[k, 1]
            distance = np.sqrt(dx * dx + dy * dy)
            first = int(distance * per_step)
            if first >= count - 1:
                continue
            share = distance * per_step - first
            rest = 1.0 - share
            inverse = 1.0 / max(distance, 1e-12)
            c, s = dx * inverse, dy * inverse
            c2, s2 = c * c - s * s, 2.0 * s * c
            weight, tx, ty = placed[k, 2], placed[k, 3], placed[k, 4]
            p, q, force = unit[k, 0], unit[k, 1], press * weight
            a, b = along[first], along[first + 1]
            out, up = rest * a[0] + share * b[0], rest * a[1] + share * b[1]
            even, turned = rest * a[2] + share * b[2], rest * a[3] + share * b[3]
            lifted = rest * a[4] + share * b[4]
            # unit loads
            bxx, bxy, byy = even + turned * c2, turned * s2, even - turned * c2
            bxz, byz = lifted * c, lifted * s
            out_x, out_y, out_z = out_x + weight * out * c, out_y + weight * out * s, out_z + weight * up
            wxx, wxy, wyy, wxz, wyz = weight * bxx, weight * bxy, weight * byy, weight * bxz, weight * byz
            xx, xy, yy, xz, yz = xx + wxx, xy + wxy, yy + wyy, xz + wxz, yz + wyz
            p_xx, p_xy, p_yy = p_xx + p * wxx, p_xy + p * wxy, p_yy + p * wyy
            p_xz, p_yz = p_xz + p * wxz, p_yz + p * wyz
            q_xx, q_xy, q_yy = q_xx + q * wxx, q_xy + q * wxy, q_yy + q * wyy
            q_xz, q_yz = q_xz + q * wxz, q_yz + q * wyz
            # by the distance, and by the angle over the distance
            dout, dup = (b[0] - a[0]) * per_step, (b[1] - a[1]) * per_step
            deven, dturned = (b[2] - a[2]) * per_step, (b[3] - a[3]) * per_step
            dlifted = (b[4] - a[4]) * per_step
            t_in, t_across = tx * c + ty * s, ty * c - tx * s
            r0 = deven * tx + dturned * (tx * c2 + ty * s2) - force * dout * c
            r1 = deven * ty + dturned * (tx * s2 - ty * c2) - force * dout * s
            r2 = dlifted * t_in - force * dup
            f0 = inverse * (2.0 * turned * (ty * c2 - tx * s2) + force * out * s)
            f1 = inverse * (2.0 * turned * (tx * c2 + ty * s2) - force * out * c)
            f2 = inverse * lifted * t_across
            x0, x1, x2 = c * r0 - s * f0, c * r1 - s * f1, c * r2 - s * f2
            y0, y1, y2 = s * r0 + c * f0, s * r1 + c * f1, s * r2 + c * f2
            gx0, gx1, gx2, gy0, gy1, gy2 = gx0 + x0, gx1 + x1, gx2 + x2, gy0 + y0, gy1 + y1, gy2 + y2
            pgx0, pgx1, pgx2 = pgx0 + p * x0, pgx1 + p * x1, pgx2 + p * x2
            pgy0, pgy1, pgy2 = pgy0 + p * y0, pgy1 + p * y1, pgy2 + p * y2
            qgy0, qgy1, qgy2 = qgy0 + q * y0, qgy1 + q * y1, qgy2 + q * y2
            # by the root of the Gaussians
            a, b = by_root[first], by_root[first + 1]
            out, up = rest * a[0] + share * b[0], rest * a[1] + share * b[1]
            even, turned = rest * a[2] + share * b[2], rest * a[3] + share * b[3]
            lifted = rest * a[4] + share * b[4]
            h0 += even * tx + turned * (tx * c2 + ty * s2) - force * out * c
            h1 += even * ty + turned * (tx * s2 - ty * c2) - force * out * s
            h2 += lifted * t_in - force * up
        by_load[0, 0], by_load[0, 1], by_load[0, 2] = -out_x, -out_y, -out_z
        by_load[1, 0], by_load[1, 1], by_load[1, 2] = xx, xy, xz
        by_load[2, 0], by_load[2, 1], by_load[2, 2] = xy, yy, yz
        a_xx, a_yx, a_yy = spread[1], spread[2], spread[3]
        x_xx, x_xy, x_yy, x_xz, x_yz = a_xx * p_xx, a_xx * p_xy, a_xx * p_yy, a_xx * p_xz, a_xx * p_yz
        y_xx, y_xy, y_yy = a_yx * p_xx + a_yy * q_xx, a_yx * p_xy + a_yy * q_xy, a_yx * p_yy + a_yy * q_yy
        y_xz, y_yz = a_yx * p_xz + a_yy * q_xz, a_yx * p_yz + a_yy * q_yz
        by_load[3, 0], by_load[3, 1], by_load[3, 2] = x_xy - y_xx, x_yy - y_xy, x_yz - y_xz
        by_arm[0, 0], by_arm[0, 1], by_arm[0, 2] = x_xx, x_xy, x_xz
        by_arm[1, 0], by_arm[1, 1], by_arm[1, 2] = y_xx + x_xy, y_xy + x_yy, y_xz + x_yz
        by_arm[2, 0], by_arm[2, 1], by_arm[2, 2] = y_xy, y_yy, y_yz
        total[CENTRE_X, 0], total[CENTRE_X, 1], total[CENTRE_X, 2] = -gx0, -gx1, -gx2
        total[CENTRE_Y, 0], total[CENTRE_Y, 1], total[CENTRE_Y, 2] = -gy0, -gy1, -gy2
        by_spread[0, 0], by_spread[0, 1], by_spread[0, 2] = h0, h1, h2
        by_spread[1, 0] = arm_xx * p_xx + (arm_yx + turn) * p_xy - pgx0
        by_spread[1, 1] = arm_xx * p_xy + (arm_yx + turn) * p_yy - pgx1
        by_spread[1, 2] = arm_xx * p_xz + (arm_yx + turn) * p_yz - pgx2
        by_spread[2, 0] = arm_yy * p_xy + (arm_yx - turn) * p_xx - pgy0
        by_spread[2, 1] = arm_yy * p_yy + (arm_yx - turn) * p_xy - pgy1
        by_spread[2, 2] = arm_yy * p_yz + (arm_yx - turn) * p_xz - pgy2
        by_spread[3, 0] = arm_yy * q_xy + (arm_yx - turn) * q_xx - qgy0
        by_spread[3, 1] = arm_yy * q_yy + (arm_yx - turn) * q_xy - qgy1
        by_spread[3, 2] = arm_yy * q_yz + (arm_yx - turn) * q_xz - qgy2
        for axis in range(3):
            by_spread[4, axis] = turn / spread[4] * by_load[3, axis]
        for j in range(3):
            for axis in range(3):
                value = -2.0 * parameters[ROOT_XX + j] * scale_turn * turn * by_load[3, axis]
                for k in range(3):
                    value += radial * arm_slope[j, k] * by_arm[k, axis]
                for k in range(5):
                    value += chain[j, k] * by_spread[k, axis]
                total[ROOT_XX + j, axis] = value
        for axis in range(3):
            for number in range(3):
                total[FORCE + number, axis] = by_load[number, axis]
            total[TORQUE, axis] = spread[4] * scale_turn * by_load[3, axis]
            total[RADIAL_SHEAR, axis] = (
                unit_xx * by_arm[0, axis] + unit_yx * by_arm[1, axis] + unit_yy * by_arm[2, axis]
            )
        for axis in range(2):
            along_axis = markers.slope[m, axis]
            for number in range(PARAMETER_COUNT):
                slope[number, 2 * m + axis] = (
                    along_axis[0] * total[number, 0]
                    + along_axis[1] * total[number, 1]
                    + along_axis[2] * total[number, 2]
                )
    _add_sides(parameters, profile, pad, slope)


@kernel()
@no_type_check
def _add_sides(
    parameters: Float64[np.ndarray, "10"], profile: int, pad: PatchPad, slope: Float64[np.ndarray, "10 r"]
) -> None:
    """The part of the free sides in `fill_slopes`."""
    force = np.empty((PARAMETER_COUNT, 3, pad.by_sides.shape[1], pad.by_sides.shape[2]))
    fill_force_slopes(parameters, profile, pad.grid, force)
    low_x, high_x, low_y, high_y = _window(pad.grid, parameters)
    for axis in range(3):
        for i in range(low_x, high_x):
            for j in range(low_y, high_y):
                row = pad.by_sides[axis, i, j]
                for number in range(PARAMETER_COUNT):
                    factor = force[number, axis, i, j]
                    if factor != 0.0:
                        add_scaled(factor, row, slope[number])
