"""MIDI ports on a JACK server without sound hardware, as jack_midi_dump receives them.

Requires jackd, jack_connect, jack_lsp and jack_midi_dump (Debian: jackd2) and the package python-rtmidi.
"""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

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
    path = tmp_path / "dump.txt"
    with path.open("w") as file:
        dump = subprocess.Popen(["stdbuf", "-oL", "jack_midi_dump"], stdout=file)
    wait_until(lambda: port_named("midi-monitor"))
    (output,) = open_outputs([f"midi://{name}"], session)
    if not name:
        own = port_named("manytouch")
        subprocess.run(["jack_connect", own, "midi-monitor:input"], check=True)
    centre_mm, force_N = np.array([0.0, 0.0]), np.array([0.0, 0.0, -5.0])
    phases = (Phase.START, Phase.MOVE, Phase.END)
    for number, phase in enumerate(phases):
        output.write(reading_of(number, (contact_of(7, phase, centre_mm=centre_mm, force_N=force_N),)))
        wait_until(lambda number=number: output.state.sent == number + 1)
    wait_until(lambda: "note off" in path.read_text())
    output.close()
    dump.terminate()
    dump.wait(10)
    text = path.read_text()
    assert "note on  (channel  1): pitch  60" in text
    assert "d1 3f" in text or "d1 40" in text  # half of 10 N
