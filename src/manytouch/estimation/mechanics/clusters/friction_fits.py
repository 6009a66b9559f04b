"""Friction of contacts, which the prior of the tangential forces does not reduce.

The prior expects no tangential forces, so that the inversion returns too little of a shear force. Here they
have another mean: at each node of contact k, r_k times the normal force, where r_k are the unknown ratios of
shear to normal force along x and y. With the tangential forces g, their weights W, the normal forces p_k of
the contact and the normal matrix H of the coefficients c,

    sum_k (p_j^T W p_k - b_j^T H^-1 b_k) r_k = p_j^T W g,      b_k = (dg/dc)^T W p_k,

has the most likely ratios as its solution, and the change of c that belongs to them is sum_k r_k H^-1 b_k
(C. E. Rasmussen and C. K. I. Williams 2006, section 2.7: a Gaussian process with an explicit mean whose
coefficients have a prior). The variance of the prior of a contact's ratios is that by which the ratios of a
first solution, with a wide prior, exceed their noise, so that noise adds no friction where there is none
(empirical Bayes; C. N. Morris 1983, doi:10.1080/01621459.1983.10477920). Deviations are those of the first
solution.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.geometry.spline.patch import Nodal
from manytouch.values import Status

LEAST_VARIANCE = 1e-12
"""Least variance of the prior of a ratio, instead of 0."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Friction:
    """What the friction of the contacts adds to the posterior of a fit.

    Attributes:
        ratio: (contacts, 2) of shear to normal force along x and y.
        change_mm: (nodes, 3) change of the coefficients.
        force_change_mm2: (nodes, 3) change of the nodal forces over E, to first order.
        centre_change_mm: (contacts, 2) change of the centres of the normal forces, which without friction lie
            too far back to compensate what it does.
        white: (k, n) the covariance of the coefficients increases by the sum of the products of each row with
            itself, where these are changes after `Posterior.colour`.
    """

    ratio: Float64[np.ndarray, "contacts 2"]
    change_mm: Nodal
    force_change_mm2: Nodal
    centre_change_mm: Float64[np.ndarray, "contacts 2"]
    white: Float64[np.ndarray, "k n"]

    def covariance(self, rows: Float64[np.ndarray, "g q n"]) -> Float64[np.ndarray, "g q q"]:
        """What it adds to the covariances of q linear functions, for each of g groups.

        Args:
            rows: (g, q, n) their derivatives after `Posterior.whiten`.
        """
        change = rows @ self.white.T
        return np.asarray(change @ change.transpose(0, 2, 1))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FrictionFits:
    """Fits the friction of all contacts of a frame together.

    Attributes:
        ratio_std: standard deviation of the ratios in the wide prior, and the largest one of the other.
    """

    ratio_std: float = 0.5

    def __call__(self, fit: Fit, clusters: Clusters, force_mm2: Nodal) -> Friction | None:
        """The friction of the clusters; None if there are none or the fit has failed.

        Args:
            fit: of the frame.
            clusters: of its forces.
            force_mm2: (nodes, 3) nodal forces over E of the shape whose normal forces are those of the
                contacts.
        """
        count, posterior = len(clusters), fit.posterior
        if count == 0 or fit.status is not Status.OK:
            return None
        linearisation, is_free = posterior.linearisation, posterior.linearisation.shell.patch.is_free
        inside = clusters.label == np.arange(count)[:, None]
        press_mm2 = np.where(inside, np.maximum(-force_mm2[:, 2], 0.0), 0.0)
        weight = posterior.weight[:, :2] * is_free[:, :2]
        weighted = weight.T * press_mm2[:, None]  # by contact and axis
        axes = np.tile(np.arange(2), count)
        pull = linearisation.tangential_gradients(weighted.reshape(2 * count, -1), axes)
        gradient = linearisation.gradient(
            fit.residual_px, posterior.information, posterior.weight * fit.balance_mm2
        )
        white = posterior.whiten(np.concatenate([pull, gradient[None]]))
        white, white_gradient = white[:-1], white[-1]
        information = -white @ white.T
        for axis in range(2):
            information[axis::2, axis::2] += weighted[:, axis] @ press_mm2.T
        wide = np.linalg.inv(information + np.eye(2 * count) / self.ratio_std**2)
        known = np.einsum("kcn,nc->kc", weighted, fit.balance_mm2[:, :2]).ravel() - white @ white_gradient
        ratio = (wide @ known).reshape(count, 2)
        by_noise = np.diag(wide).reshape(count, 2).sum(axis=1)
        excess = 0.5 * ((ratio**2).sum(axis=1) - by_noise)
        variance = np.clip(excess, LEAST_VARIANCE, self.ratio_std**2)
        narrow = np.linalg.inv(information + np.diag(np.repeat(1.0 / variance, 2)))
        ratio = narrow @ known
        change_mm = posterior.colour((ratio @ white)[None])[0]
        force_change_mm2 = linearisation.force_change(change_mm)
        press_change_mm2 = np.where(inside, -force_change_mm2[:, 2], 0.0)
        arm_mm = linearisation.shell.patch.place_mm - clusters.centre_mm[:, None]
        moment_mm3 = np.einsum("kn,knc->kc", press_change_mm2, arm_mm)
        return Friction(
            ratio=ratio.reshape(count, 2),
            change_mm=change_mm,
            force_change_mm2=force_change_mm2,
            centre_change_mm=moment_mm3 / clusters.normal_mm2[:, None],
            white=np.linalg.cholesky(wide).T @ white,
        )
