"""Choosing views of a board while looking: sharp ones, each unlike the others, and what is still missing."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import cv2
import numpy as np

from manytouch.calibration.camera.board import Board, Sighting, find_board, spacing_px
from manytouch.values import Frame

MOST_VIEWS = 40
ENOUGH_VIEWS = 12
BLURRED_EDGE_PX = 5.0
"""An edge that takes more than this to go from dark to light is blurred, if that is more than a
quarter of a square too."""
_BLURRED_SHARE = 0.25
_ALIKE = 0.02
_TILTED_DEG = 15.0
_NEAR_TO_FAR = 1.4
_LEAST_POINTS = 4  # of a part of the picture that counts as covered
PARTS = (
    *("top left", "top", "top right"),
    *("left", "middle", "right"),
    *("bottom left", "bottom", "bottom right"),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoardView:
    """A picture of a board that is worth using.

    Attributes:
        name: of the picture.
        image: (h, w) grey.
        sighting: the board's points.
        edge_px: width of its edges from dark to light.
        outlook: (5,) place (x, y) and size in shares of the picture, tilts about y and x in rad.
    """

    name: str
    image: np.ndarray
    sighting: Sighting
    edge_px: float
    outlook: np.ndarray


@dataclass(slots=True, kw_only=True)
class ViewCollection:
    """Takes pictures one by one, keeps the views worth keeping, and says why it refuses the others.

    Attributes:
        board: what to look for.
        views: kept, in the order of their coming.
        refused: name of the picture and reason.
    """

    board: Board
    views: list[BoardView] = field(default_factory=list)
    refused: list[tuple[str, str]] = field(default_factory=list)
    size_px: tuple[int, int] | None = None

    def offer(self, frame: Frame, name: str) -> str | None:
        """Look at a picture; the reason why it is not kept, or None when it is."""
        reason = self._refusal(frame, name)
        if reason is not None:
            self.refused.append((name, reason))
        return reason

    def missing(self) -> tuple[str, ...]:
        """What further views should show; empty when there are enough of every kind."""
        return tuple(self._missing())

    def _refusal(self, frame: Frame, name: str) -> str | None:
        if frame.image is None:
            return "cannot be decoded"
        image = grey(frame.image)
        size = (image.shape[1], image.shape[0])
        if self.size_px is None:
            self.size_px = size
        if size != self.size_px:
            return (
                f"has {size[0]} x {size[1]} px, the pictures before it {self.size_px[0]} x {self.size_px[1]}"
            )
        sighting = find_board(image, self.board)
        if sighting is None:
            return f"shows no whole {self.board}"
        edge_px, square_px = edge_width_px(image, sighting), spacing_px(sighting)
        if edge_px > max(BLURRED_EDGE_PX, _BLURRED_SHARE * square_px):
            return f"is blurred: its edges are {edge_px:.1f} px wide"
        view = BoardView(
            name=name,
            image=image,
            sighting=sighting,
            edge_px=edge_px,
            outlook=outlook(self.board, sighting, size),
        )
        return self._kept(view)

    def _kept(self, view: BoardView) -> str | None:
        """Keep a view, or let it take the place of a blurrier one that looks the same."""
        for number, other in enumerate(self.views):
            if np.linalg.norm(view.outlook - other.outlook) < _ALIKE:
                if view.edge_px < 0.9 * other.edge_px:
                    self.refused.append((other.name, f"looks the same as {view.name}, which is sharper"))
                    self.views[number] = view
                    return None
                return f"looks the same as {other.name}"
        self.views.append(view)
        if len(self.views) > MOST_VIEWS:
            outlooks = np.array([other.outlook for other in self.views])
            apart = np.linalg.norm(outlooks[:, None] - outlooks[None], axis=2)
            np.fill_diagonal(apart, np.inf)
            gone = self.views.pop(int(np.argmin(apart.min(axis=1))))
            self.refused.append((gone.name, "adds least to the views that there are"))
        return None

    def _missing(self) -> Iterator[str]:
        if len(self.views) < ENOUGH_VIEWS:
            yield f"{ENOUGH_VIEWS - len(self.views)} more views"
        if not self.views or self.size_px is None:
            return
        counts = part_counts(np.concatenate([view.sighting.place_px for view in self.views]), self.size_px)
        empty = [name for name, count in zip(PARTS, counts, strict=True) if count < _LEAST_POINTS]
        if empty:
            yield f"the board in the picture's {', '.join(empty)}"
        outlooks = np.array([view.outlook for view in self.views])
        for column, ways in ((3, ("left", "right")), (4, ("up", "down"))):
            tilt = np.rad2deg(outlooks[:, column])
            if not (tilt.max() > _TILTED_DEG or tilt.min() < -_TILTED_DEG):
                yield f"the board tilted by 20 to 45 degrees {ways[0]} or {ways[1]}"
        if outlooks[:, 2].max() < _NEAR_TO_FAR * outlooks[:, 2].min():
            yield "the board nearer, or farther away"


def grey(image: np.ndarray) -> np.ndarray:
    """(h, w) uint8 of a picture that may have colours or 16 bits."""
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def edge_width_px(image: np.ndarray, sighting: Sighting) -> float:
    """How many px the board's edges need from dark to light: range over steepest slope, median of points."""
    half = max(3, round(0.4 * spacing_px(sighting)))
    widths = []
    for x, y in np.rint(sighting.place_px).astype(int):
        left, top = max(x - half, 0), max(y - half, 0)
        part = image[top : y + half + 1, left : x + half + 1].astype(np.float32)
        if min(part.shape) < 3:
            continue
        low, high = np.quantile(part, (0.05, 0.95))
        slope = max(np.abs(np.diff(part, axis=0)).max(), np.abs(np.diff(part, axis=1)).max())
        widths.append(float(high - low) / max(float(slope), 1.0))
    return float(np.median(widths)) if widths else np.inf


def outlook(board: Board, sighting: Sighting, size_px: tuple[int, int]) -> np.ndarray:
    """Place, size and tilt of a board in a picture; tilts assume a camera of about 53 degrees."""
    width, height = size_px
    place = sighting.place_px
    centre = place.mean(axis=0) / [width, height]
    extent = float(np.linalg.norm(np.ptp(place, axis=0)) / np.hypot(width, height))
    matrix = np.array([[width, 0.0, width / 2], [0.0, width, height / 2], [0.0, 0.0, 1.0]])
    is_found, turn, _ = cv2.solvePnP(
        board.point_mm[sighting.number],
        np.ascontiguousarray(place),
        matrix,
        np.zeros(5),
        flags=cv2.SOLVEPNP_IPPE,
    )
    if not is_found:
        return np.array([*centre, extent, 0.0, 0.0])
    normal = cv2.Rodrigues(turn)[0][:, 2]
    normal = normal * np.sign(normal[2] or 1.0)
    return np.array([*centre, extent, np.arctan2(normal[0], normal[2]), np.arctan2(normal[1], normal[2])])


def part_counts(place_px: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """(9,) points in each of the nine parts of the picture, in the order of `PARTS`."""
    return np.bincount(part_of(place_px, size_px), minlength=len(PARTS))


def part_of(place_px: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """(n,) which of the nine parts of the picture holds each point."""
    column, row = np.clip((3 * (place_px + 0.5) / np.asarray(size_px)).astype(int), 0, 2).T
    return np.asarray(3 * row + column)
