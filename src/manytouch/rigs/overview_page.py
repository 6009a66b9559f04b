"""A page that lists the sensors of a running rig, with links to their viewers, for this machine only."""

import html
import http.server
import threading
from collections.abc import Mapping
from typing import ClassVar

from manytouch.errors import OutputError
from manytouch.rigs.run_rig import SensorState

_HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
}
_STYLE = "body{font-family:sans-serif;margin:2em}td,th{padding:.4em 1em;text-align:left}"


class OverviewPage:
    """Serves the page in a thread until it is closed.

    Attributes:
        url: of the page.
    """

    def __init__(self, name: str, states: Mapping[str, SensorState], port: int = 0) -> None:
        """Begin to serve.

        Args:
            name: of the rig.
            states: of its sensors, which change while it runs.
            port: 0 chooses a free one.

        Raises:
            OutputError: the port is in use.
        """

        class Handler(_Handler):
            content = staticmethod(lambda: overview(name, states))

        try:
            self._server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        except OSError as error:
            raise OutputError(
                f"port {port} cannot be used ({error.strerror}): choose another --port"
            ) from error
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_port}/"
        threading.Thread(target=self._server.serve_forever, name="manytouch-rig-page", daemon=True).start()

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()


class _Handler(http.server.BaseHTTPRequestHandler):
    content: ClassVar = staticmethod(str)
    timeout = 5

    def do_GET(self) -> None:
        """Answer requests for the page from this machine."""
        host = (self.headers.get("Host") or "").rpartition(":")[0]
        if self.path != "/" or host not in ("127.0.0.1", "localhost"):
            self.send_error(404)
            return
        encoded = self.content().encode()
        self.send_response(200)
        for key, value in {**_HEADERS, "Content-Length": str(len(encoded))}.items():
            self.send_header(key, value)
        self.end_headers()
        self.wfile.write(encoded)

    def log_message(self, *_: object) -> None:
        """Print nothing."""


def overview(name: str, states: Mapping[str, SensorState]) -> str:
    """The page as HTML, which a browser loads again every two seconds."""
    rows = "".join(_row(sensor, state) for sensor, state in states.items())
    title = html.escape(name)
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><meta http-equiv=refresh content=2><title>{title}"
        f"</title><style>{_STYLE}</style><h1>{title}</h1><table><tr><th>sensor<th>state<th>frames per second"
        f"<th>frames<th>dropped<th>restarts</tr>{rows}</table></html>"
    )


def _row(name: str, state: SensorState) -> str:
    health, shown = state.health, html.escape(name)
    viewer = state.viewer
    link = shown if viewer is None else f'<a href="{html.escape(viewer)}" target="_blank">{shown}</a>'
    numbers = (state.frames + health.frames, state.dropped + health.dropped, state.restarts)
    cells = (link, html.escape(health.source), f"{health.fps:.1f}", *map(str, numbers))
    return f"<tr>{''.join(f'<td>{cell}' for cell in cells)}</tr>"
