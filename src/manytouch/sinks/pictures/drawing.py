"""Shapes and text on images, with an outline that contrasts with any background.

Colours are those of Okabe and Ito, which are distinguishable with any common colour vision. Positions are
(x, y) in pixels of the image, colours B, G, R.
"""

import cv2
import numpy as np

from manytouch.values.arrays import Image, Points2

Colour = tuple[int, int, int]
Position = tuple[float, float]

SKY: Colour = (233, 180, 86)
YELLOW: Colour = (66, 228, 240)
VERMILION: Colour = (0, 94, 213)
WHITE: Colour = (255, 255, 255)
GREY: Colour = (170, 170, 170)
BLACK: Colour = (0, 0, 0)

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_CAPITAL_PX = 21.0  # height of a capital letter of this font at scale 1
_SHIFT = 4  # OpenCV draws at 1/16 px


def eight_bit_colour(image: Image, white: float | None = None) -> np.ndarray:
    """The picture as 8-bit B, G, R; deeper pixels are scaled so that `white` becomes 255."""
    if image.dtype != np.uint8:
        scale = 255.0 / max(white if white is not None else 65535.0, 1.0)
        image = np.clip(image * np.float32(scale), 0, 255).astype(np.uint8)
    if image.ndim == 2:
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    return image.copy()


def disc_outline(
    picture: np.ndarray, centre: Position, radius: float, colour: Colour, width: int = 1
) -> None:
    """A circle with a dark border on both sides."""
    place, r = _fixed(centre), max(round(radius * 2**_SHIFT), 1)
    cv2.circle(picture, place, r, BLACK, width + 2, cv2.LINE_AA, _SHIFT)
    cv2.circle(picture, place, r, colour, width, cv2.LINE_AA, _SHIFT)


def polygon(picture: np.ndarray, corner_px: Points2, colour: Colour, width: int = 1) -> None:
    """A closed line through (k, 2) corners, with a dark border on both sides."""
    fixed = np.round(corner_px * 2**_SHIFT).astype(np.int32)[None]
    cv2.polylines(picture, fixed, True, BLACK, width + 2, cv2.LINE_AA, _SHIFT)
    cv2.polylines(picture, fixed, True, colour, width, cv2.LINE_AA, _SHIFT)


def cross(picture: np.ndarray, centre: Position, reach: float, colour: Colour, width: int = 1) -> None:
    """A diagonal cross."""
    x, y = centre
    for colour_now, wide in ((BLACK, width + 2), (colour, width)):
        for sign in (-1, 1):
            begin, end = (x - reach, y - sign * reach), (x + reach, y + sign * reach)
            cv2.line(picture, _fixed(begin), _fixed(end), colour_now, wide, cv2.LINE_AA, _SHIFT)


def arrow(picture: np.ndarray, begin: Position, end: Position, colour: Colour, width: int = 1) -> None:
    """An arrow whose head keeps its size until the arrow is shorter than that."""
    length = float(np.hypot(end[0] - begin[0], end[1] - begin[1]))
    if length == 0:
        return
    head = min(4.0 * width + 4.0, 0.6 * length) / length
    for colour_now, wide in ((BLACK, width + 2), (colour, width)):
        cv2.arrowedLine(picture, _fixed(begin), _fixed(end), colour_now, wide, cv2.LINE_AA, _SHIFT, head)


def text_size(text: str, height: float) -> tuple[int, int]:
    """Width and height in px of one line whose capitals are `height` px high."""
    width = cv2.getTextSize(text.replace("±", "+"), _FONT, height / _CAPITAL_PX, _stroke(height))[0][0]
    return int(width), round(height)


def write_text(
    picture: np.ndarray, text: str, place: Position, height: float, colour: Colour, *, outline: bool = True
) -> None:
    """One line of text; `place` is the left end of its baseline.

    The fonts of OpenCV contain ASCII only, so ± is a plus with a line below it.
    """
    if outline:
        for right, down in ((-1, -1), (1, -1), (-1, 1), (1, 1)):
            _write_plain(picture, text, (place[0] + right, place[1] + down), height, BLACK)
    _write_plain(picture, text, place, height, colour)


def _write_plain(picture: np.ndarray, text: str, place: Position, height: float, colour: Colour) -> None:
    x, y = float(place[0]), round(place[1])
    thick = _stroke(height)
    for piece in text.replace("±", "\0±\0").split("\0"):
        glyphs = "+" if piece == "±" else piece
        cv2.putText(picture, glyphs, (round(x), y), _FONT, height / _CAPITAL_PX, colour, thick, cv2.LINE_AA)
        wide_px = text_size(glyphs, height)[0]
        if piece == "±":
            begin, end = (round(x + 0.18 * wide_px), y), (round(x + 0.82 * wide_px), y)
            cv2.line(picture, begin, end, colour, thick, cv2.LINE_AA)
        x += wide_px


def plate(picture: np.ndarray, corner: Position, size: Position, strength: float = 0.7) -> None:
    """Darken a rectangle behind a text; parts outside the image are ignored."""
    left, top = (max(round(value), 0) for value in corner)
    right, bottom = (max(round(value + extent), 0) for value, extent in zip(corner, size, strict=True))
    part = picture[top:bottom, left:right]
    part[:] = (part * (1.0 - strength)).astype(np.uint8)


def _stroke(height: float) -> int:
    return max(round(height / 11), 1)


def _fixed(place: Position) -> tuple[int, int]:
    return round(float(place[0]) * 2**_SHIFT), round(float(place[1]) * 2**_SHIFT)
