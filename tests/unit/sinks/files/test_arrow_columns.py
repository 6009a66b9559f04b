"""Columns of Arrow tables: the same as pyarrow makes, without pandas."""

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest

from manytouch.sinks.files.arrow_columns import arrow_column, point_lists


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        (np.array([1.5, np.nan, -2.0]), pa.float32()),
        (np.array([1.5, 0.0, -2.0]), pa.float64()),
        (np.arange(20)[::2], pa.int32()),
        (np.full(3, np.nan), pa.int32()),
        (np.array([True, False, True] * 7), pa.bool_()),
        (np.empty(0), pa.float32()),
    ],
)
def test_columns_are_those_of_pyarrow(values, kind):
    column = arrow_column(values, kind)
    column.validate(full=True)
    assert column.equals(pa.array(values, from_pandas=True).cast(kind, safe=False))


def test_points_are_lists_of_pairs():
    points = [np.array([[0.0, 1.0], [2.0, 3.0]]), np.array([[4.0, 5.0]])]
    column = point_lists(points)
    column.validate(full=True)
    assert column.type == pa.list_(pa.list_(pa.float32(), 2))
    assert column.to_pylist() == [each.tolist() for each in points]


def test_pandas_is_not_imported():
    code = (
        "import sys, numpy, pyarrow; "
        "from manytouch.sinks.files.arrow_columns import arrow_column, point_lists; "
        "arrow_column(numpy.ones(3), pyarrow.float32()); point_lists([numpy.ones((3, 2))]); "
        "sys.exit('pandas' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
