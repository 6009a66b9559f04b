"""Packed arrays: their precision, their size, and descriptions that do not fit."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from manytouch.errors import SourceError
from manytouch.recording.compression import compressed, decompressed
from manytouch.recording.messages import decode_reading, encode_reading, surface_message
from manytouch.recording.packed import PackedBlock, unpack
from manytouch.session import pipeline_for
from manytouch.sources.pressed.pressed_source import PressedSource
from manytouch.values import Frame, Press, Reading, Status

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
    again = unpack(block.pack(symmetric, "covariance_px2"), bytes(block.content))
    assert len(block.content) == 3 * 10 * 4
    np.testing.assert_array_equal(again, again.swapaxes(1, 2))
    np.testing.assert_allclose(again, symmetric, rtol=2.0**-9, atol=1e-37)
    general = PackedBlock()
    array[0, 0, 1] = array[0, 1, 0] + 1.0
    back = unpack(general.pack(array, "covariance_px2"), bytes(general.content))
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


@pytest.fixture(scope="module")
def eight_contacts() -> Reading:
    """A reading of method `mechanics` with 600 markers and eight contacts, 2 to 4 mm deep."""
    source = PressedSource("rest", seconds=0.3)
    fingers = list(enumerate((x_mm, y_mm) for y_mm in (-20.0, 18.0) for x_mm in (-45.0, -15.0, 15.0, 45.0)))

    def frames() -> Iterator[Frame]:
        for frame in source:
            for finger, (x_mm, y_mm) in fingers:
                depth_mm = min(2.0 + 0.3 * finger, 1.0 * frame.index)
                source.press(Press(finger=finger, x_mm=x_mm, y_mm=y_mm - 0.2 * finger, depth_mm=depth_mm))
            yield frame

    *_, last = pipeline_for("mechanics").run(frames(), source.sensor)
    return last


def test_a_reading_of_600_markers_and_eight_contacts_takes_at_most_40_kB(eight_contacts: Reading) -> None:
    assert eight_contacts.grid.is_seen.sum() > 590
    assert len(eight_contacts.contacts.touching) == 8
    cloud = surface_message(eight_contacts, 0).SerializeToString()
    sizes = [len(compressed(message)) for message in (encode_reading(eight_contacts), cloud)]
    assert sum(sizes) + 600 <= 40_000, "with 600 bytes for records and index"


def test_a_reading_of_mechanics_comes_back(eight_contacts: Reading) -> None:
    layout = eight_contacts.surface.layout
    again = decode_reading(encode_reading(eight_contacts), eight_contacts.frame, layout)
    before, after = eight_contacts.surface, again.surface
    assert again.status is eight_contacts.status is Status.OK
    np.testing.assert_allclose(after.displacement_mm, before.displacement_mm, rtol=2.0**-16)
    assert before.spline is not None
    assert after.spline is not None
    np.testing.assert_allclose(after.spline.coefficient_mm, before.spline.coefficient_mm, rtol=2.0**-16)
    np.testing.assert_allclose(after.spline.force_over_E_mm2, before.spline.force_over_E_mm2, rtol=2.0**-12)
    for one, other in zip(eight_contacts.contacts.contacts, again.contacts.contacts, strict=True):
        assert (one.id, one.depth_mm, one.phase) == (other.id, other.depth_mm, other.phase)
        np.testing.assert_allclose(other.force_N, one.force_N, rtol=2.0**-24)
        np.testing.assert_allclose(other.covariance, one.covariance, rtol=2.0**-9)
        assert one.outline is not None
        assert other.outline is not None
        for ring, ring_again in zip(one.outline, other.outline, strict=True):
            assert ring.is_hole == ring_again.is_hole
            np.testing.assert_allclose(ring_again.point_mm, ring.point_mm, atol=0.00051)


@pytest.mark.parametrize("end", [(np.nan, 0.0, 0.0), (1e9, 0.0, 0.0), (0.0, 0.0, 1e3), "singular"])
def test_an_impossible_outline_is_refused(
    eight_contacts: Reading, end: tuple[float, float, float] | str
) -> None:
    spline, frame = eight_contacts.surface.spline, eight_contacts.frame
    assert spline is not None
    if end == "singular":  # both conditions become one equation for the outer two coefficients
        step_mm = spline.size_mm[0] / spline.elements[0]
        spline, end = replace(spline, shear_mm2=-(step_mm**2) / 3.0), (0.0, 0.0, 0.0)
    surface = replace(eight_contacts.surface, spline=replace(spline, clamped_end=end))
    changed = encode_reading(replace(eight_contacts, surface=surface))
    with pytest.raises(SourceError, match="clamped_end"):
        decode_reading(changed, frame, eight_contacts.surface.layout)
