"""Encoded images that several outputs send."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import pytest

from manytouch.errors import ManytouchError
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.images import ImageTurns, encoded_image
from manytouch.values import Frame

IMAGE = np.random.default_rng(0).integers(0, 256, (60, 80), dtype=np.uint8)
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


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_deep_images_are_sent_with_8_bits(bits: int) -> None:
    turns = ImageTurns(parse_address("foxglove://:1"))
    for image in (IMAGE, IMAGE // 8):
        deep = np.rint(image * ((2**bits - 1) / 255)).astype(np.uint16)
        assert turns.encoded(replace(FRAME, image=deep)) == encoded_image(replace(FRAME, image=image))


def test_images_that_must_be_encoded_are_sent_at_the_rate_of_the_address_and_to_all_outputs_the_same() -> (
    None
):
    frames = [
        replace(FRAME, index=number, timestamp_ns=round((number + 0.5) * 1e9 / 60)) for number in range(120)
    ]
    late = ImageTurns(parse_address("foxglove://:1?images=6"))
    turns = ImageTurns(parse_address("ros2://a?images=6"))
    sent = [frame.index for frame in frames if turns.take(frame)]
    assert len(sent) == 12
    sent_late = [frame.index for frame in frames[55:] if late.take(frame)]
    assert sent_late == [55, *(index for index in sent if index > 55)]
    assert all(turns.take(replace(frame, encoded=b"jpeg")) for frame in frames)
    assert not turns.take(replace(FRAME, image=None))
    assert turns.take(FRAME)  # a recording that is played again


def test_a_rate_of_images_that_is_none_is_refused() -> None:
    with pytest.raises(ManytouchError, match=r"images is '0'; give a number from 0.1 to 1000"):
        ImageTurns(parse_address("ros2://a?images=0"))
