"""Readings as plain values and through the Arrow PyCapsule interface."""

import json

import numpy as np
import pandas
import polars
import pyarrow as pa
import pytest

from manytouch.sinks.files.tables import contact_column_names, marker_column_names
from manytouch.values import OutlineRing, Phase
from manytouch.values.tabular.rows import contact_row, contact_values


def test_a_dictionary_of_a_reading_is_json_and_unknown_numbers_are_none(reading_of, contact_of) -> None:
    ring = OutlineRing(point_mm=np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    reading = reading_of(7, (contact_of(3, outline=(ring,)),))
    found = json.loads(json.dumps(reading.to_dict(), allow_nan=False))
    assert (found["frame"], found["time_s"], found["status"], found["markers_seen"]) == (7, 0.28, "ok", 23)
    (contact,) = found["contacts"]
    assert (contact["x_mm"], contact["depth_mm"], contact["normal_force_N"]) == (2.5, 1.5, None)
    assert contact["x_std_mm"] == pytest.approx(0.2)
    assert contact["outline"] == [{"is_hole": False, "points_mm": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]}]


def test_contacts_are_an_arrow_table_in_the_columns_of_the_files(reading_of, contact_of) -> None:
    contacts = (contact_of(3), contact_of(4, Phase.END, force_N=np.array([0.0, 0.0, -2.0]), slip=True))
    table = pa.table(reading_of(0, contacts).contacts)
    assert table["contact"].to_pylist() == [3, 4]
    assert table["phase"].to_pylist() == ["move", "end"]
    assert table["normal_force_N"].to_pylist() == [None, 2.0]
    assert table["slip"].to_pylist() == [None, True]
    assert table.column_names == list(contact_values(contacts[0]))
    empty = pa.table(reading_of(0).contacts)
    assert empty.num_rows == 0
    assert empty.schema == table.schema


def test_a_row_has_a_value_for_each_column_of_the_file(reading_of, contact_of) -> None:
    reading = reading_of(7, (contact_of(3),))
    assert set(contact_row(reading.frame, reading.contacts.contacts[0])) == set(contact_column_names("mm"))


def test_markers_are_an_arrow_table_in_the_columns_of_the_files(reading_of) -> None:
    table = pa.table(reading_of(0, unseen=(2,), depth_mm=1.5).markers)
    assert table.num_rows == 24
    assert table.column_names == list(marker_column_names("mm"))[2:]
    assert table["seen"].to_pylist()[:4] == [True, True, False, True]
    assert table["x_px"].to_pylist()[2] is None
    assert table["depth_mm"].to_pylist()[:3] == [1.5, 1.5, None]
    assert table["depth_std_mm"].to_pylist()[0] == pytest.approx(0.1)


def test_pandas_takes_contacts_and_markers(reading_of, contact_of) -> None:
    reading = reading_of(0, (contact_of(3), contact_of(4, Phase.END, slip=True)), unseen=(2,))
    contacts = pandas.DataFrame.from_arrow(reading.contacts)
    assert contacts["x_mm"].tolist() == [2.5, 2.5]
    assert contacts["phase"].tolist() == ["move", "end"]
    assert contacts["slip"].isna().tolist() == [True, False]
    markers = pandas.DataFrame.from_arrow(reading.markers)
    assert markers["seen"].tolist()[:4] == [True, True, False, True]
    assert markers["x_px"].isna().tolist()[:4] == [False, False, True, False]


def test_polars_takes_contacts_and_markers(reading_of, contact_of) -> None:
    reading = reading_of(0, (contact_of(3), contact_of(4, Phase.END, slip=True)), unseen=(2,))
    contacts = polars.DataFrame(reading.contacts)
    assert contacts["x_mm"].to_list() == [2.5, 2.5]
    assert contacts["phase"].to_list() == ["move", "end"]
    assert contacts["slip"].to_list() == [None, True]
    markers = polars.DataFrame(reading.markers)
    assert markers["seen"].to_list()[:4] == [True, True, False, True]
    assert markers["x_px"].is_null().to_list()[:4] == [False, False, True, False]
