"""Poses of several cameras on one sheet from its untouched state."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch import Sensor, simulate_contacts
from manytouch.calibration.views import calibrate_views, describe_views, with_provenance_of_views
from manytouch.errors import LayoutError, SensorError
from manytouch.simulation.demo_sensor import skin_sensor
from manytouch.values import Frame
from manytouch.values.arrays import read_only
from manytouch.values.sensor import camera_of_views

ABSENT = 20 * 60 // 2 + 3  # a marker of the left view
OFF_MM = {"left": (1.0, -0.8, 1.5), "right": (-1.2, 0.5, -1.0)}


@pytest.fixture(scope="module")
def true() -> Sensor:
    sensor = skin_sensor(640)
    layout = sensor.layout
    assert layout is not None
    is_missing = layout.is_missing.copy()
    is_missing[ABSENT] = True
    return replace(sensor, layout=replace(layout, is_missing=read_only(is_missing)))


@pytest.fixture(scope="module")
def frames(true: Sensor) -> list[Frame]:
    """At rest; the right picture is noisier than the left one."""
    chance, found = np.random.default_rng(0), []
    for number, image in enumerate(simulate_contacts(true, [[]] * 5, output="image")):
        noisy = image.astype(np.float64)
        noisy[:, 640:] += chance.normal(0.0, 4.0, noisy[:, 640:].shape)
        rounded = read_only(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
        found.append(Frame(index=number, timestamp_ns=number * 33_000_000, camera="c", image=rounded))
    return found


def wrong(true: Sensor) -> Sensor:
    """The sensor as somebody measured it: each camera off by a quarter of a pitch, no marker missing."""
    cameras = {
        view.name: replace(
            view.camera, translation_mm=read_only(view.camera.translation_mm + OFF_MM[view.name])
        )
        for view in true.camera.views
    }
    layout = true.layout
    assert layout is not None
    layout = replace(layout, is_missing=read_only(np.zeros_like(layout.is_missing)))
    return replace(true, camera=camera_of_views(cameras), layout=layout)


def test_poses_of_all_views_and_missing_markers_are_found(true: Sensor, frames: list[Frame]) -> None:
    calibration = calibrate_views(wrong(true), frames)
    found = calibration.sensor
    assert [view.name for view in found.camera.views] == ["left", "right"]
    for view, expected in zip(found.camera.views, true.camera.views, strict=True):
        assert view.roi_px == expected.roi_px
        assert view.camera.translation_mm == pytest.approx(expected.camera.translation_mm, abs=0.1)
        assert view.camera.rotation_vector == pytest.approx(np.zeros(3), abs=2e-3)
    assert found.layout is not None
    assert np.flatnonzero(found.layout.is_missing).tolist() == [ABSENT]
    lines = list(describe_views(calibration))
    assert sum(line.startswith("view right: distance of the sheet 116.") for line in lines) == 1
    provenance = with_provenance_of_views(calibration, "a.mp4, b.mp4").provenance
    assert provenance["rest"] == "calibrated from 5 frames of a.mp4, b.mp4"
    assert np.all(np.array(provenance["rest_rms_px"]) < 0.1)
    left_px, right_px = (view.noise_px for view in calibration.views.values())
    assert right_px > 1.2 * left_px  # of the noisier picture
    assert found.centre_noise_px == pytest.approx(0.5 * (left_px + right_px))  # the median of two


def test_a_view_that_shows_no_markers_is_named(true: Sensor, frames: list[Frame]) -> None:
    dark = []
    for frame in frames:
        assert frame.image is not None
        image = frame.image.copy()
        image[:, 640:] = 10
        dark.append(replace(frame, image=read_only(image)))
    with pytest.raises(LayoutError, match="view 'right'"):
        calibrate_views(true, dark)
    with pytest.raises(SensorError, match=r"no \[markers\]"):
        calibrate_views(replace(true, layout=None), frames)
