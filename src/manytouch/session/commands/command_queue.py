"""What people ask of a session, and what it answers in words."""

import queue
from collections import deque
from collections.abc import Callable

from manytouch.errors import ManytouchError
from manytouch.values import Command

NOTES = 20


class CommandQueue:
    """Commands come in from any thread and are done in one; what cannot be done becomes a note."""

    def __init__(self) -> None:
        self._commands: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._notes: deque[str] = deque(maxlen=NOTES)
        self.say: Callable[[str], None] = lambda _: None
        """Told every note at once."""

    @property
    def notes(self) -> tuple[str, ...]:
        """The latest notes, oldest first."""
        return tuple(self._notes)

    def send(self, command: Command) -> None:
        """Ask for something; never blocks."""
        self._commands.put(command)

    def note(self, sentence: str) -> None:
        """Keep a note, and say it."""
        self._notes.append(sentence)
        self.say(sentence)

    def obey(self, do: Callable[[Command], None]) -> None:
        """Do what was asked for since the last call."""
        while True:
            try:
                command = self._commands.get_nowait()
            except queue.Empty:
                return
            try:
                do(command)
            except ManytouchError as error:
                self.note(str(error))
