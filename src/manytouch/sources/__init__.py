"""Where frames come from: video files, images, folders of images and the simulated sensor.

All look alike: an iterable of `Frame` that starts anew with every `iter()`.

    for frame in open_source("press.mp4"):
        ...
"""

from manytouch.sources.opening import open_source
from manytouch.sources.source import Source

__all__ = ["Source", "open_source"]
