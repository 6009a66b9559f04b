"""One clock for files and simulations of a rig."""

import multiprocessing
import time

from manytouch.rigs.common_start import LEAD_NS, BeginMessage, CommonStart, ReadyMessage, offsets

SECOND = 10**9


def test_recordings_of_one_session_keep_the_distances_of_their_starts() -> None:
    assert offsets({"a": 5 * SECOND, "b": 3 * SECOND, "c": None}) == {"a": 2 * SECOND, "b": 0, "c": 0}
    assert offsets({"a": 5000 * SECOND, "b": 3 * SECOND}) == {"a": 0, "b": 0}
    assert offsets({"a": None}) == {"a": 0}


def test_all_begin_when_the_last_is_ready_and_a_later_one_begins_at_once() -> None:
    start = CommonStart(has_camera=False)
    pipes = {name: multiprocessing.Pipe() for name in ("a", "b")}
    start.ready("a", pipes["a"][0], ReadyMessage(started_unix_ns=7 * SECOND))
    start.begin_if_ready({"a": True, "b": True})
    assert not pipes["a"][1].poll()
    start.ready("b", pipes["b"][0], ReadyMessage(started_unix_ns=6 * SECOND))
    before_ns = time.monotonic_ns()
    start.begin_if_ready({"a": True, "b": True})
    received = {name: pipes[name][1].recv() for name in pipes}
    assert all(isinstance(each, BeginMessage) for each in received.values())
    assert received["a"].at_ns - received["b"].at_ns == SECOND
    assert before_ns + LEAD_NS <= start.began_ns == received["b"].at_ns
    start.ready("a", pipes["a"][0], ReadyMessage(started_unix_ns=None))
    assert pipes["a"][1].recv().at_ns < before_ns + LEAD_NS + SECOND


def test_a_sensor_that_failed_is_not_waited_for_and_one_that_died_is_no_error() -> None:
    start = CommonStart(has_camera=True)
    began_ns = start.began_ns
    (here, there), (dead, _) = multiprocessing.Pipe(), multiprocessing.Pipe()
    start.ready("a", here, ReadyMessage(started_unix_ns=None))
    start.ready("c", dead, ReadyMessage(started_unix_ns=None))
    dead.close()
    start.begin_if_ready({"a": True, "b": False, "c": True})
    assert there.recv().at_ns > began_ns == start.began_ns
