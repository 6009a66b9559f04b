"""Values survive encoding as JSON bit for bit, whatever numbers they contain."""

import json

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from manytouch.recording.json_codec import from_json, to_json

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
