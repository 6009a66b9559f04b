"""How long the mechanics of one Gauss-Newton step takes, kernel by kernel, for the demo sensor's 600 dots.

Run with OMP_NUM_THREADS=1: `python benchmarks/bench_mechanics.py [--elements 30 20] [--repeats 60]`.
Times are those of the thread, so that other programs count little: the least, and the median.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Dots
from manytouch.mechanics.shell.shell import THICK_BENDING, Shell
from manytouch.mechanics.solver import band_kernels
from manytouch.mechanics.solver.band import factorised
from manytouch.mechanics.solver.normal_equations import NormalEquations
from manytouch.simulation.demo_sensor import demo_sensor


def times_ms(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    work()
    taken = []
    for _ in range(repeats):
        begin = time.thread_time()
        work()
        taken.append(1e3 * (time.thread_time() - begin))
    return min(taken), float(np.median(taken))


def problem(elements: tuple[int, int]) -> tuple[NormalEquations, np.ndarray]:
    """The demo sensor and a press of 8 mm."""
    sensor = demo_sensor()
    assert sensor.layout is not None
    patch = SplinePatch(size_mm=(120.0, 80.0), elements=elements)
    shell = Shell(patch=patch, thickness_mm=3.0, pretension_over_E_mm=0.129, bending_factor=THICK_BENDING)
    dots = Dots(
        shell=shell,
        camera=sensor.camera,
        rest_mm=sensor.layout.rest_mm,
        radius_mm=sensor.layout.radius_mm,
    )
    bump = np.exp(-((patch.place_mm - np.array([10.0, 5.0])) ** 2).sum(axis=1) / 150.0)
    return NormalEquations(shell=shell, dots=dots), np.outer(bump, [0.5, 0.0, -8.0]) * patch.is_free


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--elements", type=int, nargs=2, default=(30, 20), metavar=("X", "Y"))
    parser.add_argument("--repeats", type=int, default=60)
    asked = parser.parse_args()
    normal, bent_mm = problem((asked.elements[0], asked.elements[1]))
    shell, dots, patch = normal.shell, normal.dots, normal.shell.patch
    assert normal.precision is not None
    force, tangent = np.empty_like(bent_mm), shell.empty_tangent(normal.precision)
    rng = np.random.default_rng(0)
    residual = rng.normal(scale=0.05, size=(len(dots.rest_mm), 2))
    information = np.tile(np.eye(2) / 0.045**2, (len(residual), 1, 1))
    weight = np.column_stack([np.full((patch.node_count, 2), 2.5e5), rng.uniform(1.0, 1e6, patch.node_count)])
    normal.linearise(bent_mm)
    normal.step(residual, information, weight)
    flat, front, width = normal._flat, normal._front, normal._width
    gradient = np.zeros(3 * patch.node_count)
    normal._assemble(residual, information, weight, 0.0)
    matrix = flat.copy()

    def cholesky() -> None:
        flat[:] = matrix
        assert factorised(flat, front=front, unknowns=gradient.size, width=width) is not None

    def balance() -> None:
        band_kernels.add_forces(
            normal._tangent, normal._force, normal._slope, normal._first, normal._table_x, normal._table_y,
            weight, patch.shape, patch.is_free, front, width, flat, gradient,
        )  # fmt: skip

    right = rng.normal(size=(1, *bent_mm.shape))
    many = right.repeat(30, axis=0)
    node, row = dots.face.basis.node, dots.face.derivative(bent_mm)[:, 2]
    print(
        f"{patch.elements} elements, {gradient.size} unknowns, half-band {width}, {normal.precision.__name__}"
    )
    for name, work in (
        ("forces", lambda: shell.forces(bent_mm)),
        ("forces and tangent", lambda: shell.forces_and_tangent(bent_mm, force, tangent)),
        ("dots' centroids", lambda: dots.displacement_px(bent_mm)),
        ("dots' derivative", lambda: dots.derivative_px(bent_mm)),
        ("R^T D R", balance),
        ("Cholesky (and a copy)", cholesky),
        ("linearise", lambda: normal.linearise(bent_mm)),
        ("step", lambda: normal.step(residual, information, weight)),
        ("change of the forces", lambda: normal.force_change(bent_mm)),
        ("solve", lambda: normal.solve(right)),
        ("covariance of 30", lambda: normal.covariance(many)),
        ("variances at all dots", lambda: normal.variances(node, row)),
    ):
        least, median = times_ms(work, asked.repeats if "variances" not in name else 3)
        print(f"{name:<24}{least:8.2f}{median:8.2f} ms")


if __name__ == "__main__":
    main()
