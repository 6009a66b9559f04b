"""Motion of the whole image between the rest and a frame, from the markers along the clamp.

A camera that moves a little displaces all marker images alike. The clamp does not move, so that the markers
next to it show this motion, whatever presses elsewhere: it is the shift, rotation and scale that fit their
displacements beyond the shape of the previous frame best, with robust weights. A press that grows, or a
release, also moves them, largely along the displacements that the previous shape has already: a multiple of
these is fitted too, and is no motion. As much of the motion is used as it explains more than both leave.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.medians import median
from manytouch.values.arrays import Mask, Points2, Scalars

_MIN_SCALE_PX = 1e-3
_RANK = 1e-12


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ViewMotion:
    """Estimates the motion of the image from the markers next to the clamp; parameters of its fit.

    Attributes:
        rim_pitch: markers within this distance of the clamp are used, in pitches.
        min_markers: fewer of them show no motion.
        scale_stds: residuals beyond this many robust standard deviations have no weight (Tukey).
        iterations: of the weights.
    """

    rim_pitch: float = 1.5
    min_markers: int = 12
    scale_stds: float = 4.0
    iterations: int = 3

    def is_used(self, model: InversionModel) -> Mask:
        """(m,) markers next to the clamp; none of an assumed sheet, which is held somewhere beyond them."""
        place_mm = model.layout.rest_mm[:, :2]
        left_mm = 0.5 * np.array(model.patch.size_mm) - np.abs(place_mm)
        return np.asarray(left_mm.min(axis=1) <= self.rim_pitch * model.pitch_mm)

    def __call__(self, rest_px: Points2, moved_px: Points2, shape_px: Points2, is_used: Mask) -> Points2:
        """(m, 2) motion of all marker images.

        Args:
            rest_px: (m, 2) marker images at rest.
            moved_px: (m, 2) measured displacements of the marker images.
            shape_px: (m, 2) their displacements by the shape of the previous frame.
            is_used: (m,) seen markers next to the clamp.
        """
        if is_used.sum() < self.min_markers:
            return np.zeros_like(rest_px)
        whole = _rigid(rest_px - rest_px[is_used].mean(axis=0))
        design, change = whole[is_used].reshape(-1, 4), (moved_px - shape_px)[is_used]
        terms = np.empty((len(design), 5))
        terms[:, :4], terms[:, 4] = design, shape_px[is_used].ravel()
        found = _robust_fit(terms, change, self.scale_stds, self.iterations)
        explained = float(np.square(design @ found[:4]).sum())
        left = float(np.square(change.ravel() - terms @ found).sum())
        share = max(1.0 - left / max(explained, 1e-12), 0.0)
        return np.asarray(share * (whole @ found[:4]))


def _robust_fit(
    design: Float64[np.ndarray, "rows 5"], change: Points2, scale_stds: float, iterations: int
) -> Float64[np.ndarray, "5"]:
    """Shift along x and y, rotation, scale, and the multiple of the previous shape that fit displacements
    (m, 2) best, from their median on."""
    fitted = np.array([median(change[:, axis]) for axis in range(2)])
    found: Scalars = np.zeros(5)
    for _ in range(iterations):
        length = np.hypot(*(change - fitted).T)
        scale_px = max(1.4826 * median(length) / np.sqrt(2.0), _MIN_SCALE_PX)
        weight = np.square(np.maximum(1.0 - np.square(length / (scale_stds * scale_px)), 0.0))
        weighted = np.repeat(weight, 2)[:, None] * design
        found = np.linalg.lstsq(weighted.T @ design, change.ravel() @ weighted, rcond=_RANK)[0]
        fitted = (design @ found).reshape(-1, 2)
    return found


def _rigid(arm_px: Points2) -> Float64[np.ndarray, "n 2 4"]:
    """Derivatives of the displacements (m, 2) by shift along x and y, rotation, and scale."""
    design = np.zeros((len(arm_px), 2, 4))
    design[:, 0, 0] = design[:, 1, 1] = 1.0
    design[:, 0, 2], design[:, 1, 2] = -arm_px[:, 1], arm_px[:, 0]
    design[:, :, 3] = arm_px
    return design
