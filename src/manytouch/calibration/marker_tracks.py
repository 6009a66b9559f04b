"""Positions of the markers of a known sensor over the frames of a recording."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from manytouch.detection import DotSearch
from manytouch.pipeline import track_frames
from manytouch.tracking import MarkerTracker
from manytouch.values import Frame, Roi, Sensor


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerTracks:
    """Marker positions, frame by frame.

    Attributes:
        timestamp_ns: (k,) of the frames.
        position_px: (k, m, 2), NaN where not seen.
        area_px2: (k, m) of the dots, NaN where not seen.
        contrast: (k,) median grey levels between dots and background.
        compression_std_px: additional error of the centres along an axis if the frames are those of
            compressed video (`tracking.held_markers`), else 0.
    """

    timestamp_ns: Int64[np.ndarray, " k"]
    position_px: Float64[np.ndarray, "k m 2"]
    area_px2: Float64[np.ndarray, "k m"]
    contrast: Float64[np.ndarray, " k"]
    compression_std_px: float

    @property
    def is_seen(self) -> Bool[np.ndarray, "k m"]:
        """(k, m) whether the marker was seen."""
        return np.asarray(np.isfinite(self.position_px[:, :, 0]))

    def of(self, chosen: Bool[np.ndarray, " k"]) -> "MarkerTracks":
        """The tracks of the chosen frames."""
        return MarkerTracks(
            timestamp_ns=self.timestamp_ns[chosen],
            position_px=self.position_px[chosen],
            area_px2=self.area_px2[chosen],
            contrast=self.contrast[chosen],
            compression_std_px=self.compression_std_px,
        )

    def motion_px(self, rest_px: Float64[np.ndarray, "m 2"]) -> Float64[np.ndarray, " k"]:
        """(k,) distance from rest that one in fifty markers of a frame exceeds; NaN where none is seen."""
        distance_px = np.linalg.norm(self.position_px - rest_px, axis=2)
        motion_px = np.full(len(distance_px), np.nan)
        known = np.isfinite(distance_px).any(axis=1)
        motion_px[known] = np.nanpercentile(distance_px[known], 98, axis=1)
        return motion_px

    def median_px(self, chosen: Bool[np.ndarray, " k"]) -> Float64[np.ndarray, "m 2"]:
        """(m, 2) median position over the chosen frames; NaN for markers seen in less than half of them."""
        seen = self.is_seen[chosen]
        often = 2 * seen.sum(axis=0) >= max(int(chosen.sum()), 1)
        place = np.full((seen.shape[1], 2), np.nan)
        place[often] = np.nanmedian(self.position_px[chosen][:, often], axis=0)
        return place


def track_markers(sensor: Sensor, frames: Iterable[Frame], roi_px: Roi | None = None) -> MarkerTracks:
    """Track the markers of a sensor that was registered to the recording (see `register_rest`)."""
    detect, track = DotSearch(roi_px=roi_px), MarkerTracker(roi_px=roi_px)
    times, places, areas, contrasts, is_compressed = [], [], [], [], False
    for tracked in track_frames(detect, track, frames, sensor):
        grid, contrast = tracked.grid, tracked.detections.contrast
        is_compressed = grid.is_compressed
        times.append(tracked.frame.timestamp_ns)
        places.append(grid.position_px)
        areas.append(np.full(len(grid.is_seen), np.nan) if grid.area_px2 is None else grid.area_px2)
        contrasts.append(float(np.median(contrast)) if len(contrast) else np.nan)
    return MarkerTracks(
        timestamp_ns=np.array(times, dtype=np.int64),
        position_px=np.array(places),
        area_px2=np.array(areas),
        contrast=np.array(contrasts),
        compression_std_px=track.held_markers.std_px if is_compressed else 0.0,
    )
