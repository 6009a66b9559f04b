"""The shape of the sheet that explains the marker images with few forces, by Gauss-Newton steps.

A step that increases the cost is halved. Only a normal matrix that is singular is damped, in
`mechanics.solver.normal_equations`.

Minimised over the spline coefficients c is

    sum_i w_i |p_i(c) - y_i|^2 / s_i^2  +  sum_j g_j(c)^2 / (su^2 + (mu_f f_j)^2)  +  sum_j b_j f_j(c)^2

with p the displacements of the marker images, y the measured ones, g the nodal forces tangential to the
deformed sheet and f the normal ones (f_j > 0 presses, that is force z < 0); `information` is w_i / s_i^2.
b_j = prior_weight / (q_j + eps^2) with both terms scaled by the noise of the frame is updated after each
step, which makes the forces sparse and compressive (M. E. Tipping 2001, "Sparse Bayesian learning"). q_j is
max(f_j, 0)^2 or a share of its mean over node j and its neighbours, whichever is larger: neighbouring nodes
together cost as much as one, so that a contact is not attracted by the nearest node (Z. Zhang and B. D. Rao
2013, doi:10.1109/TSP.2013.2241055).

There are three kinds of steps. A full step computes everything again. A reweighted step computes only the
weights of the forces that changed, and updates the factor of the normal matrix by a change of low rank
(`Posterior.reweighted`). A chord step computes only the residuals. Where a contact moves, each frame needs
new weights, but not new derivatives (ADR 79).

A prior with mean 0 can be added in `weights`. A prior with another mean also needs a term in the cost, in the
normal equations and in the steps with an earlier posterior.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.frame_interval import USUAL_S
from manytouch.estimation.mechanics.inversion.beyond_markers import BeyondMarkers
from manytouch.estimation.mechanics.inversion.body_force_estimator import BodyForceEstimator
from manytouch.estimation.mechanics.inversion.force_nodes import smooth
from manytouch.estimation.mechanics.inversion.iterate import Iterate
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.inversion.sheet_shape import BodyForce, SheetShape
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.solver.posterior import Posterior
from manytouch.values import Status
from manytouch.values.arrays import Covariances2, Points2

COST_TOLERANCE = 1.0 + 1e-6
"""A step is accepted if it multiplies the cost by at most this; rounding may increase it."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Fit:
    """Result of the steps of one frame.

    Attributes:
        shape: the last accepted shape; the previous one if the fit failed.
        posterior: of the last full or reweighted step, for covariances of this frame and for the first step
            of the next.
        residual_px: (m, 2) predicted minus measured displacements of the marker images.
        balance_mm2: (n, 3) tangential and normal nodal forces over E.
        chi2: mean square of the residuals over their deviation, of the markers with weight.
        worst_chi2: the same of the marker where it is largest.
        force_unit_mm2: unit of the thresholds of nodal forces over E; see `GaussNewton.force_unit_mm2`.
        steps: number of full steps; 0 if steps with the derivatives of an earlier frame were sufficient.
        status: `OK` or `NOT_CONVERGED`.
    """

    shape: SheetShape
    posterior: Posterior
    residual_px: Points2
    balance_mm2: Nodal
    chi2: float
    worst_chi2: float
    force_unit_mm2: float
    steps: int
    status: Status

    @property
    def force_cost(self) -> float:
        """The part of the objective that is that of the forces, with the weights of the posterior."""
        return float(np.vdot(self.posterior.weight * self.balance_mm2, self.balance_mm2))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GaussNewton:
    """Parameters of the objective and of the iteration; forces are in force units, pitch times thickness.

    Attributes:
        tangential_std: su, standard deviation of tangential forces without a normal force.
        friction: mu_f, share of a normal force that may be tangential.
        negligible_force: eps, below which the normal force of a node is treated as zero.
        negligible_stds: largest eps, in standard deviations by noise of a single force in the middle of the
            sheet. A large, thin and slack sheet shows much smaller forces than others of its pitch and
            thickness (ADR 155).
        neighbour_share: a node's squared force counts as at least this share of the mean over its neighbours.
        beyond_markers: weights of the forces beyond the markers of an assumed sheet.
        body_force: the estimate of weight and inertia of a sheet whose sensor moves.
        prior_weight: weight of the normal forces against the markers.
        convergence_share: the iteration ends when the normal forces change by at most this share in a step;
            changes below `negligible_force` do not count.
        max_posterior_frames: a step with the posterior of an earlier frame is sufficient for this many
            frames, while the normal forces stay within `convergence_share` of those at its linearisation;
            without limit while no normal force changes by more than `negligible_force`.
        max_information_change: such a step is tried if the information of the markers changed by at most this
            share.
        poor_chi2: above it the iteration goes on up to `max_steps_if_poor` steps, as long as each step
            reduces it by more than `min_gain` of the remaining chi2. A choice, without a recorded
            comparison of values: residuals of twice their deviations, so that it relies on deviations of the
            markers that hold within a factor of two.
        max_worst_growth: a step with the derivatives of an earlier frame is not sufficient if it leaves a
            marker a chi2 of more than this times the largest after the last full step, or times `poor_chi2`
            if that is more: the weights keep an object that slides where it was. Compared: 1.5, 2, 3, 4.
        max_stiffening: nor is it sufficient if the mean tension of the sheet has made it stiffer or softer by
            more than this factor since: next to a sudden press on a slack sheet, old derivatives show forces
            where there are none (ADR 155).
        failed_chi2: above it the fit has failed, and the shape of the previous frame is kept.
        min_gain: see `poor_chi2`.
        max_steps: full steps of a frame whose chi2 is not poor.
        max_steps_if_poor: full steps otherwise.
        max_reweightings: reweighted steps with the derivatives of one full step, before the next one.
        min_growth: where the normal forces have become more than this factor of those of the weights, all of
            these steps are taken at once: the forces of new contacts are spread at first (ADR 156).
        min_weight_ratio: a reweighted step keeps the weights that changed by less than this factor since the
            full step.
        max_reweighted: largest number of weights that a reweighted step changes: those that changed most.
        max_kept_weight_ratio: a full step is taken instead if a weight that would be kept changed by a larger
            factor.
        max_change_pitch: largest change of a coefficient in a step, in pitches.
        max_halvings: of a step that increases the cost, before the iteration ends.
    """

    tangential_std: float = 2.0e-4
    friction: float = 0.05
    negligible_force: float = 1.7e-4
    negligible_stds: float = 12.0
    neighbour_share: float = 0.5
    beyond_markers: BeyondMarkers = field(default_factory=BeyondMarkers)
    body_force: BodyForceEstimator = field(default_factory=BodyForceEstimator)
    prior_weight: float = 3.0
    convergence_share: float = 0.1
    max_posterior_frames: int = 3
    max_information_change: float = 0.1
    poor_chi2: float = 4.0
    max_worst_growth: float = 1.5
    max_stiffening: float = 1.1
    failed_chi2: float = 400.0
    min_gain: float = 0.3
    max_steps: int = 2
    max_steps_if_poor: int = 6
    max_reweightings: int = 3
    min_growth: float = 1.5
    min_weight_ratio: float = 1.5
    max_reweighted: int = 64
    max_kept_weight_ratio: float = 2.5
    max_change_pitch: float = 1.5
    max_halvings: int = 3

    def __call__(
        self,
        model: InversionModel,
        start: SheetShape,
        measured_px: Points2,
        information: Covariances2,
        noise: float = 1.0,
        *,
        usual_std_px: float = np.inf,
        posterior: Posterior | None = None,
        posterior_frames: int = 0,
        posterior_worst_chi2: float = 0.0,
        elapsed_s: float = USUAL_S,
    ) -> Fit:
        """Fits the shape to one frame.

        Args:
            model: of the sheet.
            start: initial shape, that of the previous frame.
            measured_px: (m, 2) displacements of the marker images; any finite value where not seen.
            information: (m, 2, 2) per px^2; 0 where not seen.
            noise: ratio of the marker noise to the usual one, at least 1. It reduces the weight of the prior
                and increases `negligible_force`: a force that the noise hides is not evidence for its
                absence.
            usual_std_px: the usual standard deviation of the marker images, for `negligible_stds`.
            posterior: of an earlier frame; the first step is taken with it.
            posterior_frames: number of frames since then.
            posterior_worst_chi2: that of the last full step.
            elapsed_s: time since the frame before.
        """
        expected = self.body_force.expected(start.body_force, elapsed_s)
        here = Iterate.at(model, start, measured_px, information, usual_std_px)
        if posterior is not None:
            there = self._try_chord_step(model, posterior, here)
            if there is not None:
                here = self.body_force(model, posterior, there, expected)
                if here.chi2 <= self.poor_chi2 and self._is_as_stiff(model, posterior, here):
                    share = self.convergence_share if posterior_frames < self.max_posterior_frames else 0.0
                    most_chi2 = self.max_worst_growth * max(posterior_worst_chi2, self.poor_chi2)
                    is_converged = self._is_converged(model, posterior.weighed_mm2, here, share)
                    if is_converged and here.worst_chi2 <= most_chi2:
                        return self._fit(model, here, posterior, steps=0)
                    is_grown = self._is_grown(posterior.weighed_mm2, here.shape.force_mm2)
                    while posterior.reweightings < self.max_reweightings:
                        reweighted = self._reweighted_step(model, posterior, here, noise)
                        if reweighted is None:
                            break
                        here, posterior = reweighted
                        if here.worst_chi2 > most_chi2:
                            break
                        if not is_grown or posterior.reweightings == self.max_reweightings:
                            return self._fit(model, here, posterior, steps=0)
        return self._iterate(model, start, here, noise, expected=expected)

    def _iterate(
        self,
        model: InversionModel,
        start: SheetShape,
        here: Iterate,
        noise: float,
        *,
        expected: BodyForce | None,
    ) -> Fit:
        """Full steps until the forces converge; a reweighted step replaces the second one where it can."""
        steps, status = 0, Status.OK
        while True:
            weight = self.weights(model, here.shape, noise, here.usual_std_px)
            linearisation = model.normal_equations.linearise(here.shape.coefficient_mm, here.shape.force_mm2)
            posterior = model.normal_equations.solve(
                linearisation, here.residual_px, here.information, weight
            )
            there = self._search_line(model, here, posterior.change_mm, weight)
            if there is None:
                status = Status.NOT_CONVERGED
                break
            there = self.body_force(model, posterior, there, expected)
            gain, before_mm2, here = here.chi2 - there.chi2, here.shape.force_mm2, there
            steps += 1
            if here.chi2 > self.poor_chi2 and gain > self.min_gain * here.chi2:
                if steps >= self.max_steps_if_poor:
                    break
                continue
            if steps >= self.max_steps or self._is_converged(model, before_mm2, here, self.convergence_share):
                break
            reweighted = self._reweighted_step(model, posterior, here, noise)
            if reweighted is not None:
                here, posterior = reweighted
                break
        shape = here.shape
        if here.chi2 <= self.poor_chi2:
            status = Status.OK
        elif here.chi2 > self.failed_chi2:
            shape, status = start, Status.NOT_CONVERGED
        return replace(self._fit(model, here, posterior, steps=steps, status=status), shape=shape)

    def _reweighted_step(
        self, model: InversionModel, posterior: Posterior, here: Iterate, noise: float
    ) -> tuple[Iterate, Posterior] | None:
        """A step with new weights and the derivatives of an earlier full step; None if that is not enough."""
        weighed_mm2 = here.shape.force_mm2
        new = posterior.reweighted(
            self.weights(model, here.shape, noise, here.usual_std_px),
            weighed_mm2,
            residual_px=here.residual_px,
            information_per_px2=here.information,
            balance=here.balance_mm2,
            min_ratio=self.min_weight_ratio,
            max_kept_ratio=self.max_kept_weight_ratio,
            max_rows=self.max_reweighted,
        )
        there = None if new is None else self._search_line(model, here, new.change_mm, new.weight)
        return None if new is None or there is None else (there, new)

    def _search_line(
        self, model: InversionModel, here: Iterate, change_mm: Nodal, weight: Nodal
    ) -> Iterate | None:
        """The first of the step and its halves that does not increase the cost; None if none does."""
        largest = self.max_change_pitch * model.pitch_mm
        change_mm = change_mm / max(float(np.abs(change_mm).max()) / largest, 1.0)
        before = here.cost(weight)
        for _ in range(self.max_halvings + 1):
            there = here.move(model, change_mm)
            if there.cost(weight) <= before * COST_TOLERANCE:
                return there
            change_mm = change_mm * 0.5
        return None

    def _try_chord_step(self, model: InversionModel, posterior: Posterior, here: Iterate) -> Iterate | None:
        """The iterate after a step with an earlier posterior; None if too large or if the cost increases."""
        changed = float(np.abs(here.information - posterior.information).sum())
        if changed > self.max_information_change * float(np.abs(posterior.information).sum()):
            return None
        change_mm = posterior.chord_step(here.residual_px, here.information, here.balance_mm2)
        if float(np.abs(change_mm).max()) > self.max_change_pitch * model.pitch_mm:
            return None
        there = here.move(model, change_mm)
        return there if there.cost(posterior.weight) <= here.cost(posterior.weight) * COST_TOLERANCE else None

    def _fit(
        self,
        model: InversionModel,
        here: Iterate,
        posterior: Posterior,
        *,
        steps: int,
        status: Status = Status.OK,
    ) -> Fit:
        return Fit(
            shape=here.shape,
            posterior=posterior,
            residual_px=here.residual_px,
            balance_mm2=here.balance_mm2,
            chi2=here.chi2,
            worst_chi2=here.worst_chi2,
            force_unit_mm2=self.force_unit_mm2(model, here.shape.slope, here.usual_std_px),
            steps=steps,
            status=status,
        )

    def force_unit_mm2(
        self, model: InversionModel, slope: Float64[np.ndarray, "nodes 2"], usual_std_px: float
    ) -> float:
        """Unit of the thresholds of nodal forces over E for a shape of the sheet with these slopes.

        It is pitch times thickness, or less where `negligible_stds` makes `negligible_force` less.
        """
        noise_mm2 = model.nodes.force_noise_mm2(slope, usual_std_px)
        return min(model.nodes.force_unit_mm2, self.negligible_stds / self.negligible_force * noise_mm2)

    def weights(
        self, model: InversionModel, shape: SheetShape, noise: float = 1.0, usual_std_px: float = np.inf
    ) -> Nodal:
        """(n, 3) weights of the tangential and normal forces, per mm^4."""
        press = np.maximum(-shape.force_mm2[:, 2], 0.0)
        around2 = smooth((press**2).reshape(model.nodes.shape)).ravel()
        weight = np.empty_like(shape.force_mm2)
        tangential_mm2 = self.tangential_std * model.nodes.force_unit_mm2
        weight[:, :2] = (1.0 / (tangential_mm2**2 + (self.friction * press) ** 2))[:, None]
        negligible_mm2 = self.negligible_force * self.force_unit_mm2(model, shape.slope, usual_std_px)
        weight[:, 2] = self.prior_weight / (
            noise * np.maximum(press**2, self.neighbour_share * around2) + (noise * negligible_mm2) ** 2
        )
        weight[model.nodes.is_beyond] = self.beyond_markers.weights(model.nodes, shape.force_mm2)
        return weight

    def _is_as_stiff(self, model: InversionModel, posterior: Posterior, now: Iterate) -> bool:
        """Whether the derivatives of an earlier frame are those of about this tension of the sheet."""
        slopes = posterior.linearisation.slope, now.shape.slope
        before, after = (model.nodes.force_noise_mm2(slope, 1.0) for slope in slopes)
        return max(before / after, after / before) <= self.max_stiffening

    def _is_grown(self, before_mm2: Nodal, now_mm2: Nodal) -> bool:
        before, now = (float(np.abs(force_mm2[:, 2]).sum()) for force_mm2 in (before_mm2, now_mm2))
        return now > self.min_growth * before

    def _is_converged(self, model: InversionModel, before_mm2: Nodal, now: Iterate, share: float) -> bool:
        unit_mm2 = self.force_unit_mm2(model, now.shape.slope, now.usual_std_px)
        now_mm2 = now.shape.force_mm2
        change_mm2 = np.abs(now_mm2 - before_mm2)[:, 2] - self.negligible_force * unit_mm2
        total_mm2 = float(np.abs(now_mm2[:, 2]).sum())
        return float(np.maximum(change_mm2, 0.0).sum()) <= share * total_mm2
