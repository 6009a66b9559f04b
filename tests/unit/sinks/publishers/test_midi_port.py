"""MIDI ports on a JACK server without sound hardware, as jack_midi_dump receives them.

Requires jackd, jack_connect, jack_lsp and jack_midi_dump (Debian: jackd2) and the package python-rtmidi.
"""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from manytouch.sinks.publishers.queued import QueuedOutput
from manytouch.sinks.publishers.registry import open_outputs
from manytouch.values import Phase
from waiting import wait_until

pytestmark = pytest.mark.slow

TOOLS = ("jackd", "jack_connect", "jack_lsp", "jack_midi_dump")


@pytest.fixture
def jack(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    pytest.importorskip("rtmidi")
    if not all(shutil.which(tool) for tool in TOOLS):
        pytest.skip("jackd2 is not installed")
    monkeypatch.setenv("JACK_NO_AUDIO_RESERVATION", "1")
    command = ["jackd", "--no-realtime", "-d", "dummy", "-r", "48000", "-p", "1024"]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_until(lambda: port_named("system"))
    mido = pytest.importorskip("mido")
    mido.set_backend("mido.backends.rtmidi/UNIX_JACK")
    yield
    mido.set_backend("mido.backends.rtmidi")
    server.terminate()
    server.wait(10)


def port_named(name: str) -> str:
    found = subprocess.run(["jack_lsp"], capture_output=True, text=True, check=False)
    return next((port for port in found.stdout.splitlines() if name in port), "")


@pytest.mark.usefixtures("jack")
@pytest.mark.parametrize("name", ["", "midi-monitor"])
def test_a_jack_client_receives_the_note_of_a_contact(
    name: str, session, reading_of, contact_of, tmp_path: Path
) -> None:
    """`midi://` opens a port to which clients connect, `midi://NAME` connects to a client."""
    dump = started_dump(tmp_path / "dump.txt")
    (output,) = open_outputs([f"midi://{name}"], session)
    if not name:
        connect_dump()
    press(output, 7, 0, reading_of, contact_of)
    text = received(tmp_path / "dump.txt")
    assert "note on  (channel  1): pitch  60" in text
    assert "d1 3f" in text or "d1 40" in text  # half of 10 N
    dump.kill()
    dump.wait(10)
    wait_until(lambda: not port_named("midi-monitor"))
    if name:
        wait_until(lambda: "has disappeared" in problem_after(output, reading_of))
    dump = started_dump(tmp_path / "again.txt")
    if name:
        wait_until(lambda: not problem_after(output, reading_of))
    else:
        connect_dump()
    press(output, 8, 3, reading_of, contact_of)
    text = received(tmp_path / "again.txt")
    assert "note on" in text
    assert "pitch  60" in text
    output.close()
    assert output.state.problem is None
    dump.terminate()
    dump.wait(10)


def problem_after(output: QueuedOutput, reading_of) -> str:
    """The problem of an output when one more reading has been sent or dropped."""
    count = output.state.sent + output.state.dropped
    output.write(reading_of(3))
    wait_until(lambda: output.state.sent + output.state.dropped > count)
    return output.state.problem or ""


def started_dump(path: Path) -> "subprocess.Popen[bytes]":
    """A client that writes what it receives to a file."""
    with path.open("w") as file:
        dump = subprocess.Popen(["stdbuf", "-oL", "jack_midi_dump"], stdout=file)
    wait_until(lambda: port_named("midi-monitor"))
    return dump


def connect_dump() -> None:
    subprocess.run(["jack_connect", port_named("manytouch"), "midi-monitor:input"], check=True)


def press(output: QueuedOutput, number: int, index: int, reading_of, contact_of) -> None:
    """A contact with 5 N in the middle of the sheet, in three readings."""
    centre_mm, force_N = np.array([0.0, 0.0]), np.array([0.0, 0.0, -5.0])
    sent = output.state.sent
    for place, phase in enumerate((Phase.START, Phase.MOVE, Phase.END)):
        contact = contact_of(number, phase, centre_mm=centre_mm, force_N=force_N)
        output.write(reading_of(index + place, (contact,)))
        wait_until(lambda place=place: output.state.sent == sent + place + 1)


def received(path: Path) -> str:
    """What the client has received, up to the end of a note."""
    wait_until(lambda: "note off" in path.read_text())
    return path.read_text()
