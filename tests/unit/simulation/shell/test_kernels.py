"""The shell's kernel against the formulae of docs/derivations/live-sheet.md in numpy."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.shell.energy import ShellEnergy, shell_law


def reference_energy(shell: ShellEnergy, value: np.ndarray, stretch: np.ndarray) -> float:
    """Energy of both layers at the corners of all cells, and of the transverse shear of all edges, N mm."""
    law = shell_law(shell.sheet, shell.prestretch, float(np.prod(shell.spacing_mm)))
    tilt = np.stack([value[3], value[4], np.ones(shell.shape)])
    fibre = stretch * tilt / np.sqrt(1.0 + value[3] ** 2 + value[4] ** 2)
    tangent, bend, mean = [], [], []
    for axis in (0, 1):
        spacing = shell.spacing_mm[axis]
        tangent.append(np.diff(value[:3], axis=1 + axis) / spacing)
        tangent[axis][axis] += 1.0
        bend.append(law.lever_mm * np.diff(fibre, axis=1 + axis) / spacing)
    mean = [0.5 * (fibre[:, 1:] + fibre[:, :-1]), 0.5 * (fibre[:, :, 1:] + fibre[:, :, :-1])]
    energy = 0.0
    for axis in (0, 1):
        gamma = (tangent[axis] * mean[axis]).sum(axis=0)
        energy += 0.5 * law.shear_N_per_mm * law.cell_mm2 * (gamma**2).sum()
    weight, q = 0.25 * law.cell_mm2 * law.half_mm, law.exponent
    for sign in (-1.0, 1.0):
        along_x, along_y = (tangent[axis] + sign * bend[axis] for axis in (0, 1))
        for gx in (along_x[:, :, :-1], along_x[:, :, 1:]):
            for gy in (along_y[:, :-1], along_y[:, 1:]):
                cxx, cyy, cxy = (gx * gx).sum(axis=0), (gy * gy).sum(axis=0), (gx * gy).sum(axis=0)
                det = cxx * cyy - cxy**2
                density = law.first_MPa * (cxx + cyy - 2.0) + law.second_MPa * (det**-q - 1.0) / q
                energy += 0.5 * weight * density.sum()
    return float(energy)


@pytest.mark.parametrize("seed", range(3))
def test_the_elastic_energy_agrees_with_its_formula_in_numpy(seed: int) -> None:
    sheet = demo_sensor().sheet
    assert sheet is not None
    shell = ShellEnergy(replace(sheet, size_mm=np.array([24.0, 16.0])), 2.0)
    chance = np.random.default_rng(seed)
    value = 0.05 * chance.normal(size=(5, *shell.shape))
    stretch = chance.uniform(0.8, 1.1, shell.shape)
    assert shell.elastic(value, stretch)[0] == pytest.approx(
        reference_energy(shell, value, stretch), rel=1e-7
    )
