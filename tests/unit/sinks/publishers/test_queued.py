"""The queue of an output: it never waits, counts what it drops, and opens a failed publisher again."""

import threading

import pytest

from manytouch.errors import OutputError
from manytouch.sinks.publishers.queued import QueuedOutput
from manytouch.values import Reading
from waiting import wait_until


class Slow:
    """A publisher that waits for a permission before each reading."""

    def __init__(self) -> None:
        self.has_begun = threading.Event()
        self.may_go = threading.Semaphore(0)
        self.indices: list[int] = []
        self.is_closed = False

    description = "readings of a test"

    def publish(self, reading: Reading) -> None:
        self.has_begun.set()
        self.may_go.acquire()
        self.indices.append(reading.frame.index)

    def close(self) -> None:
        self.is_closed = True


class Failing:
    """A publisher whose receiver disappears at the second reading."""

    opened = 0

    def __init__(self) -> None:
        type(self).opened += 1
        self.sent = 0

    description = "readings of a test"

    def publish(self, reading: Reading) -> None:
        self.sent += 1
        if type(self).opened < 3 and self.sent == 2:
            raise BrokenPipeError(32, "the receiver is gone")

    def close(self) -> None:
        pass


def test_of_more_readings_than_fit_the_oldest_are_dropped_and_counted(reading_of) -> None:
    publisher = Slow()
    output = QueuedOutput("slow", lambda: publisher, queue_length=3)
    output.write(reading_of(0))
    assert publisher.has_begun.wait(10.0)
    for index in range(1, 11):
        output.write(reading_of(index))
    assert output.state.dropped == 7
    publisher.may_go.release(100)
    output.close()
    assert publisher.indices == [0, 8, 9, 10]
    assert (output.state.sent, output.state.dropped, output.state.problem) == (4, 7, None)
    assert publisher.is_closed


def test_a_failed_publisher_is_opened_again_and_the_reason_is_shown(reading_of) -> None:
    Failing.opened = 0
    output = QueuedOutput("failing", Failing, retry_interval_s=0.02)
    problems = set()
    for index in range(2000):
        output.write(reading_of(index))
        problems.add(output.state.problem)
        if Failing.opened == 3 and output.state.problem is None:
            break
        threading.Event().wait(0.002)
    wait_until(lambda: output.state.problem is None and Failing.opened == 3)
    output.close()
    assert any("the receiver is gone" in (problem or "") for problem in problems)
    assert output.state.dropped >= 2


class FailingOnce:
    """A publisher whose first reading fails, after a permission; the next publisher works."""

    def __init__(self) -> None:
        self.may_fail = threading.Event()
        self.has_failed = False
        self.indices: list[int] = []

    description = "readings of a test"

    def publish(self, reading: Reading) -> None:
        if not self.has_failed:
            self.may_fail.wait()
            self.has_failed = True
            raise BrokenPipeError(32, "the receiver is gone")
        self.indices.append(reading.frame.index)

    def close(self) -> None:
        pass


def test_closing_soon_after_an_error_sends_what_is_queued(reading_of) -> None:
    publisher = FailingOnce()
    output = QueuedOutput("failed", lambda: publisher, retry_interval_s=60.0)
    for index in range(4):
        output.write(reading_of(index))
    publisher.may_fail.set()
    wait_until(lambda: output.state.dropped == 1)
    output.close()
    assert publisher.indices == [1, 2, 3]
    assert (output.state.sent, output.state.dropped) == (3, 1)


def test_closing_gives_up_after_a_second_error(reading_of) -> None:
    Failing.opened = -100  # every publisher fails at its second reading
    output = QueuedOutput("failing", Failing, retry_interval_s=60.0)
    for index in range(5):
        output.write(reading_of(index))
    wait_until(lambda: output.state.dropped == 1)
    output.close()
    assert (output.state.sent, output.state.dropped) == (2, 3)


def test_a_reading_written_after_closing_is_counted_as_dropped(reading_of) -> None:
    publisher = Slow()
    publisher.may_go.release(10)
    output = QueuedOutput("closed", lambda: publisher)
    output.close()
    output.write(reading_of(0))
    assert (output.state.sent, output.state.dropped) == (0, 1)
    assert publisher.indices == []


def test_a_publisher_that_is_stuck_does_not_keep_the_session_from_ending(reading_of) -> None:
    publisher = Slow()
    output = QueuedOutput("stuck", lambda: publisher, close_timeout_s=0.05)
    output.write(reading_of(0))
    output.close()
    assert output.state.sent == 0
    publisher.may_go.release()
    wait_until(lambda: publisher.is_closed)


def test_an_output_that_cannot_be_opened_at_first_is_an_error() -> None:
    def refuse() -> Slow:
        raise OutputError("there is no such port")

    with pytest.raises(OutputError, match="no such port"):
        QueuedOutput("missing", refuse)
