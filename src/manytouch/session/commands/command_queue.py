"""The commands to a session that wait, and its notes for the user."""

import threading
from collections import deque
from collections.abc import Callable

from manytouch.errors import ManytouchError
from manytouch.values import Command
from manytouch.values.commands import command_kind

NOTES = 20
MAX_WAITING = 256
PROGRESS = "compil"
"""Notes that begin so are the progress of one piece of work: of them only the latest is kept."""


class CommandQueue:
    """Takes commands from any thread and carries them out in one; a command that fails becomes a note.

    Of each kind only the newest command waits, so that no number of commands delays a frame by more than
    one of each kind does.
    """

    def __init__(self) -> None:
        self._waiting: dict[tuple[str, int | str], Command] = {}
        self._change = threading.Lock()
        self._notes: deque[str] = deque(maxlen=NOTES)
        self.on_note: Callable[[str], None] = lambda _: None
        """Called with every note."""

    @property
    def notes(self) -> tuple[str, ...]:
        """The latest notes, oldest first."""
        return tuple(self._notes)

    def send(self, command: Command) -> None:
        """Add a command, in place of one of its kind; never blocks. Beyond `MAX_WAITING` it is dropped."""
        kind = command_kind(command)
        with self._change:
            self._waiting.pop(kind, None)
            if len(self._waiting) < MAX_WAITING:
                self._waiting[kind] = command

    def note(self, sentence: str) -> None:
        """Add a note, in place of the former ones on the same progress."""
        if sentence.startswith(PROGRESS):
            kept = [note for note in self._notes if not note.startswith(PROGRESS)]
            self._notes = deque(kept, maxlen=NOTES)
        self._notes.append(sentence)
        self.on_note(sentence)

    def drain(self, carry_out: Callable[[Command], None]) -> None:
        """Carry out the commands that wait, in the order of their arrival."""
        with self._change:
            commands, self._waiting = self._waiting, {}
        for command in commands.values():
            try:
                carry_out(command)
            except ManytouchError as error:
                self.note(str(error))
