"""Web page of a running rig, for `manytouch run RIG.toml` (`cli/terminal/rig_run.py`).

It has a table of the sensors, and their viewers as tiles; it is served to this machine only.
"""

import html
import http.server
import json
import threading
from collections.abc import Mapping
from importlib.resources import files
from typing import Any, ClassVar

from manytouch.errors import OutputError
from manytouch.rigs.run_rig import SensorState

_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; style-src 'self'; script-src 'self'; "
    "connect-src 'self'; frame-src http://127.0.0.1:*; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
}
_COLUMNS = ("sensor", "state", "frames per second", "frames", "dropped", "restarts")


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
        script, style = (
            (files("manytouch.rigs") / f"overview_page.{kind}").read_text(encoding="utf-8")
            for kind in ("js", "css")
        )

        class Handler(_Handler):
            content: ClassVar[Mapping[str, Any]] = {
                "/": ("text/html", lambda: page_html(name)),
                "/overview_page.js": ("text/javascript", lambda: script),
                "/overview_page.css": ("text/css", lambda: style),
                "/states": ("application/json", lambda: json.dumps(sensor_rows(states))),
            }

        try:
            self._server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        except OSError as error:
            raise OutputError(
                f"port {port} cannot be used ({error.strerror}): choose another --port"
            ) from error
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_port}/"
        threading.Thread(target=self._server.serve_forever, name="manytouch-rig-page", daemon=True).start()

    @property
    def origin(self) -> str:
        """Scheme, host and port of the page; only it may embed the viewers."""
        return self.url.removesuffix("/")

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()


class _Handler(http.server.BaseHTTPRequestHandler):
    content: ClassVar[Mapping[str, Any]] = {}
    timeout = 5

    def do_GET(self) -> None:
        """Answer requests for the page from this machine."""
        host = (self.headers.get("Host") or "").rpartition(":")[0]
        if self.path not in self.content or host not in ("127.0.0.1", "localhost"):
            self.send_error(404)
            return
        kind, make = self.content[self.path]
        encoded = make().encode()
        self.send_response(200)
        lengths = {"Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(encoded))}
        for key, value in {**_HEADERS, **lengths}.items():
            self.send_header(key, value)
        self.end_headers()
        self.wfile.write(encoded)

    def log_message(self, *_: object) -> None:
        """Print nothing."""


def page_html(name: str) -> str:
    """The page as HTML; its script fills table and tiles every two seconds."""
    title, head = html.escape(name), "".join(f"<th>{column}" for column in _COLUMNS)
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{title}</title>"
        '<meta name=viewport content="width=device-width, initial-scale=1">'
        "<link rel=stylesheet href=/overview_page.css>"
        f"<h1>{title}</h1><table><thead><tr>{head}</thead><tbody id=sensors></tbody></table>"
        "<div id=tiles></div><script src=/overview_page.js></script></html>"
    )


def sensor_rows(states: Mapping[str, SensorState]) -> list[dict[str, object]]:
    """The sensors as the page shows them."""
    return [
        {
            "name": name,
            "state": state.health.source_state,
            "fps": f"{state.health.readings_per_s:.1f}",
            # of earlier processes of the sensor, and of the present one
            "frames": state.frames + state.health.frames,
            "dropped": state.dropped + state.health.dropped,
            "restarts": state.restarts,
            "viewer": state.viewer,
            "sensor_name": state.sensor_name,
        }
        for name, state in states.items()
    ]
