"""Queue of commands that a session carries out between two frames, and its notes to the user."""

import threading
from collections import deque
from collections.abc import Callable

from manytouch.errors import ManytouchError
from manytouch.values import Command
from manytouch.values.commands import command_kind

MAX_NOTES = 20
MAX_WAITING = 256
"""Kinds are unbounded: each finger and each parameter is one (`values.commands.command_kind`)."""
COMPILING_BEGIN = "compil"
"""Beginning of the messages of `session.warm_up.warm_up_kernels`: "compiling ...", "compiled for ...".

They are the progress of one piece of work, so that of notes that begin so only the latest is kept."""


class CommandQueue:
    """Takes commands from any thread; the thread that calls `drain` carries them out.

    Only the newest command of each kind (`command_kind`) waits, so that at most one of each kind delays a
    frame, however many are sent.
    """

    def __init__(self) -> None:
        self._waiting: dict[tuple[str, int | str], Command] = {}
        self._lock = threading.Lock()
        self._notes: deque[str] = deque(maxlen=MAX_NOTES)
        self.on_note: Callable[[str], None] = lambda _: None
        """Called with every note."""

    @property
    def notes(self) -> tuple[str, ...]:
        """The latest notes, oldest first."""
        return tuple(self._notes)

    def send(self, command: Command) -> None:
        """Add a command, in place of one of its kind; if `MAX_WAITING` wait, it is dropped. Never blocks."""
        kind = command_kind(command)
        with self._lock:
            self._waiting.pop(kind, None)
            if len(self._waiting) < MAX_WAITING:
                self._waiting[kind] = command

    def note(self, sentence: str) -> None:
        """Add a note; one on compiling replaces the former ones on it."""
        if sentence.startswith(COMPILING_BEGIN):
            kept = [note for note in self._notes if not note.startswith(COMPILING_BEGIN)]
            self._notes = deque(kept, maxlen=MAX_NOTES)
        self._notes.append(sentence)
        self.on_note(sentence)

    def drain(self, carry_out: Callable[[Command], None]) -> None:
        """Carry out the commands that wait, in the order of their arrival, in the present thread.

        A `ManytouchError` of a command becomes a note, and the next command follows. Any other exception is
        raised, and the commands after it are not carried out.
        """
        with self._lock:
            commands, self._waiting = self._waiting, {}
        for command in commands.values():
            try:
                carry_out(command)
            except ManytouchError as error:
                self.note(str(error))
