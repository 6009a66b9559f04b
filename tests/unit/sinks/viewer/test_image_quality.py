"""Quality of the camera image."""

import cv2
import numpy as np
import pytest

from manytouch.sinks.viewer.image_quality import BLACK_LEVEL, INTERVAL_S, WHITE_LEVEL, ImageQuality


def noisy(seed: int, shape: tuple[int, ...] = (90, 131)) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


@pytest.mark.parametrize("shape", [(90, 131), (96, 128), (90, 131, 3)])
def test_level_and_clipped_share_are_those_of_every_fourth_pixel(shape: tuple[int, ...]) -> None:
    image = noisy(1, shape)
    few = (image if image.ndim == 2 else image[..., 1])[::4, ::4]
    found = ImageQuality()(image)
    assert found["level"] == float(np.median(few)) / 255.0
    assert found["clipped"] == np.mean((few <= BLACK_LEVEL) | (few >= WHITE_LEVEL))
    assert found["clipped"] > 0.0


def test_an_image_of_a_12_bit_camera_has_the_quality_of_its_8_bits() -> None:
    image = noisy(3, (90, 131, 3))
    deep, quality = np.rint(image * (4095 / 255)).astype(np.uint16), ImageQuality()
    assert quality(deep) == ImageQuality()(image)
    assert quality(deep // 8)["level"] == pytest.approx(quality(deep)["level"] / 8, rel=0.1)


def test_focus_is_relative_to_the_sharpest_image() -> None:
    quality, sharp = ImageQuality(), noisy(2)
    soft = cv2.GaussianBlur(sharp, (0, 0), 1.5)
    assert quality(sharp)["focus"] == 1.0
    ratio = []
    for image in (soft, sharp):
        middle = np.ascontiguousarray(image[22:68:2, 32:99:2])
        ratio.append(cv2.Laplacian(middle, cv2.CV_64F).var() / middle.var())
    assert quality(soft)["focus"] == pytest.approx(ratio[0] / ratio[1], rel=1e-5)
    assert quality(np.full((90, 131), 7, dtype=np.uint8))["focus"] == 0.0


def test_the_quality_is_measured_in_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 50.0
    monkeypatch.setattr("manytouch.sinks.viewer.image_quality.time.monotonic", lambda: now_s)
    quality, dark, bright = ImageQuality(), np.zeros((90, 131), np.uint8), np.full((90, 131), 255, np.uint8)
    assert quality.latest(dark)["level"] == 0.0
    now_s += 0.5 * INTERVAL_S
    assert quality.latest(bright)["level"] == 0.0
    now_s += INTERVAL_S
    assert quality.latest(bright)["level"] == 1.0
