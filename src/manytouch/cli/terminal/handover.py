"""One viewer and the same outputs for two sessions, one after the other: a file, and then its playback."""

from manytouch.pipeline import Controls, Output, Sink
from manytouch.session.run import NoObserver, Observer
from manytouch.values import Command, Comparison, Health, OutputState, Reading, Sensor


class PresentControls:
    """Controls of the session that runs at present.

    Attributes:
        session: to be replaced when another session begins.
    """

    def __init__(self, session: Controls) -> None:
        self.session = session

    @property
    def sensor(self) -> Sensor:
        """The sensor of the present session."""
        return self.session.sensor

    def send(self, command: Command) -> None:
        """Request something of the present session."""
        self.session.send(command)

    def health(self) -> Health:
        """State of the present session."""
        return self.session.health()

    def comparison(self, frame_index: int) -> Comparison | None:
        """What the present session compares its estimates with."""
        return self.session.comparison(frame_index)


class KeptOpen:
    """A sink, or an output, that outlasts the session that writes to it; its owner closes it."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink

    @property
    def states(self) -> tuple[OutputState, ...]:
        """What an output has sent."""
        return self._sink.states if isinstance(self._sink, Output) else ()

    def write(self, reading: Reading) -> None:
        """Pass a reading on."""
        self._sink.write(reading)

    def close(self) -> None:
        """Leave it open."""


class OnlyMessages(NoObserver):
    """Passes on the messages of a session whose sensor is known already."""

    def __init__(self, observer: Observer) -> None:
        self._observer = observer

    def on_message(self, sentence: str) -> None:
        """Pass it on."""
        self._observer.on_message(sentence)
