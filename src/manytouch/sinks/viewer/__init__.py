"""The viewer: a web page that shows readings live, measures in them and controls the session.

`viewer` is the sink and the entrance to this package. `update_encoder` turns readings into binary messages
(`update_format`), with what the page shows in addition (`derived`, `health`). `recent_contacts` keeps what
pages that are opened later need; `measuring` evaluates the points that a client chose. `clients` serves every
browser at its own rate (`rate_limit`); `client_messages` lists what a browser may send. `server` serves the
files of `page/` and one websocket, to those whom `access` admits. What a command does is not here but in
`manytouch.session`.

Importing it without nicegui, which provides the server and three.js, raises MissingExtraError.
"""

from importlib.util import find_spec

from manytouch.errors import MissingExtraError

if find_spec("nicegui") is None:
    raise MissingExtraError("the viewer", "nicegui")

from manytouch.sinks.viewer.viewer import UPDATE_INTERVAL_S, Viewer

__all__ = ["UPDATE_INTERVAL_S", "Viewer"]
