"""Pictures and markers of all views in one frame."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manytouch.geometry.views.view_sensors import ViewSensor
from manytouch.values import Detections, Frame, Status, TrackedGrid
from manytouch.values.arrays import Image, read_only


def side_by_side(frames: Sequence[Frame]) -> Frame:
    """The pictures of all views in a row, with index and time of the first; black below a lower one.

    Without an image where one of them has none.
    """
    first, images = frames[0], [frame.image for frame in frames]
    first = replace(first, is_predicted=any(frame.is_predicted for frame in frames))
    known = [image for image in images if image is not None]
    if len(known) < len(images):
        return replace(first, image=None, encoded=None)
    if len({image.ndim for image in known}) > 1:
        known = [image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2) for image in known]
    height = max(len(image) for image in known)
    padded = [_with_height(image, height) for image in known]
    return replace(first, image=read_only(np.concatenate(padded, axis=1)), encoded=None)


def _with_height(image: Image, height: int) -> np.ndarray:
    below = height - len(image)
    return image if below == 0 else np.pad(image, [(0, below), *[(0, 0)] * (image.ndim - 1)])


def merged_grid(views: Sequence[ViewSensor], grids: Sequence[TrackedGrid], markers: int) -> TrackedGrid:
    """The markers of all views, in pixels of the frame.

    Args:
        views: of the sensor.
        grids: of one frame, one for each view.
        markers: number of markers of the sheet.
    """
    position_px, covariance_px2 = np.full((markers, 2), np.nan), np.full((markers, 2, 2), np.nan)
    area_px2, is_seen = np.full(markers, np.nan), np.zeros(markers, dtype=np.bool_)
    frames_unseen = np.zeros(markers, dtype=np.int64)
    has_area = all(grid.area_px2 is not None for grid in grids)
    for view, grid in zip(views, grids, strict=True):
        own, marker = view.is_own, view.marker[view.is_own]
        position_px[marker] = view.view.to_frame(grid.position_px[own])
        covariance_px2[marker] = grid.covariance_px2[own]
        is_seen[marker], frames_unseen[marker] = grid.is_seen[own], grid.frames_unseen[own]
        if grid.area_px2 is not None:
            area_px2[marker] = grid.area_px2[own]
    return TrackedGrid(
        position_px=read_only(position_px),
        covariance_px2=read_only(covariance_px2),
        is_seen=read_only(is_seen),
        frames_unseen=read_only(frames_unseen),
        area_px2=read_only(area_px2) if has_area else None,
        lost_ids=_sum([grid.lost_ids for grid in grids]),
        new_ids=_sum([grid.new_ids for grid in grids]),
        status=next((grid.status for grid in grids if grid.status is not Status.OK), Status.OK),
        is_compressed=any(grid.is_compressed for grid in grids),
    )


def merged_detections(views: Sequence[ViewSensor], found: Sequence[Detections]) -> Detections:
    """The dots of all views, in pixels of the frame; a marker that several views show has a dot in each."""
    return Detections(
        centre_px=np.concatenate(
            [each.view.to_frame(dots.centre_px) for each, dots in zip(views, found, strict=True)]
        ),
        covariance_px2=np.concatenate([each.covariance_px2 for each in found]),
        area_px2=np.concatenate([each.area_px2 for each in found]),
        contrast=np.concatenate([each.contrast for each in found]),
        status=next((each.status for each in found if each.status is not Status.OK), Status.OK),
        is_predicted=any(each.is_predicted for each in found),
    )


def _sum(counts: Sequence[int | None]) -> int | None:
    known = [count for count in counts if count is not None]
    return sum(known) if len(known) == len(counts) else None
