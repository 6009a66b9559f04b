"""How far the whole view moved: what camera and frame did, not what touches the sheet."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.values.arrays import Mask, Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ViewMotion:
    """A shift and a small rotation of all markers in the plane of the sheet.

    Attributes:
        shift_mm: (2,) of the sheet's origin.
        angle_rad: about the sheet's origin, from x to y.
    """

    shift_mm: Float64[np.ndarray, "2"]
    angle_rad: float

    def displacement(self, rest_mm: Points2) -> Points2:
        """(m, 2) motion of points at rest."""
        cosine, sine = np.cos(self.angle_rad), np.sin(self.angle_rad)
        turn = np.array([[cosine - 1.0, -sine], [sine, cosine - 1.0]])
        moved: Points2 = self.shift_mm + rest_mm @ turn.T
        return moved


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RobustView:
    """Finds the motion that the far field has in common.

    A press moves the markers near it, each a little otherwise; where nothing presses they move as one. So
    of many candidate motions (each fixed by two markers that lie far apart) the one is taken that the
    best-agreeing part of the markers fits closest (least quantile of squares, P. J. Rousseeuw 1984,
    doi:10.1080/01621459.1984.10477105), those near the border counting more; it is then refined by
    re-weighted least squares with Tukey's weight. The scale is not estimated: a press in the middle of
    a sheet looks like a change of scale.

    Attributes:
        part: of the markers' weight that must move as one.
        border_weight: of a marker at the border, against 1 in the middle.
        candidates: pairs of markers that propose a motion.
        voters: markers that judge the proposals, about; the refinement uses all.
        refinements: steps of re-weighting.
    """

    part: float = 0.35
    border_weight: float = 2.0
    candidates: int = 48
    voters: int = 150
    refinements: int = 4

    def pairs(self, rest_mm: Points2) -> np.ndarray:
        """(candidates, 2) markers far apart, the same for the same layout."""
        chance = np.random.default_rng(0)
        count = len(rest_mm)
        first = chance.integers(count, size=8 * self.candidates)
        second = chance.integers(count, size=8 * self.candidates)
        far = np.linalg.norm(rest_mm[first] - rest_mm[second], axis=1)
        best = np.argsort(-far, kind="stable")[: 4 * self.candidates : 4]
        return np.column_stack([first[best], second[best]])

    def weights(self, rest_mm: Points2) -> Scalars:
        """(m,) from 1 in the middle to `border_weight` at the border."""
        half = np.maximum(np.ptp(rest_mm, axis=0) / 2, 1e-12)
        out = np.abs((rest_mm - rest_mm.min(axis=0)) / half - 1.0).max(axis=1)
        weight: Scalars = 1.0 + (self.border_weight - 1.0) * out**2
        return weight

    def __call__(
        self, rest_mm: Points2, moved_mm: Points2, is_seen: Mask, std_mm: float, pairs: np.ndarray
    ) -> ViewMotion:
        """The motion of the view from displacements (m, 2); none when nothing is seen.

        Args:
            rest_mm: (m, 2) in the plane of the sheet.
            moved_mm: (m, 2) displacements; those of markers that are not seen are not looked at.
            is_seen: (m,).
            std_mm: of a marker's place; residuals below it tell nothing.
            pairs: from `pairs`.
        """
        if not is_seen.any():
            return ViewMotion(shift_mm=read_only(np.zeros(2)), angle_rad=0.0)
        place, moved = _as_complex(rest_mm), _as_complex(moved_mm)
        weight = np.where(is_seen, self.weights(rest_mm), 0.0)
        moved = np.where(is_seen, moved, 0.0)
        usable = pairs[is_seen[pairs].all(axis=1)]
        span = place[usable[:, 1]] - place[usable[:, 0]]
        usable, span = usable[np.abs(span) > 0], span[np.abs(span) > 0]
        angle = ((moved[usable[:, 1]] - moved[usable[:, 0]]) / span).imag
        shift = (moved[usable] - 1j * angle[:, None] * place[usable]).mean(axis=1)
        middle = np.median(moved[is_seen].real) + 1j * np.median(moved[is_seen].imag)
        angle, shift = np.append(angle, 0.0), np.append(shift, middle)
        some = np.flatnonzero(is_seen)
        some = some[:: max(1, len(some) // self.voters)]
        residual = np.abs(moved[some] - shift[:, None] - 1j * angle[:, None] * place[some])
        best = int(np.argmin(self._spread(residual, weight[some])))
        return self._refined(place, moved, weight, (shift[best], float(angle[best])), std_mm)

    def _spread(self, residual: np.ndarray, weight: Scalars) -> np.ndarray:
        """(candidates,) distance within which the best-agreeing part lies."""
        order = np.argsort(residual, axis=1)
        reached = np.cumsum(weight[order], axis=1) >= self.part * weight.sum()
        at = np.take_along_axis(order, reached.argmax(axis=1)[:, None], axis=1)
        return np.asarray(np.take_along_axis(residual, at, axis=1)[:, 0])

    def _refined(
        self,
        place: np.ndarray,
        moved: np.ndarray,
        weight: Scalars,
        motion: tuple[complex, float],
        std_mm: float,
    ) -> ViewMotion:
        shift, angle = motion
        for _ in range(self.refinements):
            residual = np.abs(moved - shift - 1j * angle * place)
            gate = 3.0 * max(float(self._spread(residual[None], weight)[0]), std_mm)
            w = weight * np.maximum(1.0 - (residual / gate) ** 2, 0.0) ** 2
            total = w.sum()
            mean, middle = (w * moved).sum() / total, (w * place).sum() / total
            arm = place - middle
            lever = (w * np.abs(arm) ** 2).sum()
            angle = float((w * (arm.conj() * (moved - mean)).imag).sum() / lever) if lever > 0 else 0.0
            shift = mean - 1j * angle * middle
        return ViewMotion(shift_mm=read_only(np.array([shift.real, shift.imag])), angle_rad=angle)


def _as_complex(point: Points2) -> np.ndarray:
    return np.asarray(point[:, 0] + 1j * point[:, 1])
