"""Estimate of the body force on the sheet: weight and inertia on a sensor that moves.

At rest the sheet balances its weight, and its shape there is the reference. If the sensor is turned the
weight acts in another direction, and if it accelerates, the inertia of the sheet acts too. Both are a force
per volume that is the same everywhere. A fit without it explains their deflection by forces of objects.

The acceleration a is estimated with the shape, by the Gauss-Newton step of the objective of `gauss_newton` in
both: the balance T (f - W a) changes by -T W a, with W the nodal forces of 1 g along each axis, and by the
change of the shape, H^-1 R^T D T W a (the terms of `sheet_parameters`). The shape is already at its best for
the earlier a, so that the rest of the step is one along a.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.frame_interval import remaining
from manytouch.estimation.mechanics.inversion.iterate import Iterate, balance
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.inversion.sheet_shape import BodyForce, SheetShape
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.solver.posterior import Posterior
from manytouch.values.arrays import read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodyForceEstimator:
    """Parameters of the estimate; accelerations are along each axis of the sheet, in multiples of g.

    Attributes:
        std_g: standard deviation of the difference of the acceleration from that at rest; 0 if the sensor is
            fixed. Turned upside down it is 2 along z.
        memory_s: time constant with which the acceleration that is expected falls off to that at rest.
        most_g: largest estimate.
        least_change_g: smaller changes are left out.
        model_share: relative standard deviation of the effect of a body force. In the model a sheet at rest
            is flat, but a slack one hangs and is stiffer than that.
        most_s: a first estimate is made at most so long after the first contact: forces that stand for a
            body force are found as contacts.
        least_gain: least decrease of the objective by a first estimate.
        least_share: the same, over what the forces add to the objective beyond that at rest. Presses have up
            to 0.42, a body force 0.7 and more when it is clear (ADR 176).
        pull_force: forces that pull a sheet without contacts have together at least so many least forces of a
            contact, if `pulled_share` is to replace `least_share`: objects press.
        pulled_share: see `pull_force`.
        most_left: largest nodal force that presses in a first fit with a body force, over
            `GaussNewton.negligible_force`. What remains of presses is larger.
        rest_share: weight of the latest frame in the mean of what the forces add to the objective at rest.
        most_rest_growth: a frame with more than this times the mean is not one at rest.
        first_steps: of a frame that is fitted with a body force for the first time.
    """

    std_g: float = 1.0
    memory_s: float = 1.65
    most_g: float = 2.5
    least_change_g: float = 0.01
    model_share: float = 0.1
    most_s: float = 0.51
    least_gain: float = 5.0
    least_share: float = 0.6
    pull_force: float = 5.0
    pulled_share: float = 0.2
    most_left: float = 0.2
    rest_share: float = 0.1
    most_rest_growth: float = 1.3
    first_steps: int = 3

    def first(
        self,
        model: InversionModel,
        posterior: Posterior,
        shape: SheetShape,
        balance_mm2: Nodal,
        *,
        rest_cost: float,
        is_touched: bool,
    ) -> BodyForce | None:
        """A body force of 0 that is not known, if one explains the forces of a shape without; else None.

        Args:
            model: of the sheet.
            posterior: of the fit.
            shape: of the fit.
            balance_mm2: of the fit.
            rest_cost: that of the forces of a sheet at rest, from `rest_cost`.
            is_touched: whether there are contacts.
        """
        if self.std_g == 0.0 or not model.weight_mm2.any():
            return None
        weighted = posterior.weight * balance_mm2
        cost = float(np.vdot(weighted, balance_mm2)) - rest_cost
        pull_mm2 = float(shape.force_mm2[~model.is_excluded, 2].sum())
        if cost < self.least_gain or abs(pull_mm2) > self.most_g * float(model.weight_mm2.sum()):
            return None
        is_pulled = not is_touched and pull_mm2 > self.pull_force * model.nodes.least_force_mm2
        response = _response(model, posterior)
        gradient = np.einsum("kni,ni->k", response.balance_mm2, weighted)
        covariance_g2 = np.linalg.inv(response.information + np.eye(3) / self.std_g**2)
        there_g = covariance_g2 @ gradient
        share = self.pulled_share if is_pulled else self.least_share
        is_clear = gradient @ there_g >= max(self.least_gain, share * cost)
        if not is_clear or np.abs(there_g).max() > self.most_g:
            return None
        return BodyForce(
            acceleration_g=read_only(np.zeros(3)),
            covariance_g2=read_only(self.std_g**2 * np.eye(3)),
            force_mm2=read_only(np.zeros((model.patch.node_count, 3))),
        )

    def rest_cost(self, before: float, cost: float) -> float:
        """What the forces of a sheet at rest add to the objective, by noise: a mean over frames.

        Args:
            before: without the latest frame without contacts; NaN if there is none.
            cost: of that frame, `Fit.force_cost`.
        """
        if np.isnan(before):
            return cost
        is_at_rest = cost <= self.most_rest_growth * before
        return before + self.rest_share * (cost - before) if is_at_rest else before

    def expected(self, before: BodyForce | None, elapsed_s: float) -> BodyForce | None:
        """What is expected of the body force of the next frame, so long after that of a frame."""
        if before is None:
            return None
        kept = remaining(elapsed_s, self.memory_s)
        more_g2 = (1.0 - kept**2) * self.std_g**2 * np.eye(3)
        return BodyForce(
            acceleration_g=read_only(kept * before.acceleration_g),
            covariance_g2=read_only(kept**2 * before.covariance_g2 + more_g2),
            force_mm2=read_only(kept * before.force_mm2),
        )

    def __call__(
        self, model: InversionModel, posterior: Posterior, here: Iterate, expected: BodyForce | None
    ) -> Iterate:
        """The iterate after the part of a step along the acceleration.

        Args:
            model: of the sheet.
            posterior: of the part of the step along the coefficients, which led here.
            here: unchanged if its shape has no body force.
            expected: of the body force, from `expected`.
        """
        now = here.shape.body_force
        if now is None or expected is None:
            return here
        response = _response(model, posterior)
        prior = np.linalg.inv(expected.covariance_g2)
        gradient = np.einsum("kni,ni->k", response.balance_mm2, posterior.weight * here.balance_mm2)
        gradient -= prior @ (now.acceleration_g - expected.acceleration_g)
        covariance_g2 = np.linalg.inv(response.information + prior)
        there_g = np.clip(now.acceleration_g + covariance_g2 @ gradient, -self.most_g, self.most_g)
        change_g = there_g - now.acceleration_g
        covariance_g2 += np.diag((self.model_share * there_g) ** 2)
        if np.abs(change_g).max() < self.least_change_g:
            body_force = replace(now, covariance_g2=read_only(covariance_g2))
            return replace(here, shape=replace(here.shape, body_force=body_force))
        body_force = BodyForce(
            acceleration_g=read_only(there_g),
            covariance_g2=read_only(covariance_g2),
            force_mm2=read_only(np.tensordot(there_g, nodal_forces_mm2(model), 1)),
        )
        coefficient_mm = here.shape.coefficient_mm + np.tensordot(change_g, response.change_mm, 1)
        shape = SheetShape.at(model, coefficient_mm, body_force)
        return Iterate.at(model, shape, here.measured_px, here.information, here.usual_std_px)


def nodal_forces_mm2(model: InversionModel) -> Float64[np.ndarray, "3 nodes 3"]:
    """Nodal forces over E by 1 g along each axis."""
    return np.asarray(np.eye(3)[:, None] * (model.weight_mm2[:, None] * model.patch.is_free))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Response:
    """Derivatives by the acceleration, per g.

    Attributes:
        balance_mm2: minus that of tangential and normal forces over E, of a shape that stays.
        change_mm: of the coefficients at their best.
        information: (3, 3) half the second derivatives of the objective, with coefficients at their best.
    """

    balance_mm2: Float64[np.ndarray, "3 nodes 3"]
    change_mm: Float64[np.ndarray, "3 nodes 3"]
    information: Float64[np.ndarray, "3 3"]

    @staticmethod
    def of(model: InversionModel, posterior: Posterior) -> "_Response":
        linearisation = posterior.linearisation
        balance_mm2 = np.stack(
            [balance(model, linearisation.slope, each) for each in nodal_forces_mm2(model)]
        )
        weighted = posterior.weight * balance_mm2
        no_motion_px = np.zeros((3, len(posterior.information), 2))
        gradients = linearisation.gradients(no_motion_px, posterior.information, weighted)
        change_mm = posterior.solve(gradients)
        return _Response(
            balance_mm2=balance_mm2,
            change_mm=change_mm,
            information=_products(weighted, balance_mm2) - _products(gradients, change_mm),
        )


def _response(model: InversionModel, posterior: Posterior) -> _Response:
    return posterior.workspace.kept("body force", model.weight_mm2, lambda: _Response.of(model, posterior))


def _products(one: Float64[np.ndarray, "3 nodes 3"], other: Float64[np.ndarray, "3 nodes 3"]) -> np.ndarray:
    """(3, 3) scalar products."""
    return np.asarray(one.reshape(3, -1) @ other.reshape(3, -1).T)
