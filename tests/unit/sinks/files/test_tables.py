"""The contract's tables: columns, units, empty cells, rows."""

import csv
import dataclasses

import numpy as np
import pyarrow.parquet as pq
import pytest

from flat_spline import FLAT
from manytouch.cli.terminal.console import describe_contacts
from manytouch.sinks.files.tables import (
    ContactList,
    ContactTable,
    FrameTable,
    MarkerTable,
    contact_list_column_names,
    seconds_text,
    six_digits,
)
from manytouch.values import ContactShape, Phase, Status

CONTACT_COLUMNS = (
    "frame,time_s,contact,phase,x_mm,y_mm,depth_mm,normal_force_N,shear_x_N,shear_y_N,area_mm2,"
    "x_std_mm,y_std_mm,force_std_N,x_px,y_px,"
    "depth_std_mm,normal_force_over_E_mm2,shear_x_std_N,shear_y_std_N,torque_Nmm,torque_std_Nmm,area_std_mm2,slip,"
    "half_major_mm,half_minor_mm,orientation_rad,shape,shape_probability"
)
MARKER_COLUMNS = "frame, time_s, marker, row, column, x_px, y_px, seen, dx_mm, dy_mm, depth_mm, depth_std_mm"
HASHES = {"input": "1", "sensor": "2", "parameters": "3", "version": "4"}
FRAME_COLUMNS = "frame,time_s,status,markers_seen,contacts,milliseconds,lost_ids,new_ids,method"


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def write(table, *readings):
    for reading in readings:
        table.write(reading)
    table.close()


def test_contact_columns_are_those_of_the_contract(tmp_path, sensor):
    write(ContactTable(tmp_path, sensor))
    assert (tmp_path / "contacts.csv").read_text() == CONTACT_COLUMNS + "\n"


def test_pitch_units_end_the_columns(tmp_path, sensor_of):
    write(ContactTable(tmp_path, sensor_of("pitch")))
    wanted = CONTACT_COLUMNS.replace("_mm,", "_pitch,").replace("mm2", "pitch2")
    assert (tmp_path / "contacts.csv").read_text() == wanted + "\n"


def test_what_is_not_known_is_empty_and_the_rest_is_there(tmp_path, sensor, reading_of, contact_of):
    write(ContactTable(tmp_path, sensor), reading_of(3, (contact_of(7, Phase.START),)))
    (row,) = rows_of(tmp_path / "contacts.csv")
    known = {name: value for name, value in row.items() if value != ""}
    assert known == {
        "frame": "3",
        "time_s": "0.120000",
        "contact": "7",
        "phase": "start",
        "x_mm": "2.5",
        "y_mm": "-1.25",
        "depth_mm": "1.5",
        "x_std_mm": "0.2",
        "y_std_mm": "0.3",
        "depth_std_mm": "0.5",
        "x_px": "179.5",
        "y_px": "109.5",
    }


def test_a_press_has_positive_normal_force_and_force_over_young(tmp_path, sensor_of, reading_of, contact_of):
    for unit, over in (("mm", 1.5), ("mm", np.nan), ("pitch", 0.25)):
        contact = contact_of(force_N=np.array([0.5, 0.0, -3.0]), normal_force_over_E_mm2=over, slip=True)
        write(ContactTable(tmp_path, sensor_of(unit)), reading_of(0, (contact,)))
        (row,) = rows_of(tmp_path / "contacts.csv")
        assert (row["normal_force_N"], row["shear_x_N"], row["shear_y_N"]) == ("3", "0.5", "0")
        assert row[f"normal_force_over_E_{unit}2"] == ("" if np.isnan(over) else str(over))
        assert row["slip"] == "1"


def test_the_ellipse_and_the_shape_follow_the_slip(tmp_path, sensor, reading_of, contact_of):
    contact = contact_of(
        half_major_mm=10.0 / 3.0,
        half_minor_mm=0.0123456789,
        orientation_rad=-0.5,
        shape=ContactShape.LINE,
        shape_probability=0.97,
    )
    write(ContactTable(tmp_path, sensor), reading_of(0, (contact,)))
    (row,) = rows_of(tmp_path / "contacts.csv")
    assert list(row.values())[-5:] == ["3.33333", "0.0123457", "-0.5", "line", "0.97"]


def test_frames_have_a_line_each_also_when_they_failed(tmp_path, reading_of, contact_of):
    ended = contact_of(2, Phase.END)
    write(
        FrameTable(tmp_path),
        reading_of(0, (contact_of(1), ended)),
        reading_of(2, status=Status.DECODE_ERROR, unseen=tuple(range(24))),
    )
    assert (tmp_path / "frames.csv").read_text().splitlines() == [
        FRAME_COLUMNS,
        "0,0.000000,ok,23,1,2,,,",
        "2,0.080000,decode_error,0,0,4,,,",
    ]


def test_lost_and_new_identities_are_counted_where_the_method_does(tmp_path, reading_of):
    reading = reading_of(0)
    counted = dataclasses.replace(reading.grid, lost_ids=3, new_ids=0)
    write(FrameTable(tmp_path), dataclasses.replace(reading, grid=counted), reading_of(1))
    rows = rows_of(tmp_path / "frames.csv")
    assert [(row["lost_ids"], row["new_ids"]) for row in rows] == [("3", "0"), ("", "")]


def test_markers_have_a_row_per_frame_but_not_the_missing_ones(tmp_path, sensor, reading_of):
    write(
        MarkerTable(tmp_path, sensor),
        reading_of(0, depth_mm=0.25),
        reading_of(1, unseen=(5,), depth_mm=0.5),
    )
    table = pq.read_table(tmp_path / "markers.parquet")
    assert table.column_names == MARKER_COLUMNS.split(", ")
    assert table.num_rows == 2 * 23
    columns = table.to_pydict()
    assert 9 not in columns["marker"]
    assert all(
        m == 6 * r + c for m, r, c in zip(columns["marker"], columns["row"], columns["column"], strict=True)
    )
    unseen = columns["marker"].index(5, 23)
    for name in ("x_px", "y_px", "dx_mm", "dy_mm", "depth_mm", "depth_std_mm"):
        assert columns[name][unseen] is None
        assert columns[name][unseen + 1] is not None
    assert columns["seen"][unseen] is False
    assert columns["depth_mm"][:23] == [0.25] * 23
    assert columns["depth_std_mm"][0] == pytest.approx(0.1)
    assert columns["time_s"][23] == pytest.approx(0.04)


def test_a_layout_that_is_no_rectangle_has_no_rows_and_columns(tmp_path, sensor, reading_of):
    layout = dataclasses.replace(sensor.layout, row_column=None)
    write(MarkerTable(tmp_path, dataclasses.replace(sensor, layout=layout)), reading_of(0))
    columns = pq.read_table(tmp_path / "markers.parquet").to_pydict()
    assert set(columns["row"]) == set(columns["column"]) == {None}


def test_long_recordings_come_in_row_groups(tmp_path, sensor, reading_of, monkeypatch):
    monkeypatch.setattr("manytouch.sinks.files.tables.ROWS_PER_GROUP", 46)
    write(MarkerTable(tmp_path, sensor), *(reading_of(index) for index in range(5)))
    file = pq.ParquetFile(tmp_path / "markers.parquet")
    assert [file.metadata.row_group(group).num_rows for group in range(file.num_row_groups)] == [46, 46, 23]
    assert file.metadata.row_group(0).column(0).compression == "ZSTD"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        *((-0.0, "0"), (np.nan, ""), (np.inf, ""), (-2.0, "-2"), (0.000412345678, "0.000412346")),
        *((1234.56789, "1234.57"), (0.1, "0.1"), (2.5e-9, "2.5e-09")),
    ],
)
def test_numbers_have_six_significant_digits(value, text):
    assert six_digits(value) == text


def test_small_forces_are_not_quantised(tmp_path, sensor, reading_of, contact_of):
    contact = contact_of(force_N=np.array([0.000123456, 0.0, -0.000412345]))
    write(ContactTable(tmp_path, sensor), reading_of(0, (contact,)))
    (row,) = rows_of(tmp_path / "contacts.csv")
    assert (row["normal_force_N"], row["shear_x_N"]) == ("0.000412345", "0.000123456")


def test_times_keep_microseconds_after_hours():
    assert seconds_text(36_000_123_456_789) == "36000.123457"


def test_frames_name_the_method_that_estimated_them(tmp_path, reading_of):
    described = reading_of(0)
    described = dataclasses.replace(described, surface=dataclasses.replace(described.surface, spline=FLAT))
    failed = reading_of(2, status=Status.DECODE_ERROR, unseen=tuple(range(24)))
    write(FrameTable(tmp_path, "mechanics"), described, reading_of(1), failed)
    assert [row["method"] for row in rows_of(tmp_path / "frames.csv")] == ["mechanics", "perimeter", ""]
    write(FrameTable(tmp_path, "paper"), reading_of(1))
    assert [row["method"] for row in rows_of(tmp_path / "frames.csv")] == ["paper"]


def test_each_contact_has_a_line_with_its_values_at_the_peak(tmp_path, sensor, reading_of, contact_of):
    def pressed(number, force_N, depth_mm, x_mm):
        return contact_of(
            number,
            force_N=np.array([0.0, 0.0, -force_N]),
            depth_mm=depth_mm,
            centre_mm=np.array([x_mm, 1.0]),
        )

    table = ContactList(tmp_path, sensor)
    write(
        table,
        reading_of(0, (pressed(3, 0.5, 1.0, 0.0),)),
        reading_of(1, (pressed(3, 2.0, 1.5, 2.0), pressed(1, np.nan, 0.4, 5.0))),
        reading_of(2, (pressed(3, 1.0, 1.75, 4.0), pressed(1, np.nan, 0.7, 6.0))),
        reading_of(3, (contact_of(3, Phase.END), pressed(1, np.nan, np.nan, 7.0))),
    )
    table.close()  # a second time changes nothing
    first, second = rows_of(tmp_path / "contact_list.csv")
    assert tuple(first) == contact_list_column_names("mm")
    assert (first["contact"], first["start_frame"], first["end_frame"], first["frames"]) == (
        "1",
        "1",
        "3",
        "3",
    )
    assert (first["peak_frame"], first["x_mm"], first["depth_mm"]) == ("2", "6", "0.7")
    assert first["normal_force_N"] == ""
    assert (second["contact"], second["start_time_s"], second["end_time_s"]) == ("3", "0.000000", "0.080000")
    assert (second["peak_frame"], second["x_mm"], second["normal_force_N"]) == ("1", "2", "2")
    assert (second["depth_mm"], second["depth_std_mm"]) == ("1.75", "0.5")
    lines = describe_contacts(table, "mm")
    assert lines[0] == "contact 1: 0.04 to 0.12 s, at (6.00, 1.00) mm, depth 0.70 ± 0.50 mm"
    assert lines[1] == "contact 3: 0.00 to 0.08 s, at (2.00, 1.00) mm, depth 1.75 ± 0.50 mm, force 2.00 N"
    many = ContactList(tmp_path, sensor)
    many.write(reading_of(0, tuple(contact_of(number) for number in range(14))))
    assert len(describe_contacts(many, "mm")) == 11
    assert describe_contacts(many, "mm")[-1] == "and 4 more in contact_list.csv"
    many.close()
