"""Values through pipes, and a process that starts, answers, fails and ends."""

import io
import os
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from manytouch.blas_threads import VARIABLES
from manytouch.child_process import ChildProcess, Refused, error_of, refusal, send
from manytouch.errors import MissingExtraError, OutputError, SourceError
from piped import received, sent

PROGRAM = """
import sys
from manytouch.child_process import pipes_to_parent, receive, refusal, send
from manytouch.errors import OutputError, SourceError

requests, answers = pipes_to_parent()
print("no answer")
while (value := receive(requests)) is not None:
    if isinstance(value, str):
        send(answers, refusal(SourceError(value), OutputError))
        raise SystemExit(3)
    if isinstance(value, list):
        import numpy
        from threadpoolctl import threadpool_info
        value = [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]
    send(answers, 2 * value)
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "pipe"


@pytest.fixture
def child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ChildProcess:
    return doubling_process(tmp_path, monkeypatch)


def doubling_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ChildProcess:
    (tmp_path / "doubling.py").write_text(PROGRAM)
    monkeypatch.syspath_prepend(tmp_path)
    return ChildProcess("doubling")


def test_half_a_message_is_the_end(file: Path) -> None:
    whole = sent({"values": np.arange(1000.0)}, file)
    for length in (0, 3, 8, 20, len(whole) - 1):
        assert received(whole[:length]) is None
    values = received(whole)["values"]
    np.testing.assert_array_equal(values, np.arange(1000.0))
    assert not values.flags.writeable


@pytest.mark.skipif(sys.platform == "win32", reason="it has no writev")
@pytest.mark.parametrize("most_bytes", [1, 1000, 1 << 20])
def test_a_pipe_may_take_a_message_in_pieces(
    most_bytes: int, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Pipe(io.FileIO):
        def write(self, data: Any) -> int:
            return super().write(bytes(data[:most_bytes]))

    writev = os.writev
    monkeypatch.setattr(os, "writev", lambda number, parts: writev(number, [b"".join(parts)[:most_bytes]]))
    with Pipe(str(file), "w") as pipe:
        send(pipe, np.arange(2000))
    np.testing.assert_array_equal(received(file.read_bytes()), np.arange(2000))


def test_many_arrays_are_one_message(file: Path) -> None:
    arrays = [np.array([number]) for number in range(4000)]
    assert [int(each[0]) for each in received(sent(arrays, file))] == list(range(4000))


def test_a_process_answers_until_its_input_is_closed(child: ChildProcess) -> None:
    pixels = np.full((720, 1280), 60, np.uint8)
    for _ in range(3):
        child.send(pixels)
        np.testing.assert_array_equal(child.receive(), 2 * pixels)
    assert child.end(10.0) == "exit status 0"
    assert child.receive() is None
    child.close()


def test_its_blas_has_one_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    child = doubling_process(tmp_path, monkeypatch)
    child.send([])
    assert set(child.receive()) == {1}
    child.end(10.0)
    child.close()


def test_an_error_in_a_process_is_one_here(child: ChildProcess) -> None:
    child.send("there is no sheet")
    refused = child.receive()
    assert isinstance(refused, Refused)
    error = error_of(refused, "the process of the sheet")
    assert isinstance(error, SourceError)
    assert str(error) == "there is no sheet"
    assert error.__notes__[0].startswith("In the process of the sheet:\n")
    assert child.receive() is None
    assert child.end(10.0) == "exit status 3"
    child.close()


def test_a_process_that_does_not_end_is_killed(child: ChildProcess) -> None:
    child.send(np.zeros(1))
    child.receive()
    os.kill(child.pid, signal.SIGSTOP)  # it does not see that its input is closed
    assert child.end(0.2) == "exit status -9"
    with pytest.raises(ProcessLookupError):
        os.kill(child.pid, 0)
    child.close()


def test_what_no_user_has_caused_is_an_internal_error() -> None:
    found = refusal(ZeroDivisionError("1 / 0"), OutputError)
    assert found.kind is OutputError
    assert found.sentence == "internal error: ZeroDivisionError: 1 / 0; please report it"
    missing = refusal(MissingExtraError("lab", "h5py"), OutputError)
    assert isinstance(error_of(missing, "a process"), MissingExtraError)
    assert str(error_of(missing, "a process")) == missing.sentence
