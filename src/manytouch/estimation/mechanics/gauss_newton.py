"""The shape of the sheet that explains the dots with few forces: damped Gauss-Newton steps.

    sum_i w_i |p_i(c) - y_i|^2 / s_i^2  +  sum_j g_j(c)^2 / (su^2 + (mu_f f_j)^2)  +  sum_j b_j f_j(c)^2

with c the spline coefficients, p the displacement of the dots in the image, g the nodal forces tangential
to the bent sheet, f the normal ones, and b_j = 1 / (q_j + eps^2) taken anew after each step, which makes the
forces sparse and keeps them from pulling (M. E. Tipping 2001, "Sparse Bayesian learning"). q_j is
max(f_j, 0)^2 or a share of its mean over the nodes around j, whichever is more: a contact may cover nodes
that lie together at the price of one, so it is not drawn to the nearest node (Z. Zhang and B. D. Rao
2013, doi:10.1109/TSP.2013.2241055).
"""

from dataclasses import dataclass

import numpy as np

from manytouch.estimation.mechanics.force_clusters import smoothed
from manytouch.estimation.mechanics.sheet_model import SheetModel
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.solver.normal_equations import Curvature
from manytouch.values.arrays import Covariances2, Points2, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetShape:
    """A shape of the sheet and the forces that hold it there.

    Attributes:
        coefficient_mm: (n, 3) of the displacement of the middle surface.
        force_mm2: (n, 3) nodal forces over E of what touches the sheet; a press has z < 0.
        moved_px: (m, 2) displacements of the dots' images.
    """

    coefficient_mm: Nodal
    force_mm2: Nodal
    moved_px: Points2

    @staticmethod
    def of(model: SheetModel, coefficient_mm: Nodal) -> "SheetShape":
        """The shape with these coefficients."""
        return SheetShape(
            coefficient_mm=read_only(coefficient_mm),
            force_mm2=read_only(model.shell.forces(coefficient_mm)),
            moved_px=read_only(model.dots.displacement_px(coefficient_mm)),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Fit:
    """What the steps of a frame came to.

    Attributes:
        shape: the last shape that lowered the sum.
        near: curvature of the objective, for read-outs of this frame and for the first step of the next.
        chi2: mean square of the residuals over their deviation, of the dots that count.
        steps: whole ones that were taken; none where one with the curvature of the frame before was enough.
        status: "ok" or "not_converged".
    """

    shape: SheetShape
    near: Curvature
    chi2: float
    steps: int
    status: str


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GaussNewton:
    """Parameters of the descent; forces are parts of pitch times thickness, the sheet's force unit.

    Attributes:
        tangential: su, what is left over of tangential forces.
        friction: mu_f, share of a normal force that may be tangential.
        sparse: eps, normal force of a node that is as good as none.
        nearby: share of the mean square over the nodes around it that a node's own force counts at least.
        prior: weight of the normal forces against the dots.
        settled: steps go on while the normal forces change by more than this share in one, not counting
            what changes by less than `sparse`, up to `usual_steps`: a sheet at rest needs none.
        renew_frames: a step with the curvature of an earlier frame is enough while normal forces are settled
            against those that it was made with, for so many frames; without end where nothing presses.
        same_dots: that curvature is good for a first step while the weights of the dots
            changed by no more than this share.
        far_chi2: above it the shape is far off, and steps go on as long as each lowers it by the share
            `least_gain`, up to `most_steps`.
        lost_chi2: above it nothing is explained, and the shape stays that of the frame before.
        longest_pitch: no coefficient changes by more in a step.
        outside: weight of forces where the sheet is not known, against the others.
        halvings: of a step that does not help, before it is given up.
    """

    tangential: float = 2.0e-4
    friction: float = 0.05
    sparse: float = 1.7e-4
    nearby: float = 0.5
    prior: float = 3.0
    settled: float = 0.1
    renew_frames: int = 3
    same_dots: float = 0.1
    far_chi2: float = 4.0
    lost_chi2: float = 400.0
    least_gain: float = 0.3
    usual_steps: int = 2
    most_steps: int = 6
    longest_pitch: float = 1.5
    halvings: int = 3
    outside: float = 1e-4

    def __call__(
        self,
        model: SheetModel,
        start: SheetShape,
        measured_px: Points2,
        information: Covariances2,
        noise: float = 1.0,
        *,
        near: Curvature | None = None,
        near_frames: int = 0,
    ) -> Fit:
        """Steps from the shape of the frame before.

        Args:
            model: of the sheet.
            start: where to begin.
            measured_px: (m, 2) displacements of the dots from rest; anything finite where not seen.
            information: (m, 2, 2) per px^2; 0 where not seen.
            noise: how much noisier than usual the dots are; the prior is eased by it and `sparse` grows with
                it, or what their noise hides would count as evidence against a force.
            near: curvature of the frame before: the first step is taken with it. It is the only one where
                forces stay what they were when it was made.
            near_frames: frames since it was made.
        """
        shape, steps, status = start, 0, "ok"
        at = _Place.of(model, shape, measured_px, information)
        if near is not None:
            tried = self._chord(model, near, at)
            if tried is not None:
                shape, at = tried.shape, tried
                share = self.settled if near_frames < self.renew_frames else 0.0
                if at.chi2 <= self.far_chi2 and self._is_settled(model, near.force, shape.force_mm2, share):
                    return Fit(shape=shape, near=near, chi2=at.chi2, steps=0, status="ok")
        while True:
            weight = self.weights(model, shape.force_mm2, noise)
            before = at.cost(weight)
            model.normal.linearise(shape.coefficient_mm)
            change_mm = model.normal.step(at.residual_px, information, weight)
            change_mm /= max(float(np.abs(change_mm).max()) / (self.longest_pitch * model.pitch_mm), 1.0)
            for _ in range(self.halvings + 1):
                there = at.moved(model, change_mm)
                if there.cost(weight) <= before * (1.0 + 1e-6):
                    break
                change_mm *= 0.5
            else:
                status = "not_converged"
                break
            gain, earlier, at, shape = at.chi2 - there.chi2, shape, there, there.shape
            steps += 1
            if at.chi2 > self.far_chi2 and gain > self.least_gain * at.chi2:
                if steps >= self.most_steps:
                    break
            elif steps >= self.usual_steps or self._is_settled(
                model, earlier.force_mm2, shape.force_mm2, self.settled
            ):
                break
        if at.chi2 <= self.far_chi2:
            status = "ok"
        elif at.chi2 > self.lost_chi2:
            shape, status = start, "not_converged"
        return Fit(shape=shape, near=model.normal.kept(), chi2=at.chi2, steps=steps, status=status)

    def _chord(self, model: SheetModel, near: Curvature, at: "_Place") -> "_Place | None":
        """Where a step with an earlier curvature leads; None where that does not help."""
        changed = float(np.abs(at.information - near.information).sum())
        if changed > self.same_dots * float(np.abs(near.information).sum()):
            return None
        model.normal.recall(near)
        change_mm = model.normal.chord_step(at.residual_px, at.information, at.balance_mm2)
        if float(np.abs(change_mm).max()) > self.longest_pitch * model.pitch_mm:
            return None
        there = at.moved(model, change_mm)
        return there if there.cost(near.weight) <= at.cost(near.weight) * (1.0 + 1e-6) else None

    def weights(self, model: SheetModel, force_mm2: Nodal, noise: float = 1.0) -> Nodal:
        """(n, 3) weights of tangential and normal forces."""
        unit = model.lattice.force_unit_mm2
        press = np.maximum(-force_mm2[:, 2], 0.0)
        around2 = smoothed((press**2).reshape(model.lattice.shape)).ravel()
        weight = np.empty_like(force_mm2)
        tangential = (self.tangential * unit) ** 2 + (self.friction * press) ** 2
        weight[:, :2] = (1.0 / tangential)[:, None]
        weight[:, 2] = self.prior / (
            noise * np.maximum(press**2, self.nearby * around2) + (noise * self.sparse * unit) ** 2
        )
        weight[model.is_outside] *= self.outside
        return weight

    def _is_settled(self, model: SheetModel, before_mm2: Nodal, now_mm2: Nodal, share: float) -> bool:
        counts = ~model.is_outside
        least_mm2 = self.sparse * model.lattice.force_unit_mm2
        change_mm2 = np.abs(now_mm2 - before_mm2)[counts, 2] - least_mm2
        all_mm2 = float(np.abs(now_mm2[counts, 2]).sum())
        return float(np.maximum(change_mm2, 0.0).sum()) <= share * all_mm2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Place:
    """Where the descent is, and what is left over there of the dots and of the balance of forces."""

    shape: SheetShape
    measured_px: Points2
    information: Covariances2
    balance_mm2: Nodal

    @staticmethod
    def of(model: SheetModel, shape: SheetShape, measured_px: Points2, information: Covariances2) -> "_Place":
        return _Place(
            shape=shape,
            measured_px=measured_px,
            information=information,
            balance_mm2=balance(model, shape.coefficient_mm, shape.force_mm2),
        )

    def moved(self, model: SheetModel, change_mm: Nodal) -> "_Place":
        there = SheetShape.of(model, self.shape.coefficient_mm + change_mm)
        return _Place.of(model, there, self.measured_px, self.information)

    @property
    def residual_px(self) -> Points2:
        return np.asarray(self.shape.moved_px - self.measured_px)

    @property
    def misfit(self) -> float:
        return float(np.einsum("mi,mij,mj->", self.residual_px, self.information, self.residual_px))

    @property
    def chi2(self) -> float:
        """Mean square of the residuals that count, over their deviation."""
        return self.misfit / max(2.0 * float((self.information[:, 0, 0] > 0.0).sum()), 1.0)

    def cost(self, weight: Nodal) -> float:
        return self.misfit + float((weight * self.balance_mm2**2).sum())


def balance(model: SheetModel, coefficient_mm: Nodal, force_mm2: Nodal) -> Nodal:
    """(n, 3) nodal forces along the bent sheet, x and y, and the normal ones."""
    w_mm = coefficient_mm[model.nodes.node, 2]
    along = force_mm2.copy()
    along[:, 0] += (model.nodes.dx * w_mm).sum(axis=1) * force_mm2[:, 2]
    along[:, 1] += (model.nodes.dy * w_mm).sum(axis=1) * force_mm2[:, 2]
    along[~model.patch.is_free] = 0.0
    return along
