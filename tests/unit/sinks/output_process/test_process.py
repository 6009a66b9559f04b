"""Outputs in their process: several at once, refused ones, one that is killed, and commands."""

import os
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mido
import numpy as np
import pytest

from manytouch.errors import ManytouchError, OutputError
from manytouch.sinks.output_process.process import OutputProcess, start_outputs
from manytouch.sinks.publishers.dds import DdsParticipant
from manytouch.sinks.ros2.messages import RosMessage, typestore
from manytouch.values import Phase, Reading, Tare
from osc_receiver import Receiver
from waiting import wait_until

LOOPBACK = Path(__file__).parents[3] / "peers" / "loopback.xml"
DOMAIN = 86


@pytest.fixture
def pressed(reading_of, contact_of) -> Callable[[int], Reading]:
    def make(index: int) -> Reading:
        phase = Phase.START if index == 0 else Phase.MOVE
        return reading_of(index, (contact_of(7, phase, force_N=np.array([0.0, 0.0, -5.0])),))

    return make


def test_all_outputs_have_sent_every_reading_when_the_session_ends(session, pressed, tmp_path: Path) -> None:
    receiver, path = Receiver(), tmp_path / "take.mid"
    urls = [f"osc://127.0.0.1:{receiver.port}", f"midi://{path}"]
    (output,) = start_outputs([urls[0].replace("//", "//me:secret@"), urls[1]], session)
    assert [each.partition(": ")[0] for each in output.descriptions] == urls
    pid = output.pid
    for index in range(5):
        output.write(pressed(index))
    output.close()
    assert [(each.name, each.sent, each.dropped, each.problem) for each in output.states] == [
        (url, 5, 0, None) for url in urls
    ]
    wait_until(lambda: len(receiver.of("/manytouch/frame")) == 5)
    receiver.close()
    (note,) = (message for message in mido.MidiFile(path).tracks[0] if message.type == "note_on")
    assert note.channel == 1
    if sys.platform != "win32":
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_no_process_is_started_without_outputs_or_for_a_wrong_address(session, monkeypatch) -> None:
    monkeypatch.setattr(OutputProcess, "__init__", lambda *_: pytest.fail("it was started"))
    assert start_outputs([], session) == []
    with pytest.raises(ManytouchError, match="no output smoke://"):
        start_outputs(["osc://127.0.0.1:9", "smoke://here"], session)


def test_an_output_that_cannot_be_opened_is_the_error_of_the_process(session) -> None:
    with pytest.raises(OutputError, match=r"^'/no/such/take.mid' cannot be written: No such file"):
        start_outputs(["osc://127.0.0.1:9", "midi:///no/such/take.mid"], session)


def test_an_output_with_the_pose_of_the_sensor_opens_and_sends(
    session, pressed, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK.as_uri())
    (output,) = start_outputs([f"ros2://skin?domain={DOMAIN}&parent=tool0&pose=40,0,0,0,0,1.57"], session)
    output.write(pressed(0))
    output.close()
    assert [(state.sent, state.problem) for state in output.states] == [(1, None)]


class Unreadable(np.ndarray):
    """Values that can be sent and not received."""

    def __reduce_ex__(self, _: object) -> tuple[type, tuple[str]]:
        return int, ("no number",)


def test_an_internal_error_is_one_sentence_whose_traceback_is_a_note(
    session, capfd: pytest.CaptureFixture[str]
) -> None:
    camera = session.sensor.camera
    camera = replace(camera, rotation_vector=camera.rotation_vector.view(Unreadable))
    session.sensor = replace(session.sensor, camera=camera)
    with pytest.raises(OutputError, match=r"^internal error: ValueError: invalid .*; please report") as found:
        start_outputs(["ros2://skin"], session)
    assert any("Traceback" in note for note in found.value.__notes__)
    assert "Traceback" not in capfd.readouterr().err


def test_a_process_that_fails_later_names_the_cause_and_shows_no_traceback(
    session, reading_of, capfd: pytest.CaptureFixture[str]
) -> None:
    output = OutputProcess(["osc://127.0.0.1:9"], session, retry_interval_s=60.0)
    reading = reading_of(0)
    grid = replace(reading.grid, is_seen=reading.grid.is_seen.view(Unreadable))
    output.write(replace(reading, grid=grid))

    def problem() -> str:
        output.write(reading)
        return output.states[0].problem or ""

    wait_until(lambda: "ended (internal error: ValueError: invalid literal" in problem())
    output.close()
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="it has no signals that stop and kill")
def test_a_killed_process_is_started_again_and_what_it_lost_is_counted(session, pressed) -> None:
    receiver = Receiver()
    output = OutputProcess([f"osc://127.0.0.1:{receiver.port}"], session, retry_interval_s=0.05)
    output.write(pressed(0))
    wait_until(lambda: output.states[0].sent == 1)  # it reports from time to time
    os.kill(output.pid, signal.SIGSTOP)  # it takes nothing any more
    for index in range(1, 4):
        output.write(pressed(index))
    wait_until(lambda: output.waiting == 0)
    os.kill(output.pid, signal.SIGKILL)
    index, problems = 4, set()

    def is_back() -> bool:
        nonlocal index
        output.write(pressed(index))
        index += 1
        problems.update(state.problem for state in output.states)
        return any(frame[0] > 4 for frame in receiver.of("/manytouch/frame"))

    wait_until(is_back)
    output.close()
    receiver.close()
    assert "the process of the outputs has ended (exit status -9)" in problems
    (state,) = output.states
    assert state.problem is None
    assert state.sent == len(receiver.of("/manytouch/frame"))
    assert state.sent + state.dropped == index


def test_a_tare_that_a_node_of_ros_requests_reaches_the_session(
    session, pressed, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK.as_uri())
    (output,) = start_outputs([f"ros2://skin?domain={DOMAIN}"], session)
    peer = DdsParticipant(DOMAIN)
    peer.declare("/skin/tare", "std_msgs/msg/Empty", is_latched=True)
    empty = bytes(typestore().serialize_cdr(typestore().types["std_msgs/msg/Empty"](), "std_msgs/msg/Empty"))

    def is_tared() -> bool:
        peer.write(RosMessage(topic="/skin/tare", type="std_msgs/msg/Empty", cdr=empty))
        output.write(pressed(0))
        return any(isinstance(command, Tare) for command in session.commands)

    wait_until(is_tared)
    output.close()
    peer.close()
