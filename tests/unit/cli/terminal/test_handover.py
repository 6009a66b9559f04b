"""What outlasts a session: the controls of the next one, sinks that stay open, and messages."""

from manytouch.cli.terminal.handover import KeptOpen, OnlyMessages, PresentControls
from manytouch.values import OutputState, Pause, Reading
from viewer_session import FakeSession, reading_of


def test_controls_are_those_of_the_present_session() -> None:
    first, second = FakeSession(), FakeSession()
    controls = PresentControls(first)
    controls.send(Pause())
    controls.session = second
    assert (len(first.commands), len(second.commands)) == (1, 0)
    controls.send(Pause())
    assert (len(first.commands), len(second.commands)) == (1, 1)
    assert controls.sensor is second.sensor
    assert controls.health() is second.now
    assert controls.comparison(0) is None


class Sent:
    """An output that keeps what it gets."""

    def __init__(self) -> None:
        self.readings: list[Reading] = []
        self.is_closed = False

    @property
    def states(self) -> tuple[OutputState, ...]:
        return (OutputState(name="x", sent=len(self.readings), dropped=0, problem=None),)

    def write(self, reading: Reading) -> None:
        self.readings.append(reading)

    def close(self) -> None:
        self.is_closed = True


def test_a_sink_that_is_kept_open_gets_everything_but_its_end() -> None:
    sent = Sent()
    kept = KeptOpen(sent)
    kept.write(reading_of(0))
    kept.close()
    kept.write(reading_of(1))
    assert [each.frame.index for each in sent.readings] == [0, 1]
    assert kept.states == sent.states
    assert not sent.is_closed


def test_only_messages_are_passed_on() -> None:
    class Everything:
        def __init__(self) -> None:
            self.got: list[object] = []

        def on_message(self, sentence: str) -> None:
            self.got.append(sentence)

        def on_begin(self, sensor: object, frame_count: object) -> None:
            self.got.append(sensor)

        def on_reading(self, reading: object) -> None:
            self.got.append(reading)

    observer = Everything()
    passed = OnlyMessages(observer)
    passed.on_begin(FakeSession().sensor, 3)
    passed.on_reading(reading_of(0))
    passed.on_message("tared")
    assert observer.got == ["tared"]
