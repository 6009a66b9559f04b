"""Items in order from a thread that waits for its consumer, or replaces those that wait by newer ones."""

import sys
import threading
import time
from collections.abc import Iterator

import pytest

from manytouch.session.background_iterator import BackgroundIterator, short_switch_interval
from waiting import wait_until


def test_stopping_works_while_no_frame_comes() -> None:
    never = threading.Event()

    def silent() -> Iterator[int]:
        yield 1
        never.wait(10)

    calls: list[float] = []

    def stop() -> bool:
        calls.append(time.monotonic())
        never.set()
        return True

    with BackgroundIterator(silent(), ahead=1, stop=stop) as stream:
        assert list(stream) == [1]
    assert calls


def test_the_thread_is_never_further_ahead_than_requested() -> None:
    taken: list[int] = []

    def numbers() -> Iterator[int]:
        for number in range(20):
            taken.append(number)
            yield number

    with BackgroundIterator(numbers(), ahead=2) as stream:
        for number in stream:
            time.sleep(0.005)
            assert len(taken) <= number + 5
    assert taken == list(range(20))


def test_without_replaceable_items_the_thread_waits_with_one_more_than_ahead() -> None:
    begun: list[int] = []

    def numbers() -> Iterator[int]:
        for number in range(10):
            begun.append(number)
            yield number

    with BackgroundIterator(numbers(), ahead=1) as stream:
        items = iter(stream)
        assert next(items) == 0
        wait_until(lambda: len(begun) == 3)
        time.sleep(0.05)
        assert len(begun) == 3
        assert list(items) == list(range(1, 10))
    assert stream.replaced == 0


def test_a_replaceable_item_takes_the_place_of_one_that_waits_and_others_wait() -> None:
    taken = threading.Event()

    def items() -> Iterator[int | str]:
        yield "first"
        yield 1
        taken.wait(10)
        yield 2
        yield 3
        yield "second"
        yield 4
        yield 5

    with BackgroundIterator(items(), ahead=1, replaceable=int) as stream:
        got = iter(stream)
        assert next(got) == "first"
        assert next(got) == 1
        taken.set()
        wait_until(lambda: stream.replaced == 1)
        assert next(got) == 3
        assert next(got) == "second"
        wait_until(lambda: stream.replaced == 2)
        assert list(got) == [5]


def test_an_error_comes_after_the_items_before_it() -> None:
    def items() -> Iterator[int]:
        yield 1
        yield 2
        raise ValueError("out of items")

    with BackgroundIterator(items(), ahead=1) as stream:
        got = iter(stream)
        assert [next(got), next(got)] == [1, 2]
        with pytest.raises(ValueError, match="out of items"):
            next(got)


def test_an_iterator_that_cannot_be_closed_ends_all_the_same() -> None:
    class Camera:
        def __init__(self) -> None:
            self.frames = iter([1, 2])

        def __iter__(self) -> Iterator[int]:
            return self

        def __next__(self) -> int:
            return next(self.frames)

        def close(self) -> None:
            raise OSError("the camera is gone")

    seen: list[int] = []
    with (
        BackgroundIterator(Camera(), ahead=1, stop=lambda: False) as stream,
        pytest.raises(OSError, match="gone"),
    ):
        seen.extend(stream)
    assert seen == [1, 2]


def test_leaving_the_block_ends_a_thread_that_waits() -> None:
    name = "a thread that waits"
    with BackgroundIterator(iter(range(100)), ahead=1, thread_name=name) as stream:
        assert next(iter(stream)) == 0
        assert name in [thread.name for thread in threading.enumerate()]
    assert name not in [thread.name for thread in threading.enumerate()]


def test_the_switch_interval_is_as_before_when_the_last_of_several_blocks_has_ended() -> None:
    before_s = sys.getswitchinterval()
    first, second = short_switch_interval(), short_switch_interval()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert sys.getswitchinterval() < before_s
    second.__exit__(None, None, None)
    assert sys.getswitchinterval() == before_s
