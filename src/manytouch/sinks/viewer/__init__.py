"""The viewer: a page that shows readings live, measures in them and steers the session (extra `view`).

viewer    the sink, in front of all
shot      a reading as a message; `messages` is its form, `measuring` each browser's own measures
hub       the browsers that look; `wishes` what they may ask for
server    files and websocket; `access` who may come in
page/     what runs in the browser
"""

from manytouch.sinks.viewer.viewer import Viewer

__all__ = ["Viewer"]
