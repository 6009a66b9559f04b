"""Pictures of calibration boards, drawn through a known camera for the tests."""

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
from scipy.interpolate import RectBivariateSpline

from manytouch.calibration.camera.board import MARKER_SHARE, Board, BoardDetection, parse_board
from manytouch.geometry.camera import onto_plane, project
from manytouch.values import Camera

WIDTH_PX, HEIGHT_PX = 480, 360
FINE = 2  # samples per pixel along x and y
NODE_PX = 8.0  # distance of the nodes of splines
BOARD = parse_board("chessboard:8x5", 20.0)


def true_camera(model: str = "pinhole") -> Camera:
    distortion = [-0.2, 0.06, 8e-4, -5e-4, 0.0] if model == "pinhole" else [0.04, -0.02, 0.005, 0.0]
    return Camera(
        model=model,
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        fx_px=430.0,
        fy_px=428.0,
        cx_px=246.0,
        cy_px=171.0,
        distortion=np.array(distortion),
        rotation_vector=np.zeros(3),
        translation_mm=np.array([0.0, 0.0, 300.0]),
    )


def poses(count: int, seed: int = 0, board: Board = BOARD) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Poses cam_from_board, the board tilted by 10 to 40 degrees, near and far, here and there."""
    chance = np.random.default_rng(seed)
    middle = np.append(board.point_mm[:, :2].mean(axis=0), 0.0)
    for number in range(count):
        way = 2.4 * number
        tilt = np.deg2rad(10.0 + 30.0 * chance.random())
        turn = tilt * np.array([np.cos(way), np.sin(way), 0.3 * chance.normal()])
        distance = chance.uniform(200.0, 380.0)
        aside = chance.uniform(-0.18, 0.18, 2) * distance
        yield turn, np.array([*aside, distance]) - cv2.Rodrigues(turn)[0] @ middle


def seen(camera: Camera, board: Board, pose: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(n, 2) where the points of a board are in the picture."""
    return project(replace(camera, rotation_vector=pose[0], translation_mm=pose[1]), board.point_mm)


def board_detections(camera: Camera, count: int, noise_px: float, seed: int = 0) -> list[BoardDetection]:
    chance = np.random.default_rng(1000 + seed)
    found = []
    for pose in poses(count, seed):
        place = seen(camera, BOARD, pose)
        place = place + chance.normal(0.0, noise_px, place.shape)
        found.append(BoardDetection(number=np.arange(len(place)), place_px=place))
    return found


def picture(
    camera: Camera, board: Board, pose: tuple[np.ndarray, np.ndarray], *, blur_px: float = 0.7, seed: int = 0
) -> np.ndarray:
    """(h, w) grey picture of a board."""
    posed = replace(camera, rotation_vector=pose[0], translation_mm=pose[1])
    place = places_mm(posed)
    fine = printed(board, place)
    image = cv2.resize(fine, (camera.width_px, camera.height_px), interpolation=cv2.INTER_AREA)
    image = cv2.GaussianBlur(image, (0, 0), blur_px)
    noise = np.random.default_rng(seed).normal(0.0, 2.0, image.shape)
    return np.clip(40.0 + 170.0 * image + noise, 0, 255).astype(np.uint8)


def places_mm(posed: Camera) -> np.ndarray:
    """(FINE h, FINE w, 2) what the samples of a picture show, by splines between nodes: rays are slow."""
    sides = (posed.height_px, posed.width_px)
    node_y, node_x = (np.arange(-NODE_PX, side + 2 * NODE_PX, NODE_PX, dtype=np.float64) for side in sides)
    y, x = ((np.arange(FINE * side) + 0.5) / FINE - 0.5 for side in sides)
    pixel = np.stack(np.meshgrid(node_x, node_y), axis=-1)
    place = onto_plane(posed, pixel.reshape(-1, 2))[:, :2].reshape(pixel.shape)
    return np.stack([RectBivariateSpline(node_y, node_x, place[..., axis])(y, x) for axis in (0, 1)], axis=-1)


def printed(board: Board, place_mm: np.ndarray) -> np.ndarray:
    """How light the board is at places (..., 2): 0 black, 1 white."""
    side = board.square_mm
    if board.kind == "chessboard":
        square = np.floor(place_mm / side).astype(int)
        inside = (square >= -1) & (square < [board.columns, board.rows])
        return np.where(inside.all(axis=-1) & (square.sum(axis=-1) % 2 == 0), 0.0, 1.0).astype(np.float32)
    if board.kind == "charuco":
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
        size = (board.columns, board.rows)
        drawn = cv2.aruco.CharucoBoard(size, side, MARKER_SHARE * side, dictionary).generateImage(
            (board.columns * 40, board.rows * 40)
        )
        # one square is 40 px; the middle of the first pixel lies half a pixel from the rim
        at = (place_mm / side * 40 - 0.5).astype(np.float32)
        return cv2.remap(drawn, at, None, cv2.INTER_LINEAR, borderValue=255).astype(np.float32) / 255
    distance = np.full(place_mm.shape[:-1], np.inf)
    for point in board.point_mm[:, :2]:
        distance = np.minimum(distance, np.linalg.norm(place_mm - point, axis=-1))
    return (distance > 0.3 * side).astype(np.float32)
