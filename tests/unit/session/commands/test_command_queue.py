"""Commands that wait are replaced by newer ones of their kind, and carried out in the order of arrival."""

from manytouch.errors import ManytouchError
from manytouch.session.commands.command_queue import MAX_WAITING, CommandQueue
from manytouch.values import (
    Command,
    Pause,
    Press,
    Record,
    Release,
    Resume,
    StopRecording,
    Tare,
    Tune,
    UseMethod,
)


def press(finger: int, depth_mm: float = 1.0) -> Press:
    return Press(finger=finger, x_mm=0.0, y_mm=0.0, depth_mm=depth_mm)


def carried_out(*commands: Command) -> list[Command]:
    waiting, done = CommandQueue(), []
    for command in commands:
        waiting.send(command)
    waiting.drain(done.append)
    waiting.drain(done.append)
    return done


def test_the_newest_command_of_each_kind_is_carried_out_in_order() -> None:
    assert carried_out(
        Pause(), Tare(), press(1), Resume(), UseMethod(method="a"), Tare(), press(2), press(1, 3.0)
    ) == [
        Resume(),
        UseMethod(method="a"),
        Tare(),
        press(2),
        press(1, 3.0),
    ]
    assert carried_out(press(1), press(2), Release(finger=1)) == [press(2), Release(finger=1)]
    assert carried_out(Record(), StopRecording()) == [StopRecording()]
    tunes = [Tune(parameter="a", value=1.0), Tune(parameter="b", value=1.0), Tune(parameter="a", value=2.0)]
    assert carried_out(*tunes) == tunes[1:]


def test_the_number_of_waiting_commands_is_limited() -> None:
    assert (
        len(carried_out(*(Tune(parameter=f"p{number}", value=1.0) for number in range(1000)))) == MAX_WAITING
    )


def test_commands_that_arrive_meanwhile_wait_for_the_next_time() -> None:
    waiting, done = CommandQueue(), []

    def carry_out(command: Command) -> None:
        done.append(command)
        waiting.send(command)

    waiting.send(Tare())
    waiting.drain(carry_out)
    assert done == [Tare()]


def test_a_command_that_fails_becomes_a_note() -> None:
    waiting, heard = CommandQueue(), []
    waiting.on_note = heard.append

    def fail(_: Command) -> None:
        raise ManytouchError("it cannot be done")

    waiting.send(Tare())
    waiting.drain(fail)
    assert waiting.notes == ("it cannot be done",)
    assert heard == ["it cannot be done"]


def test_of_the_progress_of_compiling_only_the_latest_note_is_kept() -> None:
    waiting = CommandQueue()
    for sentence in ("compiling, once only", "tared", "compiling 3 of 46, once only", "compiled"):
        waiting.note(sentence)
    assert waiting.notes == ("tared", "compiled")
