"""How often one client may be heard, and a task that runs at most so often."""

import asyncio
from collections.abc import Callable

MESSAGES_PER_S = 500.0
"""Messages that are read of one client; the connection holds the others back."""
REQUESTS_PER_S, REQUESTS_AT_ONCE = 60.0, 60.0
"""Requests to the session that are passed on of one client; of those that wait, the newest of each kind."""
REPEAT_S = 0.1
"""Least time between two updates that are sent again because a client displays something else."""


class Allowance:
    """A number of actions at once, and so many per second after them."""

    def __init__(self, per_s: float, at_once: float) -> None:
        """Full at the beginning; used on one event loop."""
        self._per_s, self._at_once = per_s, at_once
        self._left = at_once
        self._at_s: float | None = None

    async def use(self) -> None:
        """Use one action, once there is one."""
        now_s = asyncio.get_running_loop().time()
        if self._at_s is not None:
            self._left = min(self._at_once, self._left + (now_s - self._at_s) * self._per_s)
        self._at_s = now_s
        self._left -= 1.0
        if self._left < 0.0:
            await asyncio.sleep(-self._left / self._per_s)


class Repeater:
    """Runs a function in a thread when requested, at most every `REPEAT_S` and never twice at once."""

    def __init__(self, function: Callable[[], None]) -> None:
        """Nothing is requested yet; used on one event loop."""
        self._function = function
        self._task: asyncio.Task[None] | None = None
        self._is_requested = False

    def request(self) -> None:
        """Run the function soon."""
        self._is_requested = True
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        while self._is_requested:
            self._is_requested = False
            await asyncio.to_thread(self._function)
            await asyncio.sleep(REPEAT_S)
