"""One frame to look at: truth and estimate side by side."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float64

from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluatedRecording, subset
from manytouch.evaluation.metrics.depth import depth_samples
from manytouch.evaluation.metrics.markers import own_numbers
from manytouch.evaluation.metrics.matching import assigned, gates_of
from manytouch.values.images.grey_levels import to_8_bits

WIDEST_PX = 900


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WorstFrame:
    """A frame of a recording.

    Attributes:
        recording, method: which recording, and the method that estimated it.
        frame: its number.
        rmse_mm: of the depth over the sheet.
        place: (m, 2) of the markers at rest, in `place_unit`.
        place_unit: "mm", "pitch", "column" or "px".
        true_mm, estimated_mm: (m,) depth at the markers, NaN where not given.
        true_contact_mm: (t, 2) centres of the true contacts.
        is_found: (t,) whether an estimate is paired with it.
        contact_mm: (e, 2) centres of the estimated ones.
        is_right: (e,) whether it is paired with a true one.
        picture: (h, w) or (h, w, 3) of the camera, or None.
    """

    recording: str
    method: str
    frame: int
    rmse_mm: float
    place: Float64[np.ndarray, "m 2"]
    place_unit: str
    true_mm: Float64[np.ndarray, " m"]
    estimated_mm: Float64[np.ndarray, " m"]
    true_contact_mm: Float64[np.ndarray, "t 2"]
    is_found: Bool[np.ndarray, " t"]
    contact_mm: Float64[np.ndarray, "e 2"]
    is_right: Bool[np.ndarray, " e"]
    picture: np.ndarray | None


def find_worst_frame(
    truth: EvaluatedRecording,
    estimated: EvaluatedRecording,
    *,
    gate_mm: float,
    picture: Callable[[int], np.ndarray | None] | None = None,
) -> WorstFrame | None:
    """The frame of the largest RMSE of depth among those in which something touches.

    Both recordings must contain the same frames. None when nothing touches, or no depth is given.
    """
    samples = depth_samples(truth, estimated)
    rmse = np.where(samples.is_pressed & np.isfinite(samples.rmse_mm), samples.rmse_mm, -np.inf)
    if len(rmse) == 0 or not np.isfinite(rmse.max()):
        return None
    worst = int(np.argmax(rmse))
    frame = int(truth.frame[worst])
    own = own_numbers(truth, estimated)
    depth = np.full(len(truth.marker), np.nan)
    depth[own[own >= 0]] = estimated.depth_mm[worst, own >= 0]
    of_frame = truth.contacts.frame == frame
    mine = truth.contacts.centre_mm[of_frame]
    gates = gates_of(subset(truth.contacts, of_frame), gate_mm)
    theirs = estimated.contacts.centre_mm[estimated.contacts.frame == frame]
    pair = assigned(np.linalg.norm(mine[:, None] - theirs[None], axis=2) / gates[:, None], 1.0)
    return WorstFrame(
        recording=estimated.name,
        method=estimated.method,
        frame=frame,
        rmse_mm=float(rmse[worst]),
        place=truth.place,
        place_unit=truth.place_unit,
        true_mm=truth.depth_mm[worst],
        estimated_mm=depth,
        true_contact_mm=mine,
        is_found=np.isin(np.arange(len(mine)), pair[:, 0]),
        contact_mm=theirs,
        is_right=np.isin(np.arange(len(theirs)), pair[:, 1]),
        picture=None if picture is None else _small(picture(frame)),
    )


def _small(picture: np.ndarray | None) -> np.ndarray | None:
    """Grey or colour, 8 bit, at most 900 px wide."""
    if picture is None:
        return None
    share = min(1.0, WIDEST_PX / picture.shape[1])
    size = (round(picture.shape[1] * share), round(picture.shape[0] * share))
    return np.asarray(cv2.resize(to_8_bits(picture), size, interpolation=cv2.INTER_AREA))
