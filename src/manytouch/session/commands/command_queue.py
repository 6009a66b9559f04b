"""The queue of commands to a session, and its notes for the user."""

import queue
from collections import deque
from collections.abc import Callable

from manytouch.errors import ManytouchError
from manytouch.values import Command

NOTES = 20


class CommandQueue:
    """Takes commands from any thread and carries them out in one; a command that fails becomes a note."""

    def __init__(self) -> None:
        self._commands: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._notes: deque[str] = deque(maxlen=NOTES)
        self.on_note: Callable[[str], None] = lambda _: None
        """Called with every note."""

    @property
    def notes(self) -> tuple[str, ...]:
        """The latest notes, oldest first."""
        return tuple(self._notes)

    def send(self, command: Command) -> None:
        """Add a command; never blocks."""
        self._commands.put(command)

    def note(self, sentence: str) -> None:
        """Add a note."""
        self._notes.append(sentence)
        self.on_note(sentence)

    def drain(self, carry_out: Callable[[Command], None]) -> None:
        """Carry out the commands since the last call, in order."""
        while True:
            try:
                command = self._commands.get_nowait()
            except queue.Empty:
                return
            try:
                carry_out(command)
            except ManytouchError as error:
                self.note(str(error))
