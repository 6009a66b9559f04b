"""Values survive encoding as JSON bit for bit, whatever numbers they contain."""

import json
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from contacts import contact_with
from manytouch.recording.json_codec import from_json, to_json
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import Contact, ContactShape, OutlineRing

ARRAYS = st.sampled_from(["float64", "float32", "int64", "int32", "uint8", "bool"]).flatmap(
    lambda dtype: npst.arrays(dtype, npst.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=4))
)
NUMBERS = st.floats() | st.integers(-(2**60), 2**60) | st.booleans() | st.none() | st.text(max_size=5)
NESTED = st.recursive(
    NUMBERS,
    lambda inner: (
        st.lists(inner, max_size=3).map(tuple) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=8,
)

CONTACT = contact_with(id=3, force_N=np.zeros(3), area_mm2=0.5, covariance=np.zeros((8, 8)))


def again(value: object) -> object:
    return from_json(json.loads(json.dumps(to_json(value), allow_nan=False)))


@given(ARRAYS)
def test_arrays_round_trip(array: np.ndarray) -> None:
    decoded = again(array)
    assert isinstance(decoded, np.ndarray)
    assert (decoded.dtype, decoded.shape) == (array.dtype, array.shape)
    assert decoded.tobytes() == array.tobytes()
    assert not decoded.flags.writeable


@given(NESTED)
def test_nested_values_round_trip(value: object) -> None:
    assert repr(again(value)) == repr(value)


def test_contacts_with_regions_round_trip() -> None:
    rings = (
        OutlineRing(point_mm=np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])),
        OutlineRing(point_mm=np.array([[0.1, 0.1], [0.1, 0.2], [0.2, 0.1]]), is_hole=True),
    )
    contact = replace(CONTACT, half_major_mm=0.4, shape=ContactShape.RING, outline=rings)
    decoded = again(contact)
    assert isinstance(decoded, Contact)
    assert (decoded.half_major_mm, decoded.shape) == (0.4, ContactShape.RING)
    assert np.isnan(decoded.half_minor_mm)
    assert decoded.outline is not None
    assert [ring.is_hole for ring in decoded.outline] == [False, True]
    np.testing.assert_array_equal(decoded.outline[1].point_mm, rings[1].point_mm)


def test_contacts_of_earlier_recordings_have_no_region() -> None:
    encoded = to_json(CONTACT)
    later = ("half_major_mm", "half_minor_mm", "orientation_rad", "shape", "shape_probability", "outline")
    decoded = from_json({name: value for name, value in encoded.items() if name not in later})
    assert decoded.shape is None
    assert decoded.outline is None
    assert np.isnan(decoded.half_major_mm)


def test_the_number_of_rest_frames_is_the_same_after_reading() -> None:
    """A list becomes a tuple; `mechanics` weighs markers by that number."""
    sensor = replace(demo_sensor(160), provenance={"still_frames": [0, 1, 2, 5]})
    again = from_json(json.loads(json.dumps(to_json(sensor))))
    assert sensor.rest_frames == again.rest_frames == 4
