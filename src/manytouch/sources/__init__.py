"""Sources of frames: cameras, streams, videos, images, recordings and the simulated sensor.

`open_source` selects one by its name; all are iterables of `Frame` that start at the first frame with every
`iter()`. What is computed from frames, and at which pace, is not here.

    for frame in open_source("press.mp4"):
        ...
"""

from manytouch.sources.opening import open_source
from manytouch.sources.source import Capabilities, Source, closing_source, read_frames

__all__ = ["Capabilities", "Source", "closing_source", "open_source", "read_frames"]
