"""The viewer as a sink: shows readings to all connected browsers."""

import asyncio
import threading
from collections import deque
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from starlette.websockets import WebSocket

from manytouch.pipeline import Controls
from manytouch.sinks.viewer.access import access_to, write_token
from manytouch.sinks.viewer.client_messages import SessionRequest
from manytouch.sinks.viewer.clients import MAX_CLIENTS, Clients
from manytouch.sinks.viewer.recent_contacts import RecentContacts
from manytouch.sinks.viewer.server import Server, listening_socket, page_files
from manytouch.sinks.viewer.update_encoder import UpdateEncoder, ViewerUpdate
from manytouch.sinks.viewer.update_format import number
from manytouch.values import Health, Reading, Resume

HEALTH_INTERVAL_S = 0.25
UPDATE_INTERVAL_S = 1.0 / 90.0
"""Least time between two updates: above the rate of screens, so that a camera of 60 frames/s never waits."""
LATENCIES = 300


class Viewer:
    """Serves the page from its construction until `close`.

    Wrap it in `LatestOnly`, so that the pipeline never waits for it. Without clients only the numbers of the
    contacts are kept, for the curves of a page that is opened later.

    Attributes:
        access: who may use it.
        token_file: contains the token for client programs; None if no folder for it can be written.
    """

    def __init__(
        self,
        controls: Controls,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        max_clients: int = MAX_CLIENTS,
        embedded_in: str | None = None,
    ) -> None:
        """Start serving.

        Args:
            controls: the session that is shown and controlled.
            host: address to listen on; an address that other machines can reach requires a token.
            port: 0 selects a free one.
            token: that all clients must send; None generates one that browsers on this machine need not send.
            max_clients: that are served at once.
            embedded_in: origin of a page on this machine that may show the viewer in a frame; None: none may.

        Raises:
            MissingExtraError: nicegui is not installed.
            OutputError: the address is not available.
        """
        page_files()
        self._controls = controls
        self._encoder = UpdateEncoder(controls.sensor)
        self._sensor_version = controls.health().sensor_version
        self._latest: Reading | None = None
        self._recent = RecentContacts()
        self._number = 0
        self._had_client = False
        self._latency_ms: deque[float] = deque(maxlen=LATENCIES)
        self._lock = threading.Lock()
        self._clients = Clients(self._on_request, self._repeat_update, max_clients)
        listening = listening_socket(host, port)
        self.access = access_to(host, listening.getsockname()[1], token)
        self.token_file = write_token(self.access)
        self._server = Server(
            listening, self.access, self._serve_client, self._broadcast_health, embedded_in=embedded_in
        )

    @property
    def url(self) -> str:
        """The address to open in a browser."""
        return self.access.url

    @property
    def client_count(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    @property
    def layers(self) -> frozenset[str]:
        """The layers that clients display."""
        return self._clients.layers

    @property
    def update_count(self) -> int:
        """Number of updates that were encoded."""
        return self._number

    def write(self, reading: Reading) -> None:
        """Show a reading."""
        self._latest = reading
        self._recent.add(reading)
        if self._clients:
            self._show(reading)

    def close(self) -> None:
        """Announce the end to all clients, stop serving, and remove the file with the token."""
        self._server.stop(self._clients.end())
        if self.token_file is not None:
            self.token_file.unlink(missing_ok=True)

    def _show(self, reading: Reading) -> None:
        with self._lock:
            encoder = self._encoder
            if len(reading.surface.displacement_mm) != len(encoder.layout.rest_mm):
                return  # of the sensor before or after the one that is shown
            update = ViewerUpdate(
                reading=reading,
                comparison=self._controls.comparison(reading.frame.index),
                layers=self._clients.layers,
                is_image_wanted=self._clients.is_image_wanted,
            )
            self._number += 1
            message, latency_ms = encoder(update, self._number)
            if latency_ms is not None:
                self._latency_ms.append(latency_ms)
            self._server.call(
                self._clients.publish,
                self._number,
                message,
                encoder.layout,
                reading.surface,
                reading.frame.index,
            )

    def _repeat_update(self) -> None:
        """Show the newest reading again, for a client that is new or displays something else."""
        reading = self._latest
        if reading is not None:
            self._show(reading)

    def _on_request(self, request: SessionRequest) -> None:
        self._controls.send(request.command())

    async def _serve_client(self, socket: WebSocket) -> None:
        health = self._controls.health()
        if not self._had_client and _is_at_end(health):
            self._controls.send(Resume())  # nobody has seen it
        self._had_client = True
        greeting = [self._scene_info(), _parameters(health), self._health(health), self._recent.message()]
        await self._clients.serve(socket, greeting)

    async def _broadcast_health(self) -> None:
        described: object = None
        while True:
            await asyncio.sleep(HEALTH_INTERVAL_S)
            if not self._clients:
                continue
            health = self._controls.health()
            if health.sensor_version != self._sensor_version:
                await asyncio.to_thread(self._replace_encoder, health.sensor_version)
                self._clients.broadcast(self._scene_info())
            if health.parameter_info is not described:
                described = health.parameter_info
                self._clients.broadcast(_parameters(health))
            self._clients.broadcast(self._health(health))

    def _replace_encoder(self, version: int) -> None:
        encoder = UpdateEncoder(self._controls.sensor)
        with self._lock:
            self._encoder, self._sensor_version = encoder, version

    def _scene_info(self) -> dict[str, Any]:
        return {"kind": "scene_info", **self._encoder.scene_info()}

    def _health(self, health: Health) -> dict[str, Any]:
        numbers = {
            name: number(value, 6) if isinstance(value, float) else value
            for name, value in asdict(replace(health, parameter_info={})).items()
        }
        # the names of these messages are older than those of `Health`
        numbers["source"], numbers["fps"] = numbers.pop("source_state"), numbers.pop("readings_per_s")
        latency = np.percentile(self._latency_ms, (50, 99)) if self._latency_ms else (np.nan, np.nan)
        return {
            "kind": "health",
            **numbers,
            "parameters": {
                name: value if isinstance(value, str) else number(value, 9)
                for name, value in health.parameters.items()
            },
            "clients": len(self._clients),
            "message_ms_p50": number(float(latency[0]), 1),
            "message_ms_p99": number(float(latency[1]), 1),
        }


def _is_at_end(health: Health) -> bool:
    """Whether a playback has come to its end."""
    is_last = (
        health.frame is not None and health.frame_count is not None and health.frame >= health.frame_count - 1
    )
    return is_last and not health.is_running


def _parameters(health: Health) -> dict[str, Any]:
    """What does not change about the parameters while a method is used."""
    return {
        "kind": "parameters",
        "parameters": {name: asdict(info) for name, info in health.parameter_info.items()},
    }
