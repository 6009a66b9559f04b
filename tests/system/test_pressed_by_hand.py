"""The estimator on a sheet that is pressed interactively: two models of the same sheet agree."""

from collections.abc import Iterator

import numpy as np
import pytest

from manytouch.session import pipeline_for
from manytouch.sources.pressed.pressed_source import PressedSource
from manytouch.values import Frame, Press

FRAMES = 75


def dragged(source: PressedSource) -> Iterator[Frame]:
    """One finger goes round, another one joins it."""
    for frame in source:
        time_s = frame.index / source.fps
        place_mm = 25.0 * np.sin(1.2 * time_s), 12.0 * np.cos(1.2 * time_s)
        source.press(Press(finger=1, x_mm=place_mm[0], y_mm=place_mm[1], depth_mm=4.0))
        if time_s > 1.0:
            source.press(Press(finger=2, x_mm=-35.0, y_mm=-12.0, depth_mm=3.0))
        yield frame


@pytest.mark.slow
def test_mechanics_agrees_with_the_sheet_that_is_solved_live() -> None:
    source = PressedSource("rest", seconds=FRAMES / 30.0)
    depth_mm, place_mm, force = [], [], []
    touches = found = 0
    for reading in pipeline_for("mechanics").run(dragged(source), source.sensor):
        truth = source.truth(reading.frame.index)
        assert truth is not None
        assert reading.status == "ok"
        off_mm = reading.surface.displacement_mm - truth.surface.displacement_mm
        depth_mm.append(np.sqrt(np.mean(off_mm[:, 2] ** 2)))
        for contact in truth.contacts.touching:
            if contact.force_N[2] > -1.0:
                continue
            touches += 1
            near = [
                other
                for other in reading.contacts.touching
                if np.linalg.norm(other.centre_mm - contact.centre_mm) < 3.0
            ]
            for other in near[:1]:
                found += 1
                place_mm.append(np.linalg.norm(other.centre_mm - contact.centre_mm))
                force.append(abs(other.force_N[2] / contact.force_N[2] - 1.0))
    assert touches > 100
    assert found > 0.97 * touches
    assert np.median(depth_mm) < 0.015  # a linear plate in its place gave 0.045
    assert np.max(depth_mm) < 0.03
    assert np.median(place_mm) < 0.2  # 0.34
    assert np.median(force) < 0.05  # 0.165
