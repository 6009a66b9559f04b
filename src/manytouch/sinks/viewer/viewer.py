"""The viewer as a sink: shows readings to every browser that looks."""

import asyncio
import threading
from collections import deque
from dataclasses import asdict
from typing import Any

import numpy as np
from starlette.websockets import WebSocket

from manytouch.pipeline import Controls
from manytouch.sinks.viewer.access import Access, token_for
from manytouch.sinks.viewer.client_messages import Order, Wish
from manytouch.sinks.viewer.hub import Hub
from manytouch.sinks.viewer.messages import number
from manytouch.sinks.viewer.server import Server, listening_socket, page_files
from manytouch.sinks.viewer.update_encoder import Shot, UpdateEncoder
from manytouch.values import Health, Reading

HEALTH_EVERY_S = 0.25
LATENCIES = 300


class Viewer:
    """Serves the page from its construction until `close`.

    To be put behind `LatestOnly`, so that the pipeline never waits. Without browsers a reading costs nothing.
    """

    def __init__(
        self, controls: Controls, *, host: str = "127.0.0.1", port: int = 0, token: str | None = None
    ) -> None:
        """Start serving.

        Args:
            controls: the session that is looked at and steered.
            host: address to listen on; others than loopback addresses get a token.
            port: 0 takes a free one.
            token: what visitors must show; None makes one where others can reach us.

        Raises:
            MissingExtraError: nicegui is not installed.
            OutputError: the address cannot be had.
        """
        page_files()
        self._controls = controls
        self._photographer = UpdateEncoder(controls.sensor)
        self._sensor_version = controls.health().sensor_version
        self._latest: Reading | None = None
        self._number = 0
        self._latency_ms: deque[float] = deque(maxlen=LATENCIES)
        self._one_at_a_time = threading.Lock()
        self._hub = Hub(self._order, self._ask_again)
        listening = listening_socket(host, port)
        self.access = Access(host=host, port=listening.getsockname()[1], token=token_for(host, token))
        self._server = Server(listening, self.access, self._visit, self._tell_health)

    @property
    def url(self) -> str:
        """What to open in a browser."""
        return self.access.url

    @property
    def browsers(self) -> int:
        """How many look at present."""
        return len(self._hub)

    def write(self, reading: Reading) -> None:
        """Show a reading."""
        self._latest = reading
        if self._hub:
            self._show(reading)

    def close(self) -> None:
        """Tell the browsers that this was the end, and stop serving."""
        self._server.stop(self._hub.end())

    def _show(self, reading: Reading) -> None:
        with self._one_at_a_time:
            photographer = self._photographer
            if len(reading.surface.displacement_mm) != len(photographer.layout.rest_mm):
                return  # of a sensor before or after the one that is shown
            shot = Shot(
                reading=reading,
                beside=self._controls.beside(reading.frame.index),
                layers=self._hub.layers,
                is_image_wanted=self._hub.is_image_wanted,
            )
            self._number += 1
            message, latency_ms = photographer(shot, self._number)
            if latency_ms is not None:
                self._latency_ms.append(latency_ms)
            self._server.call(
                self._hub.offer,
                self._number,
                message,
                photographer.layout,
                reading.surface,
                reading.frame.index,
            )

    def _ask_again(self) -> None:
        """The present moment once more, for somebody who came or wants to see something else."""
        reading = self._latest
        if reading is not None and self._server.loop is not None:
            self._server.loop.run_in_executor(None, self._show, reading)

    def _order(self, wish: Wish) -> None:
        if isinstance(wish, Order):
            self._controls.send(wish.command())

    async def _visit(self, socket: WebSocket) -> None:
        greeting = [self._scenery(), self._health(self._controls.health())]
        await self._hub.serve(socket, greeting)

    async def _tell_health(self) -> None:
        while True:
            await asyncio.sleep(HEALTH_EVERY_S)
            if not self._hub:
                continue
            health = self._controls.health()
            if health.sensor_version != self._sensor_version:
                await asyncio.to_thread(self._renew, health.sensor_version)
                self._hub.say(self._scenery())
            self._hub.say(self._health(health))

    def _renew(self, version: int) -> None:
        photographer = UpdateEncoder(self._controls.sensor)
        with self._one_at_a_time:
            self._photographer, self._sensor_version = photographer, version

    def _scenery(self) -> dict[str, Any]:
        return {"kind": "scenery", **self._photographer.scenery()}

    def _health(self, health: Health) -> dict[str, Any]:
        numbers = {
            name: number(value, 6) if isinstance(value, float) else value
            for name, value in asdict(health).items()
        }
        latency = np.percentile(self._latency_ms, (50, 99)) if self._latency_ms else (np.nan, np.nan)
        return {
            "kind": "health",
            **numbers,
            "parameters": {name: number(value, 9) for name, value in health.parameters.items()},
            "browsers": len(self._hub),
            "message_ms_p50": number(float(latency[0]), 1),
            "message_ms_p99": number(float(latency[1]), 1),
        }
