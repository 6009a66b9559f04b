"""The browsers that look at present, each served at its own pace."""

import asyncio
import json
from collections import deque
from collections.abc import Callable
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from manytouch.sinks.viewer.client_messages import Ack, Points, Show, Wish, read_wish
from manytouch.sinks.viewer.measuring import Measurement, measure_at
from manytouch.values import Layout, Surface

MOST_IN_FLIGHT = 3
MOST_SENTENCES = 64


class Browser:
    """One of them: what it shows, what it measures, and what waits to be sent to it.

    Only the newest update waits. A browser says which update it has taken in and gets no more than
    `MOST_IN_FLIGHT` ahead of that, so a slow one sees fewer updates, never old ones.
    """

    def __init__(self, socket: WebSocket) -> None:
        self.socket = socket
        self.layer, self.is_image_wanted = "depth", True
        self.points: Points | None = None
        self._measure: tuple[Layout, Measurement] | None = None
        self._sentences: deque[str] = deque(maxlen=MOST_SENTENCES)
        self._update: tuple[int, bytes] | None = None
        self._sent = self._taken = 0
        self._wake = asyncio.Event()

    def say(self, sentence: dict[str, Any]) -> None:
        """Send a head without parts, as text."""
        self._sentences.append(json.dumps(sentence, allow_nan=False, separators=(",", ":")))
        self._wake.set()

    @property
    def is_waiting(self) -> bool:
        """Is something said and not yet sent?"""
        return bool(self._sentences)

    def offer(self, number: int, message: bytes) -> None:
        """Replace the update that waits."""
        self._update = (number, message)
        self._wake.set()

    def took(self, number: int) -> None:
        """It has taken in an update."""
        self._taken = max(self._taken, min(number, self._sent))
        self._wake.set()

    def measure(self, layout: Layout, surface: Surface) -> dict[str, Any] | None:
        """What it measures now; None where nothing is chosen."""
        if self.points is None or not self.points.point_mm:
            return None
        if self._measure is None or self._measure[0] is not layout:
            self._measure = (layout, measure_at(layout, self.points.points()))
        return self._measure[1](surface)

    def choose(self, points: Points) -> None:
        """Measure at other points from now on."""
        self.points, self._measure = points, None

    async def send(self) -> None:
        """Send what waits, until the browser goes."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._sentences:
                await self.socket.send_text(self._sentences.popleft())
            if self._update is not None and self._sent - self._taken < MOST_IN_FLIGHT:
                (number, message), self._update = self._update, None
                if self._sent == 0:
                    self._taken = number - 1
                self._sent = number
                await self.socket.send_bytes(message)


class Hub:
    """All browsers. Used on the server's loop; `layers`, `is_image_wanted` may be read from any thread."""

    def __init__(self, order: Callable[[Wish], None], again: Callable[[], None]) -> None:
        """`order` takes wishes that are not for the hub, `again` asks for the present moment once more."""
        self._order, self._again = order, again
        self._browsers: frozenset[Browser] = frozenset()

    def __len__(self) -> int:
        return len(self._browsers)

    @property
    def layers(self) -> frozenset[str]:
        """What the surfaces are coloured by."""
        return frozenset(browser.layer for browser in self._browsers)

    @property
    def is_image_wanted(self) -> bool:
        """Does anybody show the camera's picture?"""
        return any(browser.is_image_wanted for browser in self._browsers)

    def say(self, sentence: dict[str, Any]) -> None:
        """Tell all."""
        for browser in self._browsers:
            browser.say(sentence)

    async def end(self) -> None:
        """Tell all that nothing more comes, and give them a moment to hear it."""
        self.say({"kind": "end"})
        for _ in range(50):
            if not any(browser.is_waiting for browser in self._browsers):
                break
            await asyncio.sleep(0.01)

    def offer(self, number: int, message: bytes, layout: Layout, surface: Surface, frame: int) -> None:
        """Show all a new moment, with each one's own measures."""
        for browser in self._browsers:
            measured = browser.measure(layout, surface)
            if measured is not None:
                browser.say({"kind": "measure", "frame": frame, **measured})
            browser.offer(number, message)

    async def serve(self, socket: WebSocket, greeting: list[dict[str, Any]]) -> None:
        """Serve a browser until it goes."""
        browser = Browser(socket)
        for sentence in greeting:
            browser.say(sentence)
        self._browsers |= {browser}
        self._again()
        sending = asyncio.create_task(browser.send())
        listening = asyncio.create_task(self._listen(browser))
        try:
            done, _ = await asyncio.wait({sending, listening}, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                if not isinstance(task.exception(), WebSocketDisconnect | None):
                    task.result()
        finally:
            self._browsers -= {browser}
            for task in (sending, listening):
                task.cancel()
            await asyncio.gather(sending, listening, return_exceptions=True)

    async def _listen(self, browser: Browser) -> None:
        while True:
            wish = read_wish(await browser.socket.receive_text())
            match wish:
                case None:
                    browser.say({"kind": "note", "text": "the viewer did not understand its own page"})
                case Ack(number=number):
                    browser.took(number)
                case Points():
                    browser.choose(wish)
                    self._again()
                case Show(layer=layer, image=image):
                    browser.layer, browser.is_image_wanted = layer, image
                    self._again()
                case _:
                    self._order(wish)
