"""The camera image in the messages of the viewer."""

from dataclasses import replace

import cv2
import numpy as np

from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.viewer.update_encoder import UpdateEncoder, ViewerUpdate
from manytouch.sinks.viewer.update_format import unpack
from viewer_session import reading_of


def median_shown(encode: UpdateEncoder, image: np.ndarray) -> float:
    """Median grey level of the image that clients get."""
    reading = reading_of(0)
    shown = replace(reading, frame=replace(reading.frame, image=image))
    update = ViewerUpdate(reading=shown, comparison=None, layers=set(), is_image_wanted=True)
    _, parts = unpack(encode(update, 0)[0])
    picture = cv2.imdecode(np.frombuffer(parts["image"], np.uint8), cv2.IMREAD_GRAYSCALE)
    return float(np.median(picture))


def test_images_of_a_12_bit_camera_are_as_bright_as_those_of_8_bits() -> None:
    """Also a dark one, whose levels 10 bits would contain."""
    bright = np.full((180, 320), 100, dtype=np.uint8)
    bright[40:80, 40:80] = 220
    encode = UpdateEncoder(demo_sensor(320))
    for image, expected in ((bright, 100.0), (bright // 4, 25.0)):
        deep = np.rint(image * (4095 / 255)).astype(np.uint16)
        assert abs(median_shown(encode, deep) - expected) <= 1.0
