"""Opens the source that a text names."""

import os
from dataclasses import replace
from numbers import Integral
from pathlib import Path
from types import NoneType

from manytouch.errors import SourceError, require_type
from manytouch.limits import HIGHEST_FPS
from manytouch.source_names import (
    VIEWS_PREFIX,
    is_camera,
    is_stream,
    split_topic,
    views_of,
    why_missing,
)
from manytouch.sources.cameras.capture import CameraRequest
from manytouch.sources.files.images import IMAGE_SUFFIXES, folder_source, image_source
from manytouch.sources.files.log import is_log, log_source
from manytouch.sources.files.video import VIDEO_SUFFIXES, video_source
from manytouch.sources.joined import JoinedSource
from manytouch.sources.quiet_opencv import cv2
from manytouch.sources.source import Source, close
from manytouch.values.arrays import plain

SUPPORTED = (
    "a camera's number or device, the address of a stream, a video file, an image, a folder of images, "
    "an .mcap recording, an MCAP file or ROS 2 bag with images (PATH#TOPIC), "
    "views:SOURCE,SOURCE for several cameras on one sheet, or sim: for the simulated sensor"
)


def open_source(
    text: str | os.PathLike[str] | int, *, fps: float | None = None, camera: CameraRequest | None = None
) -> Source:
    """Open a source of frames by its name; only its first image is read.

    Args:
        text: path of a video, an image, a folder of images, an .mcap recording (of a rig with `#SENSOR`), or
            an MCAP file or ROS 2 bag of another program, with `#TOPIC` if it has images on several topics;
            number, device or address of a camera; `views:SOURCE,SOURCE` for several cameras on one sheet, in
            the order of its sensor file; `sim:` or `sim:SCENE`.
        fps: rate in frames per second that timestamps follow instead of the source's own; of a camera, the
            rate to request. A single stream has the rate of its sender, whatever is given; streams as views
            that do not report theirs are joined by it.
        camera: what else to request of a camera.

    Raises:
        SourceError: it does not exist, or cannot be decoded.
    """
    fps = plain(fps)
    require_type("fps", fps, (int, float, NoneType), "a number of frames per second")
    if fps is not None and not 1.0 / HIGHEST_FPS <= fps <= HIGHEST_FPS:
        raise SourceError(
            f"The frame rate must be a number of frames per second from {1.0 / HIGHEST_FPS:g} to "
            f"{HIGHEST_FPS:g}, not {fps:g}."
        )
    require_type("the name of the source", text, (str, os.PathLike, Integral), SUPPORTED)
    text = os.fspath(text) if isinstance(text, str | os.PathLike) else str(text)
    if text.startswith(VIEWS_PREFIX):
        return _joined_source(text, fps, camera)
    if text.startswith("sim:"):
        from manytouch.sources.simulated import simulated_source

        return simulated_source(text.removeprefix("sim:"), fps=fps)
    if not text.strip():
        raise SourceError(f"The name of the source is empty: give {SUPPORTED}.")
    bare, topic = split_topic(text)
    path = Path(bare).expanduser()
    if topic is not None and (path.is_dir() or path.suffix.lower() == ".mcap") and path.exists():
        if topic.startswith("/") or is_log(path):
            return log_source(path, topic, fps)
        from manytouch.sources.files.replay import replay_source

        return replay_source(path, fps, topic)  # a sensor of a rig
    path = Path(text).expanduser()
    if is_camera(text):
        from manytouch.sources.cameras.camera import camera_source

        request = CameraRequest() if camera is None else camera
        return camera_source(text, request if fps is None else replace(request, fps=fps))
    try:
        return _file_source(text, path, fps)
    except OSError as error:
        raise SourceError(f"{text!r} cannot be read: {error.strerror or error}.") from error


def _joined_source(text: str, fps: float | None, camera: CameraRequest | None) -> Source:
    views: list[Source] = []
    try:
        for part in views_of(text):
            views.append(open_source(part, fps=None if is_stream(part) else fps, camera=camera))
        return JoinedSource(views, fps=fps)
    except BaseException:
        for view in views:
            close(view)
        raise


def _file_source(text: str, path: Path, fps: float | None) -> Source:
    if is_log(path):
        return log_source(path, None, fps)
    if path.is_dir():
        return _folder_source(path, fps)
    if not path.exists():
        raise SourceError(why_missing(text, path))
    if not path.is_file():
        raise SourceError(f"{text!r} is neither a file nor a folder: give {SUPPORTED}.")
    if path.stat().st_size == 0:
        raise SourceError(f"{text!r} is empty: copy or record it again.")
    if path.suffix.lower() == ".mcap":
        from manytouch.sources.files.replay import replay_source

        return replay_source(path, fps)
    if path.suffix.lower() == ".toml":
        raise SourceError(
            f"{text!r} is a TOML file, not a recording: give a sensor file as --sensor {text}, a scene file "
            f"as sim:{text}, and a rig file to manytouch run."
        )
    if path.suffix.lower() in IMAGE_SUFFIXES or (
        path.suffix.lower() != ".gif" and cv2.haveImageReader(str(path))
    ):
        return image_source(path, fps)
    return video_source(path, fps)


def _folder_source(path: Path, fps: float | None) -> Source:
    try:
        return folder_source(path, fps)
    except SourceError as error:
        videos = sorted(child.name for child in path.iterdir() if child.suffix.lower() in VIDEO_SUFFIXES)
        if not videos:
            raise
        raise SourceError(
            f"{error} It contains videos: give one of them, such as {str(path / videos[0])!r}."
        ) from error
