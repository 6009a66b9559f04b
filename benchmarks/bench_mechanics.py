"""How long the mechanics of one Gauss-Newton step takes, kernel by kernel, for the demo sensor's 600 markers.

Run with OMP_NUM_THREADS=1: `python benchmarks/bench_mechanics.py [--elements 30 20] [--repeats 60]`.
Times are those of the thread, so that other programs count little: the least, and the median.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.banded.band import band_rows, factorise, new_band
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell.shell import Shell
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
    shell = Shell(patch=patch, thickness_mm=3.0, pretension_over_E_mm=0.129)
    dots = MarkerImages(
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
    given = parser.parse_args()
    normal, bent_mm = problem((given.elements[0], given.elements[1]))
    shell, dots, patch, precision = normal.shell, normal.dots, normal.shell.patch, normal.precision
    assert precision is not None
    force, tangent = np.empty_like(bent_mm), shell.empty_tangent(precision)
    rng = np.random.default_rng(0)
    residual = rng.normal(scale=0.05, size=(len(dots.rest_mm), 2))
    information = np.tile(np.eye(2) / 0.045**2, (len(residual), 1, 1))
    weight = np.column_stack([np.full((patch.node_count, 2), 2.5e5), rng.uniform(1.0, 1e6, patch.node_count)])
    here = normal.linearise(bent_mm)
    posterior = normal.solve(here, residual, information, weight)
    width = posterior.factor.lower.shape[1] - 1

    def cholesky() -> None:
        band = new_band(bent_mm.size, width, precision)
        band_rows(band)[:, 0] = 1.0
        assert factorise(band) is not None

    def covariance() -> None:
        white = posterior.whiten(many)
        white @ white.T

    right = rng.normal(size=(1, *bent_mm.shape))
    many = right.repeat(30, axis=0)
    node, row = dots.face.basis.node, dots.face.derivative(bent_mm)[:, 2]
    print(f"{patch.elements} elements, {bent_mm.size} unknowns, half-band {width}, {precision.__name__}")
    for name, work in (
        ("forces", lambda: shell.forces(bent_mm)),
        ("forces and tangent", lambda: shell.forces_and_tangent(bent_mm, force, tangent)),
        ("marker images", lambda: dots.displacement_px(bent_mm)),
        ("their derivative", lambda: dots.derivative_px(bent_mm)),
        ("Cholesky (and memory)", cholesky),
        ("linearise", lambda: normal.linearise(bent_mm)),
        ("solve", lambda: normal.solve(here, residual, information, weight)),
        ("change of the forces", lambda: here.force_change(bent_mm)),
        ("one right-hand side", lambda: posterior.solve(right)),
        ("covariance of 30", covariance),
        ("variances at all markers", lambda: posterior.variances(node, row)),
    ):
        least, median = times_ms(work, given.repeats if "variances" not in name else 3)
        print(f"{name:<24}{least:8.2f}{median:8.2f} ms")


if __name__ == "__main__":
    main()
