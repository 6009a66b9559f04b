"""The viewer: a page that shows readings live, measures in them and steers the session (extra `view`).

viewer    the sink, in front of all
shot      a reading as a message; `messages` is its form, `measuring` each browser's own measures
hub       the browsers that look; `wishes` what they may ask for
server    files and websocket; `access` who may come in
page/     what runs in the browser

Importing it without nicegui, which brings the server and three.js, raises MissingExtraError.
"""

from importlib.util import find_spec

from manytouch.errors import MissingExtraError

if find_spec("nicegui") is None:
    raise MissingExtraError("the viewer", "nicegui", "view")

from manytouch.sinks.viewer.viewer import Viewer

__all__ = ["Viewer"]
