"""Inputs and results in an object store and on a web server, on the own machine."""

import functools
import http.server
import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from batch_work import Notes
from manytouch.batch.inputs import tasks_of
from manytouch.batch.remote_files import file_system, is_remote
from manytouch.batch.run_batch import merge
from manytouch.errors import OutputError, SourceError
from manytouch.session import process
from same_results import differences

pytest.importorskip("s3fs")
moto_server = pytest.importorskip("moto.server")


@pytest.fixture
def store(monkeypatch: pytest.MonkeyPatch, recordings: Path) -> Iterator[Any]:
    """The file system of a store with the recordings in s3://bucket/day1/."""
    import s3fs

    server = moto_server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "key",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_DEFAULT_REGION": "us-east-1",
    }.items():
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()
    files, _ = file_system("s3://bucket")
    files.mkdir("bucket")
    for path in recordings.iterdir():
        files.put_file(str(path), f"bucket/day1/{path.name}")
    yield files
    files.rm("bucket", recursive=True)  # the server keeps it for the next test
    s3fs.S3FileSystem.clear_instance_cache()
    server.stop()


def fetched(files: Any, name: str, folder: Path) -> Path:
    """A copy of a result."""
    target = folder / name
    target.mkdir(parents=True)
    for each in files.find(f"bucket/out/{name}"):
        files.get_file(each, str(target / Path(each).name))
    return target


def without_place(folder: Path) -> Path:
    """Remove from summary.json where the input was, which differs between a store and a disk."""
    found = json.loads((folder / "summary.json").read_text())
    del found["stamp"], found["input"]["source"]
    (folder / "summary.json").write_text(json.dumps(found))
    return folder


@pytest.mark.slow
def test_a_batch_from_a_store_to_a_store(
    store: Any,
    recordings: Path,
    tmp_path: Path,
    batch: Callable[..., tuple[Any, Notes]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    written: list[str] = []
    put_file = store.put_file

    def noted(local: str, remote: str) -> None:
        written.append(remote)
        put_file(local, remote)

    monkeypatch.setattr(store, "put_file", noted)
    address, out = "s3://bucket/day1/press*.mp4", "s3://bucket/out"
    report, notes = batch(address, out=out)
    assert report.computed == report.complete == 3, report.failed
    for name in ("press0", "press1", "press2"):
        own = [each for each in written if f"/{name}/" in each]
        assert own.index(f"bucket/out/{name}/summary.json") == len(own) - 1 > 2
    expected = process(recordings / "press1.mp4", out=tmp_path / "expected")
    found = fetched(store, "press1", tmp_path / "found")
    assert (
        json.loads((found / "summary.json").read_text())["input"]["source"] == "s3://bucket/day1/press1.mp4"
    )
    assert differences(without_place(found), without_place(expected)) == []
    store.get_file("bucket/out/results.parquet", str(tmp_path / "results.parquet"))
    assert [line["name"] for line in pq.read_table(tmp_path / "results.parquet").to_pylist()] == [
        "press0",
        "press1",
        "press2",
    ]

    assert batch("s3://bucket/day1/", out=out)[0].current == 3
    put_file(str(recordings / "press2.mp4"), "bucket/day1/press0.mp4")
    store.rm_file("bucket/out/press1/summary.json")  # a worker died before the last object
    report, notes = batch("s3://bucket/day1/", out=out)
    assert notes.reasons() == {"press0": "the input has changed", "press1": "no result yet"}
    with pytest.raises(OutputError, match="run the shards first"):
        merge(out)


def test_addresses_are_expanded_and_missing_ones_are_failures(
    store: Any, batch: Callable[..., tuple[Any, Notes]]
) -> None:
    store.pipe_file("bucket/list.txt", b"day1/press1.mp4\n")
    assert [task.input for task in tasks_of(["s3://bucket/list.txt"])] == ["s3://bucket/day1/press1.mp4"]
    with pytest.raises(SourceError, match="contains no recording"):
        tasks_of(["s3://bucket/day2/"])
    report, _ = batch("s3://bucket/day1/gone.mp4", "s3://nowhere/a.mp4")
    assert set(report.failed) == {"gone", "a"}
    assert "there is no s3://bucket/day1/gone.mp4" in report.failed["gone"].reason


def test_files_of_a_web_server_are_copied_and_streams_are_not() -> None:
    for name in ("list.txt", "LIST.TXT?token=a", "a.MP4", "a.mcap", "0.png"):
        assert is_remote(f"https://lab.example/{name}")
    for text in ("https://lab.example/stream", "rtsp://lab.example/a.mp4", "list.txt"):
        assert not is_remote(text)


def test_a_recording_on_a_web_server(
    recordings: Path, tmp_path: Path, batch: Callable[..., tuple[Any, Notes]]
) -> None:
    pytest.importorskip("aiohttp")

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    handler = functools.partial(Quiet, directory=str(recordings))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}"
        report, _ = batch(f"{address}/press0.mp4", f"{address.replace('//', '//me:secret@')}/gone.mp4")
        server.shutdown()
    assert report.computed == 1
    assert "gone.mp4" in report.failed["gone"].reason
    assert "secret" not in report.failed["gone"].reason + report.failed["gone"].traceback
    expected = process(recordings / "press0.mp4", out=tmp_path / "expected")
    found = tmp_path / "out" / "press0"
    assert differences(without_place(found), without_place(expected)) == []
