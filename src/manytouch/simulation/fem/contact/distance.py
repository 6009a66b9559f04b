"""Signed distances of the indenters' shapes, compiled: value, gradient and second derivatives.

Each shape stands on the origin of its own frame and extends to +z: its lowest point is (0, 0, 0).
Distances are negative inside, gradients point out of the body.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math

import numpy as np

from manytouch.compilation import kernel, no_type_check

SPHERE, ELLIPSOID, REVOLVED, BOX, HALF_SPACES, TORUS = range(6)


@kernel()
@no_type_check
def signed_distance(
    kind: int, numbers: np.ndarray, point: np.ndarray, normal: np.ndarray, curvature: np.ndarray
) -> float:
    """Signed distance in mm of a point (3,) in the indenter's frame.

    Args:
        kind: SPHERE, ELLIPSOID, REVOLVED, BOX, HALF_SPACES or TORUS.
        numbers: parameters of the shape, as its own function lists them; longer arrays are allowed.
        point: (3,) mm.
        normal: (3,), filled with the gradient.
        curvature: (3, 3), filled with the Hessian, 1 / mm.
    """
    curvature[:] = 0.0
    if kind == SPHERE:
        return _sphere(numbers[0], point, normal, curvature)
    if kind == ELLIPSOID:
        return _ellipsoid(numbers, point, normal, curvature)
    if kind == REVOLVED:
        return _revolved(numbers, point, normal, curvature)
    if kind == BOX:
        return _box(numbers, point, normal, curvature)
    if kind == TORUS:
        return _torus(numbers, point, normal, curvature)
    return _half_spaces(numbers, point, normal, curvature)


@kernel()
@no_type_check
def _sphere(radius: float, point: np.ndarray, normal: np.ndarray, curvature: np.ndarray) -> float:
    x, y, z = point[0], point[1], point[2] - radius
    distance = math.sqrt(x * x + y * y + z * z)
    if distance < 1e-12:
        normal[:] = np.array([0.0, 0.0, -1.0])
        return -radius
    normal[0], normal[1], normal[2] = x / distance, y / distance, z / distance
    for i in range(3):
        for j in range(3):
            curvature[i, j] = ((1.0 if i == j else 0.0) - normal[i] * normal[j]) / distance
    return float(distance - radius)


@kernel()
@no_type_check
def _ellipsoid(numbers: np.ndarray, point: np.ndarray, normal: np.ndarray, curvature: np.ndarray) -> float:
    """Closest point r^2 x / (t + r^2) with F(t) = sum (r x / (t + r^2))^2 - 1 = 0, convex and falling."""
    square = np.array([numbers[0] ** 2, numbers[1] ** 2, numbers[2] ** 2])
    x = np.array([point[0], point[1], point[2] - numbers[2]])
    least = square.min()
    start = -least * (1.0 - 1e-6)
    for i in range(3):
        start = max(start, math.sqrt(square[i]) * abs(x[i]) - square[i])  # one term alone is 1 there
    t = start
    for _ in range(60):
        value, slope = -1.0, 0.0
        for i in range(3):
            term = square[i] * x[i] ** 2 / (t + square[i]) ** 2
            value += term
            slope -= 2.0 * term / (t + square[i])
        if slope == 0.0 or value <= 1e-14:
            break
        t -= value / slope
    foot = square * x / (t + square)
    slope3 = foot / square
    size = math.sqrt((slope3**2).sum())
    if size < 1e-12:
        normal[:] = np.array([0.0, 0.0, -1.0])
        return float(-math.sqrt(least))
    normal[:] = slope3 / size
    distance = float(((x - foot) * normal).sum())
    _offset_curvature(1.0 / square / size, normal, distance, curvature)
    return distance


@kernel()
@no_type_check
def _offset_curvature(second: np.ndarray, normal: np.ndarray, distance: float, curvature: np.ndarray) -> None:
    """Hessian of the distance: S (1 + d S)^-1 with the surface's shape operator S = P diag(second) P."""
    axis = int(np.argmin(np.abs(normal)))
    first = np.zeros(3)
    first[axis] = 1.0
    first -= normal[axis] * normal
    first /= math.sqrt((first**2).sum())
    other = np.cross(normal, first)
    a, b, c = (first * second * first).sum(), (first * second * other).sum(), (other * second * other).sum()
    largest = 0.5 * (a + c) + math.sqrt(0.25 * (a - c) ** 2 + b * b)
    d = max(distance, -0.5 / largest)  # only a bad iterate is nearer to the centre of curvature
    aa, cc = 1.0 + d * a, 1.0 + d * c
    determinant = aa * cc - d * d * b * b
    h11, h22, h12 = (
        (a + d * (a * c - b * b)) / determinant,
        (c + d * (a * c - b * b)) / determinant,
        b / determinant,
    )
    for i in range(3):
        for j in range(3):
            curvature[i, j] = (
                h11 * first[i] * first[j]
                + h22 * other[i] * other[j]
                + h12 * (first[i] * other[j] + other[i] * first[j])
            )


@kernel()
@no_type_check
def _revolved(numbers: np.ndarray, point: np.ndarray, normal: np.ndarray, curvature: np.ndarray) -> float:
    """A cylinder: radius, half length, edge radius, axis (0: x, 2: z), height of its centre."""
    radius, half, edge, height = numbers[0], numbers[1], numbers[2], numbers[4]
    axis = int(numbers[3])
    i, j = (axis + 1) % 3, (axis + 2) % 3
    x = np.array([point[0], point[1], point[2] - height])
    along = x[axis]
    radial = max(math.sqrt(x[i] ** 2 + x[j] ** 2), 1e-12)
    p, q = radial - (radius - edge), abs(along) - (half - edge)
    sign = 1.0 if along >= 0.0 else -1.0
    ri, rj = x[i] / radial, x[j] / radial
    normal[:] = 0.0
    if p <= 0.0 or q <= 0.0:  # the side or an end is nearest
        if p > q:
            normal[i], normal[j] = ri, rj
            _add_outer(curvature, 1.0 / radial, -rj, ri, i, j)
            return float(p - edge)
        normal[axis] = sign
        return float(q - edge)
    size = math.sqrt(p * p + q * q)
    cosine, sine = p / size, sign * q / size
    normal[i], normal[j], normal[axis] = cosine * ri, cosine * rj, sine
    _add_outer(curvature, cosine / radial, -rj, ri, i, j)
    turned = np.zeros(3)
    turned[i], turned[j], turned[axis] = -sine * ri, -sine * rj, cosine
    for k in range(3):
        for m in range(3):
            curvature[k, m] += turned[k] * turned[m] / size
    return float(size - edge)


@kernel()
@no_type_check
def _torus(numbers: np.ndarray, point: np.ndarray, normal: np.ndarray, curvature: np.ndarray) -> float:
    """A lying ring: radius of its centre line, radius of its wire."""
    x, y, q = point[0], point[1], point[2] - numbers[1]
    radial = max(math.sqrt(x * x + y * y), 1e-12)
    p = radial - numbers[0]
    size = max(math.sqrt(p * p + q * q), 1e-12)
    cosine, sine, rx, ry = p / size, q / size, x / radial, y / radial
    normal[0], normal[1], normal[2] = cosine * rx, cosine * ry, sine
    _add_outer(curvature, cosine / radial, -ry, rx, 0, 1)
    turned = np.array([-sine * rx, -sine * ry, cosine])
    for k in range(3):
        for m in range(3):
            curvature[k, m] += turned[k] * turned[m] / size
    return float(size - numbers[1])


@kernel()
@no_type_check
def _add_outer(curvature: np.ndarray, factor: float, u: float, v: float, i: int, j: int) -> None:
    curvature[i, i] += factor * u * u
    curvature[i, j] += factor * u * v
    curvature[j, i] += factor * u * v
    curvature[j, j] += factor * v * v


@kernel()
@no_type_check
def _box(numbers: np.ndarray, point: np.ndarray, normal: np.ndarray, curvature: np.ndarray) -> float:
    """A block with rounded edges: half lengths (3) and edge radius."""
    edge = numbers[3]
    excess, sign = np.empty(3), np.empty(3)
    for i in range(3):
        x = point[i] - (numbers[2] if i == 2 else 0.0)
        sign[i] = 1.0 if x >= 0.0 else -1.0
        excess[i] = abs(x) - (numbers[i] - edge)
    size = math.sqrt((np.maximum(excess, 0.0) ** 2).sum())
    normal[:] = 0.0
    if size == 0.0:
        nearest = int(np.argmax(excess))
        normal[nearest] = sign[nearest]
        return float(excess[nearest] - edge)
    for i in range(3):
        normal[i] = sign[i] * max(excess[i], 0.0) / size
    for i in range(3):
        for j in range(3):
            if excess[i] > 0.0 and excess[j] > 0.0:
                curvature[i, j] = ((1.0 if i == j else 0.0) - normal[i] * normal[j]) / size
    return float(size - edge)


@kernel()
@no_type_check
def _half_spaces(numbers: np.ndarray, point: np.ndarray, normal: np.ndarray, curvature: np.ndarray) -> float:
    """log sum exp(s (n.x - d)) / s over faces: smooth, convex, and their maximum except near edges."""
    sharpness, faces = numbers[0], int(numbers[1])
    largest = -np.inf
    for face in range(faces):
        at = 2 + 4 * face
        largest = max(
            largest,
            numbers[at] * point[0]
            + numbers[at + 1] * point[1]
            + numbers[at + 2] * point[2]
            - numbers[at + 3],
        )
    total = 0.0
    normal[:] = 0.0
    for face in range(faces):
        at = 2 + 4 * face
        value = (
            numbers[at] * point[0] + numbers[at + 1] * point[1] + numbers[at + 2] * point[2] - numbers[at + 3]
        )
        share = math.exp(sharpness * (value - largest))
        total += share
        for i in range(3):
            normal[i] += share * numbers[at + i]
            for j in range(3):
                curvature[i, j] += share * numbers[at + i] * numbers[at + j]
    for i in range(3):
        normal[i] /= total
    for i in range(3):
        for j in range(3):
            curvature[i, j] = sharpness * (curvature[i, j] / total - normal[i] * normal[j])
    return float(largest + math.log(total) / sharpness)
