"""Which images of a board are used: blurred ones and repeated poses are refused (`ViewCollection`).

What the images still lack is listed.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import cv2
import numpy as np

from manytouch.calibration.camera.board import Board, BoardDetection, find_board, spacing_px
from manytouch.values import Frame
from manytouch.values.images.grey_levels import to_8_bits

MOST_VIEWS = 40
ENOUGH_VIEWS = 12
BLURRED_EDGE_PX = 5.0
"""An edge wider than this, from dark to light, is blurred if it is also wider than a quarter of a square."""
_BLURRED_SHARE = 0.25
_ALIKE = 0.02
_TILTED_DEG = 15.0
_NEAR_TO_FAR = 1.4
_LEAST_POINTS = 4  # of a part of the image that is covered
PARTS = (
    *("top left", "top", "top right"),
    *("left", "middle", "right"),
    *("bottom left", "bottom", "bottom right"),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoardView:
    """An accepted image of a board.

    Attributes:
        name: of the image.
        image: (h, w) grey.
        detection: points of the board.
        edge_px: width of its edges from dark to light.
        pose_features: (5,) position (x, y) and size as shares of the image, tilt about y and x in rad.
    """

    name: str
    image: np.ndarray
    detection: BoardDetection
    edge_px: float
    pose_features: np.ndarray


@dataclass(slots=True, kw_only=True)
class ViewCollection:
    """Collects board views image by image and gives a reason for each rejection.

    Attributes:
        board: to find.
        views: accepted, in order of capture.
        refused: name of the image and reason.
    """

    board: Board
    views: list[BoardView] = field(default_factory=list)
    refused: list[tuple[str, str]] = field(default_factory=list)
    size_px: tuple[int, int] | None = None

    def add(self, frame: Frame, name: str) -> str | None:
        """Add an image; returns the reason for a rejection, or None if it was accepted."""
        reason = self._refusal(frame, name)
        if reason is not None:
            self.refused.append((name, reason))
        return reason

    def missing(self) -> tuple[str, ...]:
        """What further views should show; empty if there are enough of every kind."""
        return tuple(self._missing())

    def _refusal(self, frame: Frame, name: str) -> str | None:
        if frame.image is None:
            return "cannot be decoded"
        image = grey(frame.image)
        size = (image.shape[1], image.shape[0])
        if self.size_px is None:
            self.size_px = size
        if size != self.size_px:
            return f"has {size[0]} x {size[1]} px, the images before it {self.size_px[0]} x {self.size_px[1]}"
        detection = find_board(image, self.board)
        if detection is None:
            return f"does not show a complete {self.board}"
        edge_px, square_px = board_edge_width_px(image, detection), spacing_px(detection)
        if edge_px > max(BLURRED_EDGE_PX, _BLURRED_SHARE * square_px):
            return f"is blurred: its edges are {edge_px:.1f} px wide"
        view = BoardView(
            name=name,
            image=image,
            detection=detection,
            edge_px=edge_px,
            pose_features=pose_features(self.board, detection, size),
        )
        return self._add_view(view)

    def _add_view(self, view: BoardView) -> str | None:
        """Add a view, or replace a less sharp one in the same pose."""
        for number, other in enumerate(self.views):
            if np.linalg.norm(view.pose_features - other.pose_features) < _ALIKE:
                if view.edge_px < 0.9 * other.edge_px:
                    self.refused.append((other.name, f"shows the same pose as {view.name}, which is sharper"))
                    self.views[number] = view
                    return None
                return f"shows the same pose as {other.name}"
        self.views.append(view)
        if len(self.views) > MOST_VIEWS:
            features = np.array([other.pose_features for other in self.views])
            distance = np.linalg.norm(features[:, None] - features[None], axis=2)
            np.fill_diagonal(distance, np.inf)
            gone = self.views.pop(int(np.argmin(distance.min(axis=1))))
            self.refused.append((gone.name, "adds least to the other views"))
        return None

    def _missing(self) -> Iterator[str]:
        if len(self.views) < ENOUGH_VIEWS:
            yield f"{ENOUGH_VIEWS - len(self.views)} more views"
        if not self.views or self.size_px is None:
            return
        counts = part_counts(np.concatenate([view.detection.place_px for view in self.views]), self.size_px)
        empty = [name for name, count in zip(PARTS, counts, strict=True) if count < _LEAST_POINTS]
        if empty:
            yield f"the board in the {', '.join(empty)}"
        features = np.array([view.pose_features for view in self.views])
        for column, ways in ((3, ("left", "right")), (4, ("up", "down"))):
            tilt = np.rad2deg(features[:, column])
            if not (tilt.max() > _TILTED_DEG or tilt.min() < -_TILTED_DEG):
                yield f"the board tilted by 20 to 45 degrees {ways[0]} or {ways[1]}"
        if features[:, 2].max() < _NEAR_TO_FAR * features[:, 2].min():
            yield "the board nearer, or farther away"


def grey(image: np.ndarray) -> np.ndarray:
    """Convert an image with colours or 16 bits to (h, w) uint8."""
    image = to_8_bits(image)
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def board_edge_width_px(image: np.ndarray, detection: BoardDetection) -> float:
    """Width of the edges of the board, px: grey range over steepest slope, median over the points."""
    half = max(3, round(0.4 * spacing_px(detection)))
    widths = []
    for x, y in np.rint(detection.place_px).astype(int):
        left, top = max(x - half, 0), max(y - half, 0)
        part = image[top : y + half + 1, left : x + half + 1].astype(np.float32)
        if min(part.shape) < 3:
            continue
        low, high = np.quantile(part, (0.05, 0.95))
        slope = max(np.abs(np.diff(part, axis=0)).max(), np.abs(np.diff(part, axis=1)).max())
        widths.append(float(high - low) / max(float(slope), 1.0))
    return float(np.median(widths)) if widths else np.inf


def pose_features(board: Board, detection: BoardDetection, size_px: tuple[int, int]) -> np.ndarray:
    """Place, size and tilt of a board in a picture; tilts assume a camera of about 53 degrees."""
    width, height = size_px
    place = detection.place_px
    centre = place.mean(axis=0) / [width, height]
    extent = float(np.linalg.norm(np.ptp(place, axis=0)) / np.hypot(width, height))
    matrix = np.array([[width, 0.0, width / 2], [0.0, width, height / 2], [0.0, 0.0, 1.0]])
    is_found, turn, _ = cv2.solvePnP(
        board.point_mm[detection.number],
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
    """(9,) points in each of the nine parts of the image, in the order of `PARTS`."""
    return np.bincount(part_of(place_px, size_px), minlength=len(PARTS))


def part_of(place_px: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """(n,) index of the part of the image that contains each point."""
    column, row = np.clip((3 * (place_px + 0.5) / np.asarray(size_px)).astype(int), 0, 2).T
    return np.asarray(3 * row + column)
