"""The connected browsers, each served at its own rate."""

import asyncio
import json
import logging
from collections import deque
from collections.abc import Callable
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from manytouch.sinks.viewer.client_messages import (
    Ack,
    MeasureRequest,
    SessionRequest,
    ShowRequest,
    parse_client_message,
)
from manytouch.sinks.viewer.measuring import Measurement, measure_at
from manytouch.sinks.viewer.rate_limit import (
    MESSAGES_PER_S,
    REQUESTS_AT_ONCE,
    REQUESTS_PER_S,
    Allowance,
    Repeater,
)
from manytouch.values import Layout, Surface
from manytouch.values.commands import command_kind

MAX_CLIENTS = 16
MAX_IN_FLIGHT = 3
MAX_QUEUED = MAX_REQUESTS = 64
UNSUPPORTED_DATA, TRY_AGAIN_LATER = 1003, 1013  # close codes, RFC 6455 and its registry

log = logging.getLogger(__name__)


class Client:
    """One browser: what it displays and measures, what is queued for it, and what it requests.

    Only the newest update is queued. A client acknowledges updates and is never more than `MAX_IN_FLIGHT`
    behind, so a slow one receives fewer updates, never old ones. Of its requests the newest of each kind
    wait until the client may be heard again.
    """

    def __init__(self, socket: WebSocket) -> None:
        self.socket = socket
        self.layer, self.is_image_wanted = "depth", True
        self.is_rejected = False
        self._points: MeasureRequest | None = None
        self._measurement: tuple[Layout, Measurement] | None = None
        self._queue: deque[str] = deque(maxlen=MAX_QUEUED)
        self._update: tuple[int, bytes] | None = None
        self._sent = self._acknowledged = 0
        self._wake = asyncio.Event()
        self._requests: dict[tuple[str, int | str], SessionRequest] = {}
        self._has_request = asyncio.Event()

    def queue(self, message: dict[str, Any]) -> None:
        """Queue a message without arrays, which is sent as JSON text."""
        self._queue.append(json.dumps(message, allow_nan=False, separators=(",", ":")))
        self._wake.set()

    @property
    def has_queued(self) -> bool:
        """Whether text messages have not been sent yet."""
        return bool(self._queue)

    def set_update(self, number: int, message: bytes) -> None:
        """Replace the queued update."""
        self._update = (number, message)
        self._wake.set()

    def acknowledge(self, number: int) -> None:
        """Record that the client has received an update."""
        self._acknowledged = max(self._acknowledged, min(number, self._sent))
        self._wake.set()

    def measure(self, layout: Layout, surface: Surface) -> dict[str, Any] | None:
        """The measurement of this client; None if it has chosen no point."""
        if self._points is None or not self._points.point_mm:
            return None
        if self._measurement is None or self._measurement[0] is not layout:
            self._measurement = (layout, measure_at(layout, self._points.points()))
        return self._measurement[1](surface)

    def choose(self, points: MeasureRequest) -> None:
        """Measure at other points from now on."""
        self._points, self._measurement = points, None

    def request(self, request: SessionRequest) -> None:
        """Request something of the session, in place of a request of the same kind that still waits."""
        kind = command_kind(request.command())
        self._requests.pop(kind, None)
        if len(self._requests) < MAX_REQUESTS:
            self._requests[kind] = request
            self._has_request.set()

    async def pass_on(self, on_request: Callable[[SessionRequest], None]) -> None:
        """Pass requests on to the session, at the allowed rate, until the connection ends."""
        allowance = Allowance(REQUESTS_PER_S, REQUESTS_AT_ONCE)
        while True:
            await self._has_request.wait()
            await allowance.use()
            on_request(self._requests.pop(next(iter(self._requests))))
            if not self._requests:
                self._has_request.clear()

    async def send(self) -> None:
        """Send what is queued, until the connection ends."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._queue:
                await self.socket.send_text(self._queue.popleft())
            if self._update is not None and self._sent - self._acknowledged < MAX_IN_FLIGHT:
                (number, message), self._update = self._update, None
                if self._sent == 0:
                    self._acknowledged = number - 1
                self._sent = number
                await self.socket.send_bytes(message)


class Clients:
    """All clients. Used on the loop of the server; the properties can be read from any thread."""

    def __init__(
        self,
        on_request: Callable[[SessionRequest], None],
        repeat_update: Callable[[], None],
        max_clients: int = MAX_CLIENTS,
    ) -> None:
        """Begin without clients.

        Args:
            on_request: receives requests for the session.
            repeat_update: sends the newest update again, for a client that is new or displays something else;
                called in a thread.
            max_clients: beyond them a connection is closed with `TRY_AGAIN_LATER`.
        """
        self._on_request, self._repeat = on_request, Repeater(repeat_update)
        self._max_clients = max_clients
        self._clients: frozenset[Client] = frozenset()

    def __len__(self) -> int:
        return len(self._clients)

    @property
    def layers(self) -> frozenset[str]:
        """The layers that are displayed."""
        return frozenset(client.layer for client in self._clients)

    @property
    def is_image_wanted(self) -> bool:
        """Whether any client displays the camera image."""
        return any(client.is_image_wanted for client in self._clients)

    def broadcast(self, message: dict[str, Any]) -> None:
        """Queue a text message for all clients."""
        for client in self._clients:
            client.queue(message)

    async def end(self) -> None:
        """Announce the end to all clients, and give the message up to half a second to be sent."""
        self.broadcast({"kind": "end"})
        for _ in range(50):
            if not any(client.has_queued for client in self._clients):
                break
            await asyncio.sleep(0.01)

    def publish(self, number: int, message: bytes, layout: Layout, surface: Surface, frame: int) -> None:
        """Queue an update for all clients, with the measurement of each."""
        for client in self._clients:
            measured = client.measure(layout, surface)
            if measured is not None:
                client.queue({"kind": "measurement", "frame": frame, **measured})
            client.set_update(number, message)

    async def serve(self, socket: WebSocket, greeting: list[dict[str, Any]]) -> None:
        """Serve a client until its connection ends."""
        if len(self._clients) >= self._max_clients:
            await socket.close(
                TRY_AGAIN_LATER, f"{len(self._clients)} clients are connected, the most allowed"
            )
            return
        client = Client(socket)
        for message in greeting:
            client.queue(message)
        self._clients |= {client}
        self._repeat.request()
        tasks = {
            asyncio.create_task(work)
            for work in (client.send(), client.pass_on(self._on_request), self._receive(client))
        }
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                if not isinstance(task.exception(), WebSocketDisconnect | None):
                    task.result()
        finally:
            self._clients -= {client}
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            if client.is_rejected:  # after sending has stopped, which fails on a closed connection
                await socket.close(UNSUPPORTED_DATA, "text messages only")

    async def _receive(self, client: Client) -> None:
        """Carry out the messages of a client, until it disconnects or sends binary data."""
        allowance = Allowance(MESSAGES_PER_S, MESSAGES_PER_S)
        while True:
            await allowance.use()
            received = await client.socket.receive()
            if received["type"] == "websocket.disconnect":
                return
            text = received.get("text")
            if text is None:
                log.warning("closed a viewer connection: it sent binary data")
                client.is_rejected = True
                return
            self._handle(client, text)

    def _handle(self, client: Client, text: str) -> None:
        match parse_client_message(text):
            case None:
                client.queue({"kind": "note", "text": "invalid viewer message"})
            case Ack(number=number):
                client.acknowledge(number)
            case MeasureRequest() as points:
                client.choose(points)
                self._repeat.request()
            case ShowRequest(layer=layer, image=image):
                if (layer, image) != (client.layer, client.is_image_wanted):
                    client.layer, client.is_image_wanted = layer, image
                    self._repeat.request()
            case request:
                client.request(request)
