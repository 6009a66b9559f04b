"""What the name of a source is, and whether its files exist: read from text and file system alone.

Nothing that takes long to import is used here, so that a command refuses a wrong path at once.
"""

import difflib
import re
from collections.abc import Iterable
from pathlib import Path

from manytouch.errors import SourceError, without_password

VIEWS_PREFIX = "views:"
_ADDRESS_AS_PATH = re.compile(
    r"^([A-Za-z][A-Za-z0-9+.-]+):/+"
)  # a path has no empty parts: of // one / is left


def views_of(text: str) -> tuple[str, ...]:
    """The sources that a text with `views:` names; the text itself if it names a single source."""
    if not text.startswith(VIEWS_PREFIX):
        return (text,)
    return tuple(part.strip() for part in text.removeprefix(VIEWS_PREFIX).split(","))


def is_camera(text: str) -> bool:
    """Whether a text names a camera or a stream."""
    if text.startswith(VIEWS_PREFIX):
        return any(is_camera(part) for part in views_of(text))
    if text.isdigit():
        return not Path(text).exists()
    return "://" in text or text.startswith("/dev/video") or Path(text).is_char_device()


def is_stream(text: str) -> bool:
    """Whether a text is the address of a single stream."""
    return "://" in text and not text.startswith(VIEWS_PREFIX)


def unused_rate(text: str, fps: float | None) -> str | None:
    """A warning that a frame rate is given for a single stream, which has that of its sender; else None."""
    if fps is None or not is_stream(text):
        return None
    return (
        f"a frame rate of {fps:g} per second cannot be requested of the stream {without_password(text)}: "
        "--fps is not used; set the rate where the stream is sent"
    )


def split_topic(text: str) -> tuple[str, str | None]:
    """Path and topic of a name `PATH#TOPIC`; None if it has no topic or is the name of a file."""
    path, mark, topic = text.partition("#")
    return (path, topic) if mark and topic and not Path(text).exists() else (text, None)


def require_existing(texts: Iterable[str | Path]) -> None:
    """Check that the files and folders exist that names of sources contain.

    Raises:
        SourceError: one does not, or cannot be read; the message proposes similar names.
    """
    for part in (part for text in texts for part in views_of(str(text))):
        try:
            if not part.strip() or part.startswith("sim:") or is_camera(part):
                continue
            path = Path(split_topic(part)[0]).expanduser()
            if not (path.exists() or Path(part).expanduser().exists()):
                raise SourceError(why_missing(part, path))
        except OSError as error:
            raise SourceError(f"{part!r} cannot be read: {error.strerror or error}.") from error


def require_file(path: Path, what: str) -> None:
    """Check that a file exists.

    Args:
        path: of the file.
        what: to give instead of a folder, such as "a recording (.mcap)".

    Raises:
        SourceError: it does not, or is a folder; the message proposes similar names.
    """
    if path.is_dir():
        raise SourceError(f"{str(path)!r} is a folder: give {what}.")
    if not path.is_file():
        raise SourceError(why_missing(str(path), path))


def why_missing(text: str, path: Path) -> str:
    """The message for a path that does not exist."""
    if _ADDRESS_AS_PATH.match(text):
        address = without_password(_ADDRESS_AS_PATH.sub(r"\1://", text))
        return (
            f"{address!r} is an address, not a file: process a stream by manytouch run, and record it by its "
            "option --record"
        )
    parent = next(parent for parent in path.absolute().parents if parent.is_dir())
    if parent != path.absolute().parent:
        return f"There is no {text!r}, as the path exists up to the folder {str(parent)!r}: check the path."
    names = {child.name.casefold(): child.name for child in parent.iterdir()}
    close = difflib.get_close_matches(path.name.casefold(), names, n=3, cutoff=0.6)
    alike = " or ".join(repr(names[name]) for name in close)
    return f"There is no {text!r} in the folder {str(parent)!r}" + (
        f"; did you mean {alike}?" if alike else ": check the path."
    )
