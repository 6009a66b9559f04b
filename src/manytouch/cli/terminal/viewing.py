"""The viewer of a session: started, its address printed, and opened if there is a screen."""

import os
import sys
import webbrowser
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from manytouch.cli.terminal.options import HOST, MAX_CLIENTS
from manytouch.errors import MissingExtraError
from manytouch.pipeline import Controls
from manytouch.sinks.latest_only import LatestOnly


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewerAddress:
    """Requested address of the viewer.

    Attributes:
        host, port, token, max_clients: see `manytouch.sinks.viewer.Viewer`.
    """

    host: str = HOST
    port: int = 0
    token: str | None = None
    max_clients: int = MAX_CLIENTS


def viewers(
    controls: Controls, address: ViewerAddress | None, report: Callable[[str], None]
) -> list[LatestOnly]:
    """Start a viewer of a session, print its address, and open it if there is a screen.

    Args:
        controls: the session.
        address: None starts no viewer.
        report: prints the address, or why there is no viewer.

    Returns:
        The viewer as a sink; empty if there is none.

    Raises:
        OutputError: the address is not available.
    """
    if address is None:
        return []
    try:
        from manytouch.sinks.viewer import UPDATE_INTERVAL_S, Viewer

        viewer = Viewer(controls, **asdict(address))
    except MissingExtraError as error:
        report(f"no viewer: {error}")
        return []
    report(f"viewer at {viewer.url}")
    if viewer.token_file is not None:
        report(f"token for client programs in {viewer.token_file}")
    if has_screen():
        webbrowser.open(viewer.url)
    return [LatestOnly(viewer, interval_s=UPDATE_INTERVAL_S)]


def has_screen() -> bool:
    """Whether there is a display on which a browser can open."""
    if sys.platform in ("darwin", "win32"):
        return "SSH_CONNECTION" not in os.environ
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def is_playback(source: str, *options_given: object) -> bool:
    """Whether the stored readings of a recording are shown, because no option requires processing."""
    from manytouch.source_names import split_topic
    from manytouch.sources.files.log import is_log

    bare, topic = split_topic(source)
    is_recording = bare.lower().endswith(".mcap") and not is_log(Path(bare))
    is_topic = topic is not None and topic.startswith("/")  # else a sensor of a rig
    return is_recording and not is_topic and not any(options_given)
