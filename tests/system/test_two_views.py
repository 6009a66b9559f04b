"""One skin in two mirrors: identities in both views triangulate to consistent points in every frame."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

from manytouch.calibration import sensor_from_rest
from manytouch.detection import DotSearch
from manytouch.sources import open_source
from manytouch.tracking import MarkerTracker
from manytouch.values import Frame, Roi

LEFT, RIGHT = Roi(58, 102, 238, 216), Roi(308, 96, 232, 212)
PITCH_MM = 1.64
AUTHORS_OFF_PX = {"left": np.array([-0.9, 1.4]), "right": np.array([1.2, 1.3])}


def track(frames: list[Frame], roi_px: Roi) -> np.ndarray:
    """(f, m, 2) px, NaN where a marker is not seen; every frame is searched as a whole."""
    sensor = sensor_from_rest(frames[:24], name="skin", roi_px=roi_px)
    detect, tracker = DotSearch(roi_px=roi_px), MarkerTracker(roi_px=roi_px)
    search_state, state = detect.start(sensor), tracker.start(sensor)
    positions = []
    for frame in frames:
        search_state, dots = detect.step(search_state, frame, None)
        state, grid = tracker.step(state, dots)
        positions.append(grid.position_px)
    return np.array(positions)


@pytest.fixture(scope="module")
def pairs(recordings: Path) -> tuple[np.ndarray, np.ndarray]:
    """(f, p, 2) px of the markers that the authors paired in the first frame, left and right."""
    folder = recordings / "vts4"
    frames = list(open_source(str(folder / "0507")))
    table = np.loadtxt(folder / "frame_000_points.txt", skiprows=1)
    chosen = []
    for positions, given, off in (
        (track(frames, LEFT), table[:, 3:5], AUTHORS_OFF_PX["left"]),
        (track(frames, RIGHT), table[:, 5:7], AUTHORS_OFF_PX["right"]),
    ):
        shown = np.flatnonzero(np.isfinite(positions[0, :, 0]))
        distance, nearest = cKDTree(positions[0, shown]).query(given + off)
        chosen.append((positions[:, shown[nearest]], distance < 5.0))
    both = chosen[0][1] & chosen[1][1]
    assert both.sum() >= 45
    return chosen[0][0][:, both], chosen[1][0][:, both]


def triangulate(folder: Path, left_px: np.ndarray, right_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (p, 3) mm, and the RMS (p,) of their reprojection errors in the two images, px."""
    k1, d1, k2, d2, turn, shift = (
        np.loadtxt(folder / f"{name}.txt") for name in ("K1", "D1", "K2", "D2", "R", "T")
    )
    first = cv2.undistortPoints(left_px[:, None], k1, d1.ravel())[:, 0]
    second = cv2.undistortPoints(right_px[:, None], k2, d2.ravel())[:, 0]
    homogeneous = cv2.triangulatePoints(
        np.eye(3, 4), np.column_stack([turn, shift.reshape(3)]), first.T, second.T
    )
    point_mm = (homogeneous[:3] / homogeneous[3]).T
    seen_left, _ = cv2.projectPoints(point_mm, np.zeros(3), np.zeros(3), k1, d1.ravel())
    seen_right, _ = cv2.projectPoints(point_mm, cv2.Rodrigues(turn)[0], shift.reshape(3), k2, d2.ravel())
    off = np.stack([seen_left[:, 0] - left_px, seen_right[:, 0] - right_px])
    return point_mm, np.sqrt((off**2).sum(axis=2).mean(axis=0))


def test_pairs_of_two_views_triangulate_in_every_frame(
    recordings: Path, pairs: tuple[np.ndarray, np.ndarray]
) -> None:
    left, right = pairs
    middles, tails, lengths_mm = [], [], []
    neighbours = None
    for first, second in zip(left, right, strict=True):
        known = np.isfinite(first[:, 0]) & np.isfinite(second[:, 0])
        assert known.sum() >= 0.6 * len(known)
        point_mm = np.full((len(known), 3), np.nan)
        point_mm[known], off = triangulate(recordings / "vts4" / "calibration", first[known], second[known])
        middles.append(np.median(off))
        tails.append(np.quantile(off, 0.95))
        if neighbours is None:
            neighbours = cKDTree(point_mm).query_pairs(1.3 * PITCH_MM, output_type="ndarray")
        lengths_mm.append(np.linalg.norm(point_mm[neighbours[:, 0]] - point_mm[neighbours[:, 1]], axis=1))
    assert max(middles) <= 0.8, f"median {max(middles):.2f} px"
    assert max(tails) <= 1.3, f"95 % {max(tails):.2f} px"
    stretch = np.array(lengths_mm) / lengths_mm[0]
    assert np.isfinite(lengths_mm[0]).sum() >= 80
    assert np.nanmax(stretch) < 1.8, f"neighbours up to {np.nanmax(stretch):.2f} times as far apart"
    assert np.nanmin(stretch) > 0.4, f"neighbours down to {np.nanmin(stretch):.2f} times as far apart"
