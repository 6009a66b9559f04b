"""Contact with balls against plain numpy: springs at the points of all cells."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.simulation.contacts.ball_kernels import POINTS, Balls, ball_contact_energy
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.shell.body_kernels import BodyLoads
from manytouch.simulation.shell.energy import ShellEnergy


def at_points(nodal: np.ndarray) -> np.ndarray:
    """(..., a', b') values at the points of all cells, bilinear between the nodes (..., a, b)."""
    share = (np.arange(POINTS) + 0.5) / POINTS
    for axis in (-2, -1):
        moved = np.moveaxis(nodal, axis, -1)
        between = moved[..., :-1, None] * (1.0 - share) + moved[..., 1:, None] * share
        nodal = np.moveaxis(between.reshape(*between.shape[:-2], -1), -1, axis)
    return nodal


@pytest.mark.parametrize("seed", range(3))
def test_forces_and_energy_are_those_of_springs_in_numpy(seed: int) -> None:
    sheet = demo_sensor().sheet
    assert sheet is not None
    shell = ShellEnergy(replace(sheet, size_mm=np.array([24.0, 16.0])), 2.0)
    chance = np.random.default_rng(seed)
    value = 0.05 * chance.normal(size=(5, *shell.shape))
    stretch = chance.uniform(0.9, 1.1, shell.shape)
    radius_mm, deep_mm = np.array([5.0, 2.5]), np.array([1.0, 0.7])
    place_mm = np.array([[-5.3, 1.1], [6.2, -2.9]]) + chance.uniform(-0.5, 0.5, (2, 2))
    balls = Balls(
        centre_mm=np.column_stack([place_mm, shell.half_mm - deep_mm + radius_mm]),
        radius_mm=radius_mm,
        stiffness_MPa_per_mm=np.array([1.5, 0.8]),
    )
    fibre = shell.fibres(value, stretch).copy()
    shell.buffers.by_fibre[:] = 0.0
    slope = np.zeros_like(value)
    count = tuple(POINTS * (nodes - 1) for nodes in shell.shape)
    body_at, normal_N = np.zeros(count, dtype=np.int64), np.zeros(count)
    loads = BodyLoads(resultant=np.zeros((2, 7)), body_at=body_at, normal_N=normal_N)
    energy = ball_contact_energy(value, shell.spacing_mm, shell.bed, balls, shell.buffers, slope, loads)

    x_mm, y_mm = np.meshgrid(shell.x_mm, shell.y_mm, indexing="ij")
    rest_mm = at_points(np.stack([x_mm, y_mm, np.zeros_like(x_mm)]))
    point_mm = rest_mm + at_points(value[:3] + shell.half_mm * fibre)
    weight_mm2, expected = float(np.prod(shell.spacing_mm)) / POINTS**2, 0.0
    for ball in range(2):
        away_mm = point_mm - balls.centre_mm[ball][:, None, None]
        distance_mm = np.linalg.norm(away_mm, axis=0)
        depth_mm = np.maximum(radius_mm[ball] - distance_mm, 0.0)
        stiffness = weight_mm2 * balls.stiffness_MPa_per_mm[ball]
        expected += 0.5 * stiffness * (depth_mm**2).sum()
        push_N = stiffness * depth_mm * away_mm / distance_mm
        found = loads.resultant[ball]
        assert found[2] < -1e-2
        np.testing.assert_allclose(found[:3], push_N.sum(axis=(1, 2)), rtol=1e-9)
        torque_Nmm = (point_mm[0] * push_N[1] - point_mm[1] * push_N[0]).sum()
        assert found[3] == pytest.approx(torque_Nmm, abs=1e-9)
        np.testing.assert_allclose(found[4:6], (rest_mm[:2] * push_N[2]).sum(axis=(1, 2)), rtol=1e-9)
        assert found[6] == pytest.approx(weight_mm2 * np.count_nonzero(depth_mm))
        np.testing.assert_array_equal(loads.body_at == ball, depth_mm > 0.0)
    assert energy == pytest.approx(expected)
    np.testing.assert_allclose(slope[:3].sum(axis=(1, 2)), -loads.resultant[:, :3].sum(axis=0), rtol=1e-9)
    np.testing.assert_allclose(shell.buffers.by_fibre, shell.half_mm * slope[:3], atol=1e-12)
    assert not slope[3:].any()
