"""Lines of text about this installation: packages, compiled kernels, codecs."""

import os
import platform
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import manytouch
from manytouch.session.diagnosis.camera import describe_cameras, describe_usb_buses
from manytouch.session.methods import kernels
from manytouch.simulation.solve_scene import states_folder
from manytouch.sinks.files.summary import installed
from manytouch.sources.quiet_opencv import cv2

PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "pyarrow", "pydantic")
EXTRAS = {
    "lab": (("matplotlib", "jinja2", "zarr"), "plots, reports, depth maps"),
    "parts": (("manifold3d", "trimesh", "build123d"), "parts to print"),
    "connect": (
        ("rosbags", "cyclonedds", "foxglove-sdk", "python-osc", "mido", "h5py"),
        "outputs to other programs, exports",
    ),
    "batch": (
        ("distributed", "dask-jobqueue", "fsspec", "s3fs", "gcsfs", "aiohttp"),
        "clusters, object stores",
    ),
}
CODECS = {"MPEG-4": ("mp4v", ".mp4"), "Xvid": ("XVID", ".avi"), "Motion JPEG": ("MJPG", ".avi")}
CODECS |= {"FFV1": ("FFV1", ".avi")}
IMAGES = (".png", ".jpg", ".tif", ".bmp", ".webp")


def describe_installation() -> Iterator[str]:
    """Lines about versions, extras, cameras, kernels and codecs of this installation."""
    yield f"manytouch {manytouch.__version__}, Python {platform.python_version()}, {platform.platform()}"
    yield f"{os.cpu_count()} processors; each sensor uses one thread"
    yield ", ".join(f"{name} {installed(name) or 'not installed'}" for name in PACKAGES)
    for extra, (packages, purpose) in EXTRAS.items():
        missing = [package for package in packages if installed(package) is None]
        found = ", ".join(f"{package} {installed(package)}" for package in packages if package not in missing)
        remedy = f"{', '.join(missing)} not installed: run pip install 'manytouch[{extra}]'"
        yield f"extra {extra} ({purpose}): {remedy if missing else found}"
    yield describe_cameras()
    yield from describe_usb_buses()
    yield _describe_kernels()
    yield f"solved simulations in {states_folder()}"
    yield from _describe_codecs()


def _describe_kernels() -> str:
    found = kernels()
    cached = list(found.values()).count(True)
    if cached == len(found):
        return f"compiled kernels: all {len(found)} in the cache"
    return (
        f"compiled kernels: {cached} of {len(found)} in the cache; "
        "the others are compiled when they are first needed"
    )


def _describe_codecs() -> Iterator[str]:
    library = re.search(r"avcodec:\s+YES \(([\d.]+)\)", cv2.getBuildInformation())
    if library is None:
        yield (
            "videos: this OpenCV has no FFmpeg, so that few formats can be read; "
            "install opencv-python-headless from PyPI, or give folders of images"
        )
    else:
        yield f"videos: OpenCV {cv2.__version__} with FFmpeg (avcodec {library[1]}), also H.264 and H.265"
    tested = {name: _round_trip(code, suffix) for name, (code, suffix) in CODECS.items()}
    works = [name for name, passed in tested.items() if passed]
    fails = [name for name, passed in tested.items() if not passed]
    yield f"codecs tested by writing and reading: {', '.join(works) or 'none'}" + (
        f"; failed: {', '.join(fails)}" if fails else ""
    )
    known = [suffix[1:] for suffix in IMAGES if cv2.haveImageWriter(suffix)]
    yield f"images: {', '.join(known)}, 8 and 16 bit"


def _round_trip(code: str, suffix: str) -> bool:
    """Whether a short video of this codec can be written and read."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"video{suffix}"
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), 25.0, (64, 48))
        for level in (40, 200):
            writer.write(np.full((48, 64, 3), level, np.uint8))
        writer.release()
        reader = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        decoded, image = reader.read()
        reader.release()
    return bool(decoded) and image is not None and image.shape == (48, 64, 3)
