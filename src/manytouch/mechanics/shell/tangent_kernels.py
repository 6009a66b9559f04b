"""Products with the tangent of the shell, and copies of its parts, compiled.

A tangent is (nodes, 3, 3, 7, 8): tangent[p, i, j, a, b] = d force[p, i] / d coefficient[q, j], where node q
is a - 3 nodes further along the slow and b - 3 nodes further along the fast axis than p. The last of 8
numbers is padding.
"""

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from manytouch.compilation import kernel, no_type_check, u64

REACH = 3  # nodes that share an element are at most this far apart along each axis
ROW = 2 * REACH + 1
STRIP = 8  # numbers stored per row of 7 nodes; a power of 2 suits SIMD
BLOCK = 3 * ROW * STRIP  # numbers stored per component of a force

Coefficients = Float64[np.ndarray, "nodes 3"]
Tangent = Float[np.ndarray, "nodes 3 3 7 8"]


@kernel(fastmath=True)
@no_type_check
def clear_outside(shape: tuple[int, int], tangent: Tangent) -> None:
    """Set entries of nodes outside the grid to 0, which elements at the outline have."""
    for node in range(len(tangent)):
        s0, f0 = node // shape[1], node % shape[1]
        for a in range(ROW):
            for b in range(ROW):
                if not (0 <= s0 + a - REACH < shape[0] and 0 <= f0 + b - REACH < shape[1]):
                    for i in range(3):
                        for j in range(3):
                            tangent[node, i, j, a, b] = 0.0


@kernel(fastmath=True)
@no_type_check
def fix(is_free: Bool[np.ndarray, "nodes 3"], shape: tuple[int, int], tangent: Tangent) -> None:
    """Set rows and columns of fixed unknowns of the tangent to 0."""
    for node in range(len(is_free)):
        s0, f0 = node // shape[1], node % shape[1]
        for i in range(3):
            if is_free[node, i]:
                continue
            for j in range(3):
                tangent[node, i, j] = 0.0
            for a in range(ROW):
                s = s0 + a - REACH
                if not 0 <= s < shape[0]:
                    continue
                for b in range(ROW):
                    f = f0 + b - REACH
                    if 0 <= f < shape[1]:
                        other = s * shape[1] + f
                        for j in range(3):
                            tangent[other, j, i, ROW - 1 - a, ROW - 1 - b] = 0.0


@kernel(fastmath=True)
@no_type_check
def products(
    tangent: Tangent,
    shape: tuple[int, int],
    vectors: Float64[np.ndarray, "k nodes 3"],
    results: Float64[np.ndarray, "k nodes 3"],
) -> None:
    """Tangent times k vectors, into `results`; entries of nodes outside the grid must be 0.

    What is near a node is copied, so that each component is one scalar product of arrays without gaps.
    """
    count, nodes = vectors.shape[:2]
    width = shape[1] + STRIP
    size = (shape[0] + 2 * REACH) * width
    padded = np.zeros((count, 3 * size))  # x, y and z apart, with nodes around the grid
    for k in range(count):
        for node in range(nodes):
            at = (node // shape[1] + REACH) * width + node % shape[1] + REACH
            for j in range(3):
                padded[k, j * size + at] = vectors[k, node, j]
    entries, near = tangent.ravel(), np.empty(BLOCK)
    for node in range(nodes):
        first, begin = node // shape[1] * width + node % shape[1], u64(3 * node * BLOCK)
        for k in range(count):
            vector = padded[k]
            for j in range(3):
                for a in range(ROW):
                    to, at = u64((j * ROW + a) * STRIP), u64(j * size + first + a * width)
                    for b in range(STRIP):
                        near[to + u64(b)] = vector[at + u64(b)]
            x = y = z = 0.0
            for n in range(BLOCK):
                value = near[u64(n)]
                x += entries[begin + u64(n)] * value
                y += entries[begin + u64(BLOCK + n)] * value
                z += entries[begin + u64(2 * BLOCK + n)] * value
            results[k, node, 0], results[k, node, 1], results[k, node, 2] = x, y, z


@kernel(fastmath=True)
@no_type_check
def row_sums(
    tangent: Tangent,
    shape: tuple[int, int],
    share: Float64[np.ndarray, "k nodes"],
    component: Int64[np.ndarray, " k"],
    results: Float64[np.ndarray, "k nodes 3"],
) -> None:
    """Sums over nodes of shares times the tangent's rows of one component, into `results`."""
    count, nodes = share.shape
    apart = np.empty((3, nodes))  # x, y and z apart
    for k in range(count):
        apart[:] = 0.0
        for node in range(nodes):
            factor = share[k, node]
            if factor == 0.0:
                continue
            s0, f0 = node // shape[1], node % shape[1]
            low, high = max(REACH - f0, 0), min(ROW, shape[1] - f0 + REACH)
            for j in range(3):
                for a in range(max(REACH - s0, 0), min(ROW, shape[0] - s0 + REACH)):
                    start = node + (a - REACH) * shape[1] - REACH
                    row = tangent[node, component[k], j, a]
                    for b in range(low, high):
                        apart[j, start + b] += factor * row[b]
        for node in range(nodes):
            for j in range(3):
                results[k, node, j] = apart[j, node]


@kernel()
@no_type_check
def copy_to_band(
    tangent: Tangent,
    shape: tuple[int, int],
    is_free: Bool[np.ndarray, "nodes 3"],
    band: Float[np.ndarray, "n band"],
) -> None:
    """A tangent as a band: row p gets K[p, p], K[p, p + 1], ...; the diagonal of fixed unknowns gets 1."""
    for node in range(len(is_free)):
        s0, f0 = node // shape[1], node % shape[1]
        for i in range(3):
            p = 3 * node + i
            if not is_free[node, i]:
                band[p, 0] = 1.0
                continue
            for a in range(REACH, min(ROW, shape[0] - s0 + REACH)):
                start = 3 * ((s0 + a - REACH) * shape[1] + f0 - REACH)
                for b in range(max(REACH - f0, 0), min(ROW, shape[1] - f0 + REACH)):
                    for j in range(3):
                        q = start + 3 * b + j
                        if q >= p:
                            band[p, q - p] = tangent[node, i, j, a, b]
