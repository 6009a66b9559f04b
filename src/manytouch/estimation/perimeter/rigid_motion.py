"""Motion of the whole view, which is caused by the camera or its mount and not by contacts."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import plain
from manytouch.estimation.perimeter.surface_inputs import MotionSearch
from manytouch.values.arrays import Mask, Points2, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RigidMotion:
    """A shift and a small rotation of all markers in the plane of the sheet.

    Attributes:
        shift_mm: (2,) of the sheet's origin.
        angle_rad: about the sheet's origin, from x to y.
    """

    shift_mm: Float64[np.ndarray, "2"]
    angle_rad: float

    def displacement(self, rest_mm: Points2) -> Points2:
        """(m, 2) displacement of points at rest."""
        cosine, sine = np.cos(self.angle_rad), np.sin(self.angle_rad)
        turn = np.array([[cosine - 1.0, -sine], [sine, cosine - 1.0]])
        displacement: Points2 = self.shift_mm + rest_mm @ turn.T
        return displacement


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MotionHypotheses:
    """What a search for the motion needs of the layout.

    Attributes:
        pairs: (candidates, 2) markers that define a motion each.
        weight: (m,) of the markers; larger at the border.
    """

    pairs: np.ndarray
    weight: Float64[np.ndarray, " m"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RigidMotionEstimator:
    """Estimates the rigid motion that the markers far from contacts have in common.

    A press moves the markers near it, each differently; elsewhere they move together. Of many candidate
    motions (each defined by two markers that are far apart) the estimate is the one with the least quantile
    of squared residuals (P. J. Rousseeuw 1984, doi:10.1080/01621459.1984.10477105), in which markers near the
    border have more weight; it is then refined by iteratively re-weighted least squares with Tukey's weight.
    The
    scale is not estimated: a press in the middle of a sheet resembles a change of scale.

    Attributes:
        share: of the markers' weight that must move together.
        border_weight: of a marker at the border, relative to 1 in the middle.
        candidates: number of pairs that define a motion.
        voters: approximate number of markers on which motions are compared; the refinement uses all.
        refinements: rounds of re-weighting.
    """

    share: float = 0.35
    border_weight: float = 2.0
    candidates: int = 48
    voters: int = 150
    refinements: int = 4

    def hypotheses(self, rest_mm: Points2) -> MotionHypotheses:
        """Pairs of distant markers, the same for equal layouts, and the weights of all markers."""
        from manytouch.estimation.perimeter.view_kernels import border_weights

        random = np.random.default_rng(0)
        count = len(rest_mm)
        first = random.integers(count, size=8 * self.candidates)
        second = random.integers(count, size=8 * self.candidates)
        distance = np.linalg.norm(rest_mm[first] - rest_mm[second], axis=1)
        best = np.argsort(-distance, kind="stable")[: 4 * self.candidates : 4]
        pairs = np.column_stack([first[best], second[best]])
        return MotionHypotheses(pairs=pairs, weight=border_weights(rest_mm, self.border_weight))

    def search(self, hypotheses: MotionHypotheses) -> MotionSearch:
        """Hypotheses and parameters as the kernels take them."""
        return MotionSearch(hypotheses.pairs, hypotheses.weight, self.share, self.voters, self.refinements)

    def __call__(
        self,
        rest_mm: Points2,
        displacement_mm: Points2,
        is_seen: Mask,
        std_mm: float,
        hypotheses: MotionHypotheses,
    ) -> RigidMotion:
        """The motion of the view, 0 when no marker is seen.

        Args:
            rest_mm: (m, 2) in the plane of the sheet.
            displacement_mm: (m, 2); those of markers that are not seen are not used.
            is_seen: (m,).
            std_mm: standard deviation of a marker's position; smaller residuals are not weighted.
            hypotheses: from `hypotheses`.
        """
        from manytouch.estimation.perimeter.view_kernels import estimate_motion

        search = plain(self.search(hypotheses))
        motion = estimate_motion(rest_mm, displacement_mm, is_seen, std_mm, search)
        return RigidMotion(shift_mm=read_only(motion[:2]), angle_rad=float(motion[2]))
