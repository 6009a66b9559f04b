"""The table of regions: columns, rings with holes, unknown regions, units."""

import numpy as np
import pyarrow.parquet as pq

from manytouch.sinks.files.regions import RegionTable
from manytouch.values import OutlineRing, Phase

OUTER = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
HOLE = np.array([[1.0, 1.0], [1.0, 2.0], [2.0, 2.0]])
RINGS = (OutlineRing(point_mm=OUTER), OutlineRing(point_mm=HOLE, is_hole=True))


def written(folder, sensor, *readings):
    table = RegionTable(folder, sensor)
    for reading in readings:
        table.write(reading)
    table.close()
    return pq.read_table(folder / "regions.parquet")


def test_each_ring_has_a_line(tmp_path, sensor, reading_of, contact_of):
    contacts = (contact_of(3, outline=RINGS), contact_of(4), contact_of(5, Phase.END, outline=RINGS))
    table = written(
        tmp_path, sensor, reading_of(7, contacts), reading_of(8, (contact_of(3, outline=RINGS[:1]),))
    )
    assert table.column_names == ["frame", "contact", "ring", "is_hole", "outline"]
    rows = table.to_pylist()
    assert [(row["frame"], row["contact"], row["ring"], row["is_hole"]) for row in rows] == [
        (7, 3, 0, False),
        (7, 3, 1, True),
        (8, 3, 0, False),
    ]
    np.testing.assert_array_equal(rows[1]["outline"], HOLE)


def test_a_run_without_regions_has_an_empty_table(tmp_path, sensor, reading_of):
    assert written(tmp_path, sensor, reading_of(0)).num_rows == 0


def test_the_unit_of_the_outline_is_stated(tmp_path, sensor_of, reading_of):
    for unit in ("mm", "pitch"):
        schema = written(tmp_path / unit, sensor_of(unit), reading_of(0)).schema
        assert schema.field("outline").metadata[b"unit"] == unit.encode()


def test_long_recordings_come_in_row_groups(tmp_path, sensor, reading_of, contact_of, monkeypatch):
    monkeypatch.setattr("manytouch.sinks.files.regions.ROWS_PER_GROUP", 4)
    written(tmp_path, sensor, *(reading_of(index, (contact_of(outline=RINGS),)) for index in range(5)))
    file = pq.ParquetFile(tmp_path / "regions.parquet")
    assert [file.metadata.row_group(group).num_rows for group in range(file.num_row_groups)] == [4, 4, 2]
