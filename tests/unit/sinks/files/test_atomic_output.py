"""Complete or absent: what lies aside is renamed at the end, files and folders alike."""

import pytest

from manytouch.errors import OutputError
from manytouch.sinks.files.atomic_output import AtomicOutput, output_errors


def test_a_file_takes_its_name_at_the_end_and_replaces_the_one_before(tmp_path):
    final = tmp_path / "deep" / "table.csv"
    output = AtomicOutput(final)
    output.temporary_path.write_text("new")
    assert not final.exists()
    assert output.temporary_path.suffix == ".csv"
    output.commit()
    assert [path.name for path in final.parent.iterdir()] == ["table.csv"]
    again = AtomicOutput(final)
    again.temporary_path.write_text("newer")
    assert final.read_text() == "new"
    again.commit()
    assert final.read_text() == "newer"


def test_a_folder_is_replaced_as_a_whole(tmp_path):
    final = tmp_path / "store.zarr"
    final.mkdir()
    (final / "old").write_text("old")
    output = AtomicOutput(final)
    (output.temporary_path / "part").mkdir(parents=True)
    (output.temporary_path / "part" / "new").write_text("new")
    output.commit()
    assert [path.name for path in final.rglob("*")] == ["part", "new"]


def test_what_was_left_aside_is_removed_first(tmp_path):
    first = AtomicOutput(tmp_path / "store.zarr")
    first.temporary_path.mkdir()
    (first.temporary_path / "half").write_text("ha")
    assert not AtomicOutput(tmp_path / "store.zarr").temporary_path.exists()


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(OutputError, match=r"cannot write .*table\.csv: .*; choose a folder"):
        AtomicOutput(tmp_path / "file" / "table.csv")


def test_only_the_file_systems_errors_are_translated(tmp_path):
    with pytest.raises(ZeroDivisionError), output_errors(tmp_path):
        raise ZeroDivisionError
