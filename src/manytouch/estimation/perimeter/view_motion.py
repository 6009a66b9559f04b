"""How far the whole view moved: what camera and frame did, not what touches the sheet."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.values.arrays import Mask, Points2, read_only


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
class MotionHypotheses:
    """What the layout decides of finding the view.

    Attributes:
        pairs: (candidates, 2) markers that propose a motion.
        weight: (m,) of the markers: more at the border.
    """

    pairs: np.ndarray
    weight: Float64[np.ndarray, " m"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RigidMotionEstimator:
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
        voters: markers that judge the proposals and what is far off, about; the refinement uses all.
        refinements: steps of re-weighting.
    """

    part: float = 0.35
    border_weight: float = 2.0
    candidates: int = 48
    voters: int = 150
    refinements: int = 4

    def judges(self, rest_mm: Points2) -> MotionHypotheses:
        """Pairs of markers far apart, the same for the same layout, and the weights of all."""
        from manytouch.estimation.perimeter.view_kernels import border_weights

        chance = np.random.default_rng(0)
        count = len(rest_mm)
        first = chance.integers(count, size=8 * self.candidates)
        second = chance.integers(count, size=8 * self.candidates)
        far = np.linalg.norm(rest_mm[first] - rest_mm[second], axis=1)
        best = np.argsort(-far, kind="stable")[: 4 * self.candidates : 4]
        pairs = np.column_stack([first[best], second[best]])
        return MotionHypotheses(pairs=pairs, weight=border_weights(rest_mm, self.border_weight))

    def __call__(
        self, rest_mm: Points2, moved_mm: Points2, is_seen: Mask, std_mm: float, judges: MotionHypotheses
    ) -> ViewMotion:
        """The motion of the view from displacements (m, 2); none when nothing is seen.

        Args:
            rest_mm: (m, 2) in the plane of the sheet.
            moved_mm: (m, 2) displacements; those of markers that are not seen are not looked at.
            is_seen: (m,).
            std_mm: of a marker's place; residuals below it tell nothing.
            judges: from `judges`.
        """
        from manytouch.estimation.perimeter.view_kernels import motion_of

        motion = motion_of(
            *(rest_mm, moved_mm, is_seen, std_mm, judges.weight, judges.pairs),
            *(self.part, self.voters, self.refinements),
        )
        return ViewMotion(shift_mm=read_only(motion[:2]), angle_rad=float(motion[2]))
