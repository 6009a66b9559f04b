"""The viewer's web server: a fixed set of files and one websocket, in a thread of its own."""

import asyncio
import importlib.util
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
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
RULES = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-cache",
}
START_S = STOP_S = 5.0


def page_files() -> dict[str, tuple[str, bytes]]:
    """Name -> media type and content of everything that can be asked for.

    Raises:
        MissingExtraError: nicegui, which brings the server and three.js, is not installed.
    """
    files = {
        path.name: (TYPES[path.suffix], path.read_bytes()) for path in PAGE.iterdir() if path.suffix in TYPES
    }
    found = importlib.util.find_spec("nicegui")
    places = [] if found is None else list(found.submodule_search_locations or [])
    bundles = [path for place in places if (path := Path(place, "elements/scene/dist/index.js")).is_file()]
    if not bundles:
        raise MissingExtraError("the viewer", "nicegui", "view")
    return files | {"three.js": (TYPES[".js"], bundles[0].read_bytes())}


def listening_socket(host: str, port: int) -> socket.socket:
    """A socket that others can connect to from now on; port 0 takes a free one.

    Raises:
        OutputError: the address cannot be had.
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
            "give another --port, or none to take a free one, and a --host of this machine"
        ) from None
    return listening


class Server:
    """Serves from its construction until `stop`."""

    def __init__(
        self,
        listening: socket.socket,
        access: Access,
        visit: Callable[[WebSocket], Awaitable[None]],
        background: Callable[[], Coroutine[Any, Any, None]],
    ) -> None:
        """`visit` serves a websocket, `background` runs beside it on the server's loop."""
        self._files = page_files()
        self._access, self._visit, self._background = access, visit, background
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
        """Call something on the server's loop, from any thread; not after the end."""
        if self.loop is not None and not self._server.should_exit:
            self.loop.call_soon_threadsafe(function, *arguments)

    def stop(self, farewell: Coroutine[Any, Any, None]) -> None:
        """Run a last task, close all connections and end the thread; nothing the second time."""
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
        if given is None or not self._access.has_token(given):
            return self._answer(request, "index.html")
        answer = RedirectResponse("/", status_code=303, headers=RULES)
        answer.set_cookie(COOKIE, given, httponly=True, samesite="strict")
        return answer

    async def _file(self, request: Request) -> Response:
        return self._answer(request, str(request.path_params["name"]))

    def _answer(self, request: Request, name: str) -> Response:
        if not self._access.is_known_host(request.headers):
            return PlainTextResponse("this viewer is not known by that name\n", 421, headers=RULES)
        if not self._access.has_token(request.cookies.get(COOKIE)):
            words = "this viewer asks for a token: open the address that manytouch printed\n"
            return PlainTextResponse(words, 403, headers=RULES)
        if name not in self._files:
            return PlainTextResponse("there is no such file\n", 404, headers=RULES)
        kind, content = self._files[name]
        return Response(content, media_type=kind, headers=RULES)

    async def _stream(self, socket: WebSocket) -> None:
        access = self._access
        given = socket.cookies.get(COOKIE) or socket.query_params.get("token")
        is_welcome = access.is_known_host(socket.headers) and access.is_own_origin(socket.headers)
        if not (is_welcome and access.has_token(given)):
            await socket.close(1008)
            return
        await socket.accept()
        await self._visit(socket)
