"""Where a batch keeps its results: what an object store contains during and after an upload."""

from pathlib import Path
from typing import Any

import pytest

from manytouch.batch import storage
from manytouch.batch.storage import RemoteStore
from manytouch.errors import OutputError

fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def objects(monkeypatch: pytest.MonkeyPatch) -> Any:
    """An empty object store in memory, which `RemoteStore` finds at any address."""
    files = fsspec.filesystem("memory")
    files.store.clear()
    monkeypatch.setattr(storage, "file_system", lambda url: (files, "/bucket/out"))
    return files


def result(folder: Path, **texts: str) -> Path:
    """A folder with a summary.json and the given files; `__` in a name stands for a dot."""
    folder.mkdir(parents=True)
    for name, text in {"summary__json": "{}", **texts}.items():
        (folder / name.replace("__", ".")).write_text(text)
    return folder


def names(objects: Any) -> set[str]:
    return {str(each).removeprefix("/bucket/out/") for each in objects.find("/bucket/out")}


def test_objects_that_a_new_result_lacks_are_removed(objects: Any, tmp_path: Path) -> None:
    store = RemoteStore("s3://bucket/out")
    store.upload(result(tmp_path / "other"), "press10")
    first = result(tmp_path / "first", contacts__csv="old", annotated__mp4="video")
    (first / "surface.zarr").mkdir()
    (first / "surface.zarr" / "0").write_text("chunk")
    store.upload(first, "press1")
    assert names(objects) == {
        "press10/summary.json",
        *(f"press1/{name}" for name in ("summary.json", "contacts.csv", "annotated.mp4", "surface.zarr/0")),
    }
    assert not first.exists()

    store.upload(result(tmp_path / "second", contacts__csv="new"), "press1")
    assert names(objects) == {"press10/summary.json", "press1/summary.json", "press1/contacts.csv"}
    assert store.read("press1/contacts.csv") == b"new"
    assert store.names() == ["press1", "press10"]


def test_a_result_counts_as_missing_until_its_last_object_is_written(
    objects: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = RemoteStore("s3://bucket/out")
    store.upload(result(tmp_path / "first", contacts__csv="old"), "press1")

    def refuse(*_: object) -> None:
        raise OSError("no space")

    monkeypatch.setattr(objects, "put_file", refuse)
    with pytest.raises(OutputError, match=r"cannot write s3://bucket/out: no space"):
        store.upload(result(tmp_path / "second", contacts__csv="new"), "press1")
    assert store.names() == []
