"""Values keep their arrays as they are through pickle and copies."""

import copy
import dataclasses
import pickle
import typing
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import manytouch.values
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file.default_std import CameraStd

KINDS = [
    kind
    for kind in (*map(vars(manytouch.values).get, manytouch.values.__all__), CameraStd)
    if isinstance(kind, type) and dataclasses.is_dataclass(kind)
]


def array_fields(kind: type) -> list[str]:
    return [name for name, hint in typing.get_type_hints(kind).items() if "ndarray" in repr(hint)]


def example(kind: Any, array: Callable[[], np.ndarray]) -> Any:
    """A value whose arrays come from a function, and whose other fields are numbers."""
    value = object.__new__(kind)
    for number, field in enumerate(dataclasses.fields(kind)):
        is_array = field.name in array_fields(kind)
        object.__setattr__(value, field.name, array() if is_array else number)
    return value


@pytest.mark.parametrize("duplicate", [lambda value: pickle.loads(pickle.dumps(value)), copy.deepcopy])
def test_arrays_that_are_read_only_stay_so_in_a_copy(duplicate: Callable[[Any], Any]) -> None:
    with_arrays = [kind for kind in KINDS if array_fields(kind)]
    assert len(with_arrays) >= 11
    for kind in with_arrays:
        value = example(kind, lambda: read_only(np.arange(3.0)))
        copied = duplicate(value)
        assert type(copied) is kind
        for field in dataclasses.fields(kind):
            before, after = getattr(value, field.name), getattr(copied, field.name)
            assert np.array_equal(before, after)
            if isinstance(after, np.ndarray):
                assert after is not before
                assert not after.flags.writeable, f"{kind.__name__}.{field.name}"
        writable = duplicate(example(kind, lambda: np.zeros(2)))
        assert all(getattr(writable, name).flags.writeable for name in array_fields(kind))
