"""Compares results of the program bit for bit."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def assert_same_bits(one: Any, other: Any, path: str = "result") -> None:
    """Compares arrays, numbers, dataclasses and sequences of these; NaN equals NaN."""
    assert type(one) is type(other), path
    if isinstance(one, np.ndarray):
        np.testing.assert_array_equal(one, other, err_msg=path)
    elif is_dataclass(one):
        for field in fields(one):
            assert_same_bits(getattr(one, field.name), getattr(other, field.name), f"{path}.{field.name}")
    elif isinstance(one, tuple | list):
        assert len(one) == len(other), path
        for number, pair in enumerate(zip(one, other, strict=True)):
            assert_same_bits(*pair, f"{path}[{number}]")
    elif isinstance(one, float) and np.isnan(one):
        assert np.isnan(other), path
    else:
        assert one == other, path
