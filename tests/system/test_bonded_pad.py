"""From pictures of a simulated pad behind its window to forces, against the 3-D solid."""

import numpy as np
import pytest

from manytouch.session import pipeline_for
from manytouch.session.prepare import prepare
from manytouch.sources.simulated import simulated_source

FAINT_N = 0.03


@pytest.mark.parametrize(("fps", "least"), [(15.0, 30), pytest.param(None, 60, marks=pytest.mark.slow)])
def test_contacts_on_a_pad_have_the_force_place_and_shear_of_the_solid(fps: float | None, least: int) -> None:
    source = simulated_source("pad", fps=fps)
    job = prepare(source)
    assert job.method == "mechanics"
    force, stds, place_mm, shear, depth_stds = [], [], [], [], []
    touches = false = 0
    for reading in pipeline_for("mechanics").run(source, job.sensor):
        truth = source.truth(reading.frame.index)
        assert truth is not None
        true = [each for each in truth.contacts.touching if each.force_N[2] < -FAINT_N]
        touches += len(true)
        for found in reading.contacts.touching:
            near = [each for each in true if np.linalg.norm(each.centre_mm - found.centre_mm) < 1.5]
            if not near:
                false += -found.force_N[2] > 3.0 * FAINT_N
                continue
            press_N = -near[0].force_N[2]
            force.append(-found.force_N[2] / press_N - 1.0)
            stds.append((-found.force_N[2] - press_N) / found.std("normal_force"))
            place_mm.append(np.linalg.norm(found.centre_mm - near[0].centre_mm))
            shear.append(np.linalg.norm(found.force_N[:2] - near[0].force_N[:2]) / press_N)
            depth_stds.append((found.depth_mm - near[0].depth_mm) / found.std("depth"))
    assert touches > least
    assert len(force) > 0.95 * touches
    assert false == 0
    assert np.median(np.abs(force)) < 0.06
    assert np.percentile(np.abs(force), 95) < 0.18
    assert np.max(np.abs(force)) < 0.3  # also where a contact begins
    assert np.mean(np.abs(stds) < 2.0) > 0.95
    assert np.median(place_mm) < 0.15
    assert np.median(shear) < 0.03
    assert np.mean(np.abs(depth_stds) < 2.0) > 0.9
