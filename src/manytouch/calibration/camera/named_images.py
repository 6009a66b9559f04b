"""Images for the calibration of a camera, from files, folders, videos and cameras."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.sources import closing_source, open_source
from manytouch.values import Frame

VIDEO_STEP_S = 0.2


def named_images(texts: Sequence[str]) -> Iterator[tuple[str, Frame]]:
    """The images of all inputs with their names; of a video or a camera five per second.

    A file that cannot be opened counts as one image without content if there are other inputs.

    Raises:
        SourceError: an input that is no file, or the only one, cannot be opened.
    """
    for text in texts:
        try:
            source = open_source(text)
        except SourceError:
            if len(texts) == 1 or not Path(text).is_file():
                raise
            yield Path(text).name, Frame(index=0, timestamp_ns=0, camera=text, image=None)
            continue
        if source.capabilities.is_images:
            for path, frame in zip(source.capabilities.files, source, strict=True):
                yield path.name, frame
            continue
        next_ns = None
        with closing_source(source):
            for frame in source:
                if next_ns is None or frame.timestamp_ns >= next_ns:
                    next_ns = frame.timestamp_ns + int(VIDEO_STEP_S * 1e9)
                    yield f"frame {frame.index}", frame
