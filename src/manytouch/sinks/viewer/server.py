"""The web server of the viewer: a fixed set of files and one websocket, in its own thread."""

import asyncio
import importlib.util
import logging
import socket
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from manytouch.errors import MissingExtraError, OutputError
from manytouch.sinks.viewer.access import COOKIE, Access

PAGE = Path(__file__).parent / "page"
MEDIA_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
SECURITY_HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-cache",
}
START_S = STOP_S = 5.0
POLICY_VIOLATION = 1008  # close code, RFC 6455

log = logging.getLogger(__name__)


def page_files() -> dict[str, tuple[str, bytes]]:
    """Media type and content of every file that is served, by name.

    Raises:
        MissingExtraError: nicegui, which provides the server and three.js, is not installed.
    """
    files = {
        path.name: (MEDIA_TYPES[path.suffix], path.read_bytes())
        for path in PAGE.iterdir()
        if path.suffix in MEDIA_TYPES
    }
    found = importlib.util.find_spec("nicegui")
    places = [] if found is None else list(found.submodule_search_locations or [])
    bundles = [path for place in places if (path := Path(place, "elements/scene/dist/index.js")).is_file()]
    if not bundles:
        raise MissingExtraError("the viewer", "nicegui")
    return files | {"three.js": (MEDIA_TYPES[".js"], bundles[0].read_bytes())}


def listening_socket(host: str, port: int) -> socket.socket:
    """Open a socket that clients can connect to; port 0 selects a free one.

    Raises:
        OutputError: the address is not available.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen()
    except (OSError, OverflowError) as error:
        listening.close()
        raise OutputError(
            f"the viewer cannot listen on {host} port {port} ({error}); "
            "specify another --port, or none to select a free one, and a --host of this machine"
        ) from None
    return listening


class Server:
    """Serves from its construction until `stop`."""

    def __init__(
        self,
        listening: socket.socket,
        access: Access,
        serve_client: Callable[[WebSocket], Awaitable[None]],
        background: Callable[[], Coroutine[Any, Any, None]],
        *,
        embedded_in: str | None = None,
    ) -> None:
        """Start the server.

        Args:
            listening: the socket to listen on.
            access: which requests are admitted.
            serve_client: serves one websocket until it ends.
            background: runs on the loop of the server until it stops.
            embedded_in: origin of a page that may show this one in a frame; None: none may.

        Raises:
            OutputError: the server did not start within `START_S`.
        """
        self._files = page_files()
        policy = SECURITY_HEADERS["content-security-policy"]
        if embedded_in is not None:
            policy = policy.replace("frame-ancestors 'none'", f"frame-ancestors {embedded_in}")
        self._headers = {**SECURITY_HEADERS, "content-security-policy": policy}
        self._access, self._serve_client, self._background = access, serve_client, background
        self._has_begun = threading.Event()
        self.loop: asyncio.AbstractEventLoop | None = None
        self._socket = listening
        self._server = uvicorn.Server(
            uvicorn.Config(
                self._application(),
                loop="asyncio",
                http="h11",
                ws="websockets-sansio",
                ws_max_size=2**16,
                ws_per_message_deflate=False,
                log_config=None,
                access_log=False,
                server_header=False,
                timeout_graceful_shutdown=1,
            )
        )
        self._thread = threading.Thread(
            target=self._server.run, args=([listening],), name="viewer server", daemon=True
        )
        self._thread.start()
        if not self._has_begun.wait(START_S):
            raise OutputError(f"the viewer's server did not start within {START_S:g} s on {access.url}")

    def call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Call a function on the loop of the server, from any thread; does nothing after `stop`."""
        if self.loop is not None and not self._server.should_exit:
            self.loop.call_soon_threadsafe(function, *arguments)

    def stop(self, farewell: Coroutine[Any, Any, None]) -> None:
        """Run a last task, close all connections and end the thread; does nothing when called again."""
        if self.loop is None or self._server.should_exit:
            farewell.close()
            return
        asyncio.run_coroutine_threadsafe(farewell, self.loop).result(STOP_S)
        self._server.should_exit = True
        self._thread.join(STOP_S)
        self._socket.close()

    def _application(self) -> Starlette:
        @asynccontextmanager
        async def lifespan(_: Starlette) -> AsyncIterator[None]:
            self.loop = asyncio.get_running_loop()
            task = asyncio.create_task(self._background())
            self._has_begun.set()
            yield
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

        return Starlette(
            routes=[
                WebSocketRoute("/stream", self._stream),
                Route("/", self._page),
                Route("/{name}", self._file),
            ],
            lifespan=lifespan,
        )

    async def _page(self, request: Request) -> Response:
        """The page; a token in its address becomes a cookie, so that it does not stay in the history."""
        given = request.query_params.get("token")
        if given is not None and not given.isascii():
            return _bad_request("the token is not ASCII")
        if given is None or not (self._access.is_token_required and self._access.is_token(given)):
            return self._respond(request, "index.html")
        answer = RedirectResponse("/", status_code=303, headers=self._headers)
        answer.set_cookie(COOKIE, given, httponly=True, samesite="strict")
        return answer

    async def _file(self, request: Request) -> Response:
        return self._respond(request, str(request.path_params["name"]))

    def _respond(self, request: Request, name: str) -> Response:
        try:
            is_known = self._access.is_known_host(request.headers)
        except ValueError:
            return _bad_request("the Host header is not valid")
        if not is_known:
            text = "this viewer does not answer to that host name; open the address that manytouch printed\n"
            return PlainTextResponse(text, 421, headers=self._headers)
        if not self._access.may_open_page(request.cookies):
            text = "this viewer requires a token; open the address that manytouch printed\n"
            return PlainTextResponse(text, 403, headers=self._headers)
        if name not in self._files:
            return PlainTextResponse("this file does not exist\n", 404, headers=self._headers)
        kind, content = self._files[name]
        return Response(content, media_type=kind, headers=self._headers)

    async def _stream(self, socket: WebSocket) -> None:
        try:
            is_admitted = self._access.may_stream(socket.headers, socket.cookies)
        except ValueError:
            log.warning("refused a viewer connection: the Host header is not valid")
            is_admitted = False
        if not is_admitted:
            await socket.close(POLICY_VIOLATION)
            return
        await socket.accept()
        await self._serve_client(socket)


def _bad_request(reason: str) -> Response:
    log.warning("refused a viewer request: %s", reason)
    return PlainTextResponse(f"bad request: {reason}\n", 400, headers=SECURITY_HEADERS)
