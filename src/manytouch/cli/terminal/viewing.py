"""The viewer beside a session: served, told where, and opened where there is a screen."""

import os
import sys
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass

from manytouch.errors import MissingExtraError
from manytouch.pipeline import Controls
from manytouch.sinks.latest_only import LatestOnly


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where the viewer is served, as the command line asks.

    Attributes:
        host, port, token: see `manytouch.sinks.viewer.Viewer`.
    """

    host: str = "127.0.0.1"
    port: int = 0
    token: str | None = None


def viewers(controls: Controls, place: Place | None, say: Callable[[str], None]) -> list[LatestOnly]:
    """Serve a viewer of a session, say where, and open it where there is a screen.

    Args:
        controls: the session.
        place: where; None serves nothing.
        say: told the address, or what is missing.

    Returns:
        The viewer as a sink, or nothing when there is none.

    Raises:
        OutputError: the address cannot be had.
    """
    if place is None:
        return []
    try:
        from manytouch.sinks.viewer import Viewer

        viewer = Viewer(controls, host=place.host, port=place.port, token=place.token)
    except MissingExtraError as error:
        say(f"no viewer: {error}")
        return []
    say(f"viewer at {viewer.url}")
    if has_screen():
        webbrowser.open(viewer.url)
    return [LatestOnly(viewer)]


def has_screen() -> bool:
    """Is there a display that a browser could open on?"""
    if sys.platform in ("darwin", "win32"):
        return "SSH_CONNECTION" not in os.environ
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
