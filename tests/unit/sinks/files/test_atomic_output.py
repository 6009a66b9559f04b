"""Complete or absent: single files get their name at the end."""

import pytest

from manytouch.errors import OutputError
from manytouch.sinks.files.atomic_output import atomic_file, output_errors


def test_a_file_gets_its_name_at_the_end_and_replaces_the_one_before(tmp_path):
    final = tmp_path / "deep" / "table.csv"
    for text in ("new", "newer"):
        before = final.read_text() if final.exists() else None
        with atomic_file(final) as partial:
            partial.write_text(text)
            assert (final.read_text() if final.exists() else None) == before
            assert partial.suffix == ".csv"
        assert [path.name for path in final.parent.iterdir()] == ["table.csv"]
        assert final.read_text() == text


def test_two_writers_of_one_file_share_no_name(tmp_path):
    final = tmp_path / "table.csv"
    with atomic_file(final) as one, atomic_file(final) as other:
        assert one != other
        one.write_text("one")
        other.write_text("other")
    assert final.read_text() in {"one", "other"}


def test_after_an_error_the_file_of_before_is_there_alone(tmp_path):
    final = tmp_path / "table.csv"
    final.write_text("before")
    with pytest.raises(ZeroDivisionError), atomic_file(final) as partial:
        partial.write_text(str(1 / 0))
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]
    assert final.read_text() == "before"


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("no folder")
    with (
        pytest.raises(OutputError, match=r"cannot write .*table\.csv: .*; choose a folder"),
        atomic_file(tmp_path / "file" / "table.csv"),
    ):
        pass


def test_only_the_file_systems_errors_are_translated(tmp_path):
    with pytest.raises(ZeroDivisionError), output_errors(tmp_path):
        raise ZeroDivisionError
