"""What this machine can do: packages, codecs, compiled kernels."""

import os
import platform
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import manytouch
from manytouch.session.diagnosis.camera import cameras_in_words
from manytouch.session.methods import kernels
from manytouch.sinks.files.summary import installed
from manytouch.sources.quiet_opencv import cv2

PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "pyarrow", "pydantic")
EXTRAS = {
    "surface": ("zarr", "depth maps, --surface"),
    "plot": ("matplotlib", "pictures of the surface"),
    "record": ("mcap", "recordings, --record"),
    "view": ("nicegui", "viewer"),
}
CODECS = {"MPEG-4": ("mp4v", ".mp4"), "Xvid": ("XVID", ".avi"), "Motion JPEG": ("MJPG", ".avi")}
CODECS |= {"FFV1": ("FFV1", ".avi")}
IMAGES = (".png", ".jpg", ".tif", ".bmp", ".webp")


def machine_in_words() -> Iterator[str]:
    """Lines about this machine."""
    yield f"manytouch {manytouch.__version__}, Python {platform.python_version()}, {platform.platform()}"
    yield f"{os.cpu_count()} processors; one thread per sensor is used"
    yield ", ".join(f"{name} {installed(name) or 'not installed'}" for name in PACKAGES)
    for extra, (package, purpose) in EXTRAS.items():
        found = installed(package)
        remedy = f"not installed: pip install 'manytouch[{extra}]'"
        yield f"extra {extra} ({purpose}): {remedy if found is None else f'{package} {found}'}"
    yield cameras_in_words()
    yield _kernels_in_words()
    yield from _decoding_in_words()


def _kernels_in_words() -> str:
    found = kernels()
    cached = list(found.values()).count(True)
    if cached == len(found):
        return f"compiled kernels: all {len(found)} in the cache"
    return (
        f"compiled kernels: {cached} of {len(found)} in the cache; "
        "the rest is compiled once, when it is first needed"
    )


def _decoding_in_words() -> Iterator[str]:
    library = re.search(r"avcodec:\s+YES \(([\d.]+)\)", cv2.getBuildInformation())
    if library is None:
        yield (
            "videos: this OpenCV has no FFmpeg, so few can be read; "
            "install opencv-python-headless from PyPI, or give folders of images"
        )
    else:
        yield f"videos: OpenCV {cv2.__version__} with FFmpeg (avcodec {library[1]}), also H.264 and H.265"
    tried = {name: round_trip(code, suffix) for name, (code, suffix) in CODECS.items()}
    works = [name for name, good in tried.items() if good]
    fails = [name for name, good in tried.items() if not good]
    yield f"written and read back here: {', '.join(works) or 'none'}" + (
        f"; not: {', '.join(fails)}" if fails else ""
    )
    known = [suffix[1:] for suffix in IMAGES if cv2.haveImageWriter(suffix)]
    yield f"images: {', '.join(known)}, 8 and 16 bit"


def round_trip(code: str, suffix: str) -> bool:
    """Can a short film of this codec be written and read again?"""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"film{suffix}"
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), 25.0, (64, 48))
        for level in (40, 200):
            writer.write(np.full((48, 64, 3), level, np.uint8))
        writer.release()
        reader = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        decoded, image = reader.read()
        reader.release()
    return bool(decoded) and image is not None and image.shape == (48, 64, 3)
