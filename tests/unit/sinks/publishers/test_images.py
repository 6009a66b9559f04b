"""Encoded images that several outputs send."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import pytest

from manytouch.sinks.publishers.images import encoded_image
from manytouch.values import Frame

IMAGE = np.random.default_rng(0).integers(0, 255, (60, 80), dtype=np.uint8)
FRAME = Frame(index=0, timestamp_ns=0, camera="a", image=IMAGE)


def test_outputs_that_send_the_same_frame_encode_it_once(monkeypatch: pytest.MonkeyPatch) -> None:
    encode, calls = cv2.imencode, []
    monkeypatch.setattr(cv2, "imencode", lambda *arguments: calls.append(1) or encode(*arguments))
    frames = [replace(FRAME, index=number) for number in range(3)]
    with ThreadPoolExecutor(4) as pool:
        for frame in frames:
            sent = list(pool.map(encoded_image, [frame] * 4))
            assert len({id(data) for data, _ in sent}) == 1
    assert len(calls) == 3
    decoded = cv2.imdecode(np.frombuffer(sent[0][0], np.uint8), cv2.IMREAD_UNCHANGED)
    assert np.abs(decoded.astype(float) - IMAGE).mean() < 10.0


def test_what_the_camera_sent_is_sent_as_it_is() -> None:
    assert encoded_image(replace(FRAME, encoded=b"\x89PNG...")) == (b"\x89PNG...", "png")
    assert encoded_image(replace(FRAME, encoded=b"\xff\xd8...")) == (b"\xff\xd8...", "jpeg")
    assert encoded_image(replace(FRAME, image=None)) == (b"", "jpeg")


def test_deep_images_are_sent_with_8_bits() -> None:
    deep = replace(FRAME, image=IMAGE.astype(np.uint16) << 8)
    assert encoded_image(deep) == encoded_image(FRAME)
