"""One image, or a folder of images in natural order."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manytouch.errors import SourceError
from manytouch.limits import MAX_IMAGE_BYTES
from manytouch.sources.decoding import decode_image
from manytouch.sources.image_header import image_mistake
from manytouch.sources.quiet_opencv import cv2
from manytouch.sources.source import Capabilities, Source, evenly_timed_ns
from manytouch.values import Frame
from manytouch.values.arrays import Image, read_only
from manytouch.values.display.text import count_of

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")

MAX_DIGITS = 300  # of a number in a name


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ImagesSource:
    """Images of one size, one frame each.

    An image that cannot be decoded, or that differs from the first in size or bit depth, is a frame
    without an image. A grey image among colour ones is converted to colour, and the other way round.

    Attributes:
        name: stem for the folder of its results.
        paths: the files, in order.
        fps: rate that the timestamps follow; None counts as 30 frames per second.
        first: the first image that can be decoded.
        folder: whose images they are; None: a single image was given.
    """

    name: str
    paths: tuple[Path, ...]
    fps: float | None
    first: Image
    folder: Path | None = None

    @property
    def frame_count(self) -> int:
        return len(self.paths)

    @property
    def width_px(self) -> int:
        return int(self.first.shape[1])

    @property
    def height_px(self) -> int:
        return int(self.first.shape[0])

    @property
    def is_live(self) -> bool:
        return False

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(files=self.paths, is_images=True)

    def __iter__(self) -> Iterator[Frame]:
        colour = cv2.IMREAD_COLOR if self.first.ndim == 3 else cv2.IMREAD_GRAYSCALE
        for index, path in enumerate(self.paths):
            image = read_image(path, colour)
            is_alike = (
                image is not None and image.shape == self.first.shape and image.dtype == self.first.dtype
            )
            yield Frame(
                index=index,
                timestamp_ns=evenly_timed_ns(index, self.fps),
                camera=self.name,
                image=image if is_alike else None,
            )


def image_source(path: Path, fps: float | None) -> ImagesSource:
    """A single image as a source of one frame."""
    first = read_image(path)
    if first is None:
        reason = _why_not(path) or "check that it is complete, or save it again as PNG"
        raise SourceError(
            f"{str(path)!r} cannot be decoded as an image of 8 or 16 bits per channel: {reason}."
        )
    return ImagesSource(name=path.stem, paths=(path,), fps=fps, first=first)


def folder_source(folder: Path, fps: float | None) -> ImagesSource:
    """All images of a folder (not of folders in it), 2.png before 10.png."""
    paths = _images_in(folder)
    if not paths:
        wanted = ", ".join(suffix[1:] for suffix in IMAGE_SUFFIXES)
        raise SourceError(
            f"The folder {str(folder)!r} contains no images ({wanted}): give one that does, or a video."
        )
    first = next((image for path in paths if (image := read_image(path)) is not None), None)
    if first is None:
        reason = _why_not(paths[0])
        raise SourceError(
            f"None of the {len(paths)} images in {str(folder)!r} can be decoded: "
            + ("check their files." if reason is None else f"{paths[0].name}: {reason}.")
        )
    name = folder.resolve().name or "images"
    return ImagesSource(name=name, paths=paths, fps=fps, first=first, folder=folder)


def late_images(source: Source) -> list[str]:
    """A sentence if images came into the folder of a source after its files were listed; else nothing."""
    if not isinstance(source, ImagesSource) or source.folder is None:
        return []
    try:
        late = len(set(_images_in(source.folder)) - set(source.paths))
    except OSError:
        return []  # images that cannot be read have a status
    if not late:
        return []
    return [
        f"the results lack {count_of(late, 'image')} that came into the folder {source.name} after its files "
        "were listed: process it again when it is complete"
    ]


def _images_in(folder: Path) -> tuple[Path, ...]:
    return tuple(sorted((path for path in folder.iterdir() if _is_image_name(path)), key=natural_key))


def read_image(path: Path, colour: int = cv2.IMREAD_ANYCOLOR) -> Image | None:
    """Grey or BGR image of 8 or 16 bits; None when the file is not one. `colour` is OpenCV's read flag."""
    try:
        image = decode_image(_content(path).data, colour)
    except (OSError, ValueError):
        return None
    if image is None or image.dtype not in (np.uint8, np.uint16):
        return None
    return read_only(image)


def _content(path: Path) -> np.ndarray:
    """The bytes of a file; OpenCV itself cannot open every name on every system."""
    if path.stat().st_size > MAX_IMAGE_BYTES:
        raise ValueError(f"the file has more than {MAX_IMAGE_BYTES // 10**6} MB")
    return np.fromfile(path, dtype=np.uint8)


def _why_not(path: Path) -> str | None:
    """Why a file is not decoded at all; None if it may be."""
    try:
        return image_mistake(_content(path).data)
    except (OSError, ValueError) as error:
        return str(error)


def natural_key(path: Path) -> tuple[list[str | int], str]:
    """Sorts numbers in names by their value, whatever their number of digits."""
    parts = re.split(r"(\d+)", path.stem.casefold())
    return [int(part[:MAX_DIGITS]) if place % 2 else part for place, part in enumerate(parts)], path.name


def _is_image_name(path: Path) -> bool:
    return path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith(".") and path.is_file()
