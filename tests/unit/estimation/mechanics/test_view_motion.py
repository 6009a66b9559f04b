"""Motion of the image, from displacements that are known."""

import numpy as np
import pytest

from manytouch.estimation.mechanics.view_motion import ViewMotion

SIDE_PX = np.linspace(-300.0, 300.0, 9)
REST_PX = np.stack(np.meshgrid(SIDE_PX + 400.0, SIDE_PX + 350.0), axis=-1).reshape(-1, 2)
ARM_PX = REST_PX - REST_PX.mean(axis=0)
IS_RIM = np.abs(ARM_PX).max(axis=1) > 280.0
PRESS_PX = 4.0 * ARM_PX / 300.0 * np.exp(-np.square((ARM_PX - [60.0, -90.0]) / 200.0).sum(axis=1))[:, None]
"""Displacements by a press, which are largely a scale."""
MOTION_PX = [0.3, -0.2] + 1e-3 * ARM_PX + 5e-4 * np.column_stack([-ARM_PX[:, 1], ARM_PX[:, 0]])


@pytest.mark.parametrize("press", [0.0, 0.3, 1.0, 1.4])
@pytest.mark.parametrize("before", [0.0, 1.0])
@pytest.mark.parametrize("motion", [0.0, 1.0])
def test_a_press_that_changes_is_no_motion(press: float, before: float, motion: float) -> None:
    if before == 0.0:
        press = 0.0  # nothing shows yet how a new press moves the markers
    moved_px = press * PRESS_PX + motion * MOTION_PX
    found_px = ViewMotion()(REST_PX, moved_px, before * PRESS_PX, IS_RIM)
    np.testing.assert_allclose(found_px, motion * MOTION_PX, atol=1e-6)


def test_few_markers_at_the_clamp_show_no_motion() -> None:
    is_used = IS_RIM & (np.cumsum(IS_RIM) <= 11)
    assert not ViewMotion()(REST_PX, MOTION_PX, np.zeros_like(REST_PX), is_used).any()
