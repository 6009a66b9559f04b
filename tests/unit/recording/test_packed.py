"""Packed arrays: their precision, their size, and descriptions that do not fit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from manytouch.recording.compression import compressed, decompressed
from manytouch.recording.messages import encode_reading
from manytouch.recording.packed import PackedBlock, unpack
from manytouch.session import pipeline_for
from manytouch.sources.simulated import simulated_source

SHAPES = npst.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=5)
FLOATS = npst.arrays("float64", SHAPES, elements=st.floats(width=32))
OTHERS = npst.arrays("int64", SHAPES, elements=st.integers(-(2**31), 2**31 - 1)) | npst.arrays("bool", SHAPES)


@given(st.lists(FLOATS | OTHERS, max_size=4))
def test_arrays_come_back_in_single_precision(arrays: list[np.ndarray]) -> None:
    block = PackedBlock()
    described = [block.pack(array) for array in arrays]
    for array, each in zip(arrays, described, strict=True):
        again = unpack(each, bytes(block.content))
        assert again.dtype == array.dtype
        assert not again.flags.writeable
        np.testing.assert_array_equal(again, array)


@given(npst.arrays("float64", (3, 4, 4), elements=st.floats(-1e6, 1e6)))
def test_covariances_stay_symmetric_and_keep_9_bits(array: np.ndarray) -> None:
    symmetric = array + array.swapaxes(1, 2)
    symmetric[0, 0, 0] = np.nan
    block = PackedBlock()
    again = unpack(block.pack(symmetric, is_covariance=True), bytes(block.content))
    assert len(block.content) == 3 * 10 * 4
    np.testing.assert_array_equal(again, again.swapaxes(1, 2))
    np.testing.assert_allclose(again, symmetric, rtol=2.0**-9, atol=1e-37)
    general = PackedBlock()
    array[0, 0, 1] = array[0, 1, 0] + 1.0
    back = unpack(general.pack(array, is_covariance=True), bytes(general.content))
    np.testing.assert_allclose(back, array, rtol=2.0**-9, atol=1e-37)


@pytest.mark.parametrize(
    "change",
    [
        {"packed": "object"},
        {"shape": [10**12, 10**12]},
        {"shape": [-1]},
        {"shape": "600"},
        {"shape": [2.0]},
        {"at": -4},
        {"at": 10**9},
        {"at": "0"},
        {"symmetric": True},
    ],
)
def test_descriptions_that_do_not_fit_are_refused_before_allocation(change: dict[str, object]) -> None:
    block = PackedBlock()
    described = block.pack(np.arange(6.0).reshape(2, 3)) | change
    with pytest.raises((KeyError, TypeError, ValueError)):
        unpack(described, bytes(block.content))


@pytest.mark.parametrize("size", [-1, 0, 99, 101, 2**40])
def test_stated_sizes_are_checked_before_allocation(size: int) -> None:
    data = compressed(bytes(100))
    assert decompressed("zstd", data, 100) == bytes(100)
    with pytest.raises(ValueError, match=r"\d"):
        decompressed("zstd", data, size)


def test_damaged_compressed_data_are_refused() -> None:
    data = compressed(b"many touches " * 100)
    for wrong in (data[:-3], data[4:], b"", b"(\xb5/\xfd"):
        with pytest.raises(ValueError, match=r"size|damaged"):
            decompressed("zstd", wrong, 1300)


def test_a_reading_of_600_markers_takes_at_most_40_kB() -> None:
    from manytouch.recording.messages import surface_message

    simulator = simulated_source().lasting(3.0).simulator
    shown = (0, 1, *range(56, 61))  # at rest, and until there are two contacts
    frames = [replace(simulator.frame(place), index=index) for index, place in enumerate(shown)]
    *_, last = pipeline_for("mechanics").run(frames, simulator.sensor)
    assert last.grid.is_seen.sum() > 590
    assert len(last.contacts.touching) == 2
    messages = (encode_reading(last), surface_message(last, 0).SerializeToString())
    sizes = [len(compressed(message)) for message in messages]
    assert sum(sizes) + 600 <= 40_000, "with 600 bytes for records and index"
