"""Format of the binary messages."""

import json

import numpy as np
import pytest

from manytouch.sinks.viewer.update_format import number, pack, unpack


def test_messages_round_trip() -> None:
    depth = np.arange(15, dtype="<f4").reshape(3, 5)
    depth[1, 2] = np.nan
    message = pack({"kind": "reading", "name": "µ"}, {"depth": depth, "image": b"\xff\xd8 jpeg"})
    head, parts = unpack(message)
    assert head["kind"] == "reading"
    assert head["name"] == "µ"
    np.testing.assert_array_equal(parts["depth"], depth)
    assert parts["image"] == b"\xff\xd8 jpeg"


@pytest.mark.parametrize("size", range(1, 9))
def test_every_part_is_aligned(size: int) -> None:
    message = pack({"x": "y" * size}, {"image": b"j" * size, "depth": np.ones(size, "<f4")})
    head_size = int.from_bytes(message[:4], "little")
    head = json.loads(message[4 : 4 + head_size])
    assert all((4 + head_size + part["at"]) % 4 == 0 for part in head["parts"])
    np.testing.assert_array_equal(unpack(message)[1]["depth"], np.ones(size))


def test_unknown_numbers_are_null() -> None:
    assert number(float("nan")) is None
    assert number(float("inf")) is None
    assert number(None) is None
    assert number(np.float64(1.234567)) == 1.2346
    with pytest.raises(ValueError, match="JSON"):
        pack({"x": float("nan")}, {})
