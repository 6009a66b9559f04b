"""Peaks of the surface between the markers (Figures 12 and 13)."""

import cv2
import numpy as np
from jaxtyping import Float64, Int64


def peaks(
    depth_mm: Float64[np.ndarray, "rows columns"], least_mm: float, reach: np.ndarray
) -> tuple[Int64[np.ndarray, " c"], Int64[np.ndarray, " c"]]:
    """Rows and columns of the points deeper than `least_mm` that are the deepest within `reach`.

    The deepest is the first; of equal points within reach only the first one in row order is a peak.
    """
    height = np.where(np.isfinite(depth_mm), depth_mm, -np.inf)
    highest = cv2.dilate(height, reach, borderType=cv2.BORDER_CONSTANT, borderValue=(-np.inf,) * 4)
    row, column = np.nonzero((height == highest) & (height > least_mm))
    order = np.argsort(-height[row, column], kind="stable")
    row, column = row[order], column[order]
    middle = np.array(reach.shape) // 2
    step = np.stack([row[:, None] - row, column[:, None] - column], axis=-1) + middle
    is_inside = ((step >= 0) & (step < reach.shape)).all(axis=-1)
    step = np.where(is_inside[..., None], step, 0)
    is_near = is_inside & (reach[step[..., 0], step[..., 1]] > 0)
    is_kept = np.zeros(len(row), dtype=np.bool_)
    for place in range(len(row)):
        is_kept[place] = not (is_near[place] & is_kept).any()
    return row[is_kept].astype(np.int64), column[is_kept].astype(np.int64)


def disc_footprint(
    x_mm: Float64[np.ndarray, " columns"], y_mm: Float64[np.ndarray, " rows"], radius_mm: float
) -> np.ndarray:
    """Points of an even grid within a radius of the central one, as a footprint of 0 and 1."""
    step_mm = np.array([np.diff(y_mm[:2])[0], np.diff(x_mm[:2])[0]])
    reach = np.maximum(np.floor(radius_mm / step_mm).astype(int), 1)
    row, column = np.mgrid[-reach[0] : reach[0] + 1, -reach[1] : reach[1] + 1]
    inside = (row * step_mm[0]) ** 2 + (column * step_mm[1]) ** 2 <= radius_mm**2
    inside[reach[0], reach[1]] = True
    return np.asarray(inside.astype(np.uint8))
