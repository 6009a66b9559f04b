"""What the parameters of the sheet that are not exactly known do to the forces, and the estimate of one.

With a parameter p changed, the same marker images mean another shape and other forces. The shape changes by
c_p = -H^-1 (J^T W r_p + R^T D T f_p), with f_p and r_p the changes of forces and marker images of the same
shape (the derivative of the minimum of the objective of `gauss_newton`), and the forces by f_p + K c_p.
There J, K and R are the derivatives of marker images, forces and balance by the coefficients, T turns forces
into balance (tangential and normal forces), W and D are the weights of images and balance, and H = J^T W J +
R^T D R.
An unknown pretension is estimated: with a wrong one, forces are needed where nothing presses, and residuals
remain. One frame gives the Gauss-Newton step of this misfit along p. Nodes under contacts are left out, whose
forces the sparse prior would reduce.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.linalg import block_diag

from manytouch.estimation.mechanics.inversion.body_force_estimator import nodal_forces_mm2
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.inversion.iterate import balance
from manytouch.estimation.mechanics.inversion.sheet_model import PRETENSION_STEP_MM, InversionModel
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell.shell import Shell
from manytouch.values import Camera, Sheet
from manytouch.values.arrays import Mask, Points2, Scalars
from manytouch.values.sensor_file.default_std import ASSUMED_POISSON_STD, camera_std, sheet_std

_STEP = 0.02  # of a finite difference, over the thickness or over the bending factor
_POISSON_STEP = -0.01
_MAX_POISSON = 0.495
CLAMP_STD_THICKNESSES = 0.075
"""Standard deviation of the place of a clamp that stands for what is wrong with the shell next to it.

A deep press next to a clamp bends the sheet there more than its shell. In the varied cases with true sensor
files, contacts that it explains (see `ContactRules.outline_stds`) are false ones, up to a deviation of 0.09.
Fitted on sheets of 1.5 to 6 mm and presses to 12 mm deep; 40 other presses of this range confirm it (ADR 99).
"""
_MOST_GROWTH = 5.0  # a response to less than a fifth of the force of a cluster contains little about it
_STALE = 1.5  # ratio of total forces from which on a response is computed again

Changes = Float64[np.ndarray, "p nodes 3"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetVariant:
    """The sheet, or the camera in front of it, with one other parameter.

    Attributes:
        shell: with the parameter moved by a step; None if the parameter is one of the camera.
        std_over_step: standard deviation of the parameter over the step.
        outline_std_over_step: of the place of the clamp, the same with the error of the shell next to it; 0
            for other parameters.
        marker_images: of this sheet; None if those of a shape do not depend on the parameter, or hardly.
    """

    shell: Shell | None
    std_over_step: float
    outline_std_over_step: float = 0.0
    marker_images: MarkerImages | None = None

    def with_pretension(self, over_E_mm: float) -> "SheetVariant":
        """The variant with another pretension over E."""
        shell, images = self.shell, self.marker_images
        if shell is not None:
            shell = replace(shell, pretension_over_E_mm=over_E_mm)
        if images is not None:
            images = images.changed(shell=replace(images.shell, pretension_over_E_mm=over_E_mm))
        return replace(self, shell=shell, marker_images=images)


def sheet_variants(model: InversionModel, sheet: Sheet) -> tuple[SheetVariant, ...]:
    """One variant for each parameter of a known sheet and of its camera that has a standard deviation."""
    std, shell = sheet_std(sheet), model.shell
    found = []
    if std.thickness_mm > 0.0:
        step_mm = _STEP * shell.thickness_mm
        thicker = replace(shell, thickness_mm=shell.thickness_mm + step_mm)
        found.append(
            SheetVariant(
                shell=thicker,
                std_over_step=std.thickness_mm / step_mm,
                marker_images=model.dots.changed(shell=thicker),
            )
        )
    poisson_std = ASSUMED_POISSON_STD if std.poisson is None else std.poisson
    if poisson_std > 0.0:
        other = shell.poisson + (_POISSON_STEP if shell.poisson > -_POISSON_STEP else -_POISSON_STEP)
        found.append(
            SheetVariant(
                shell=replace(shell, poisson=min(other, _MAX_POISSON)),
                std_over_step=poisson_std / abs(_POISSON_STEP),
            )
        )
    if shell.patch.boundary == "clamped" and not sheet.is_assumed:
        larger, outline = _larger(shell, _STEP * shell.thickness_mm), std.outline_mm / shell.thickness_mm
        found.append(
            SheetVariant(
                shell=larger,
                std_over_step=outline / _STEP,
                outline_std_over_step=float(np.hypot(outline, CLAMP_STD_THICKNESSES)) / _STEP,
                marker_images=model.dots.changed(shell=larger),
            )
        )
    if std.bending_factor:
        factor = shell.bending_factor
        found.append(
            SheetVariant(
                shell=replace(shell, bending_factor=factor * (1.0 + _STEP)),
                std_over_step=std.bending_factor / (factor * _STEP),
            )
        )
    return (*found, *_camera_variants(model))


def _camera_variants(model: InversionModel) -> list[SheetVariant]:
    """Variants for the inclination of the camera about x and y, and for the scale of the picture.

    Other errors of a pose move all markers alike, also those at rest. Focal length and distance are taken as
    independent.
    """
    camera = model.camera
    std = camera_std(camera)
    turns = [std.rotation_vector * axis for axis in np.eye(3)[:2]]
    changed = [_turned(camera, turn) for turn in turns if turn.any()]
    scale = float(np.hypot(std.fx_px / camera.fx_px, std.translation_mm[2] / abs(camera.translation_mm[2])))
    if scale > 0.0:
        changed.append(_magnified(camera, 1.0 + scale))
    return [
        SheetVariant(shell=None, std_over_step=1.0, marker_images=model.dots.changed(camera=each))
        for each in changed
    ]


def _turned(camera: Camera, turn: Float64[np.ndarray, "3"]) -> Camera:
    """The camera with another rotation vector, and all its views."""
    views = tuple(replace(view, camera=_turned(view.camera, turn)) for view in camera.views)
    return replace(camera, rotation_vector=camera.rotation_vector + turn, views=views)


def _magnified(camera: Camera, factor: float) -> Camera:
    """The camera with longer focal lengths, and all its views."""
    views = tuple(replace(view, camera=_magnified(view.camera, factor)) for view in camera.views)
    return replace(camera, fx_px=camera.fx_px * factor, fy_px=camera.fy_px * factor, views=views)


def _larger(shell: Shell, step_mm: float) -> Shell:
    """The shell with each side of its outline farther outwards."""
    size_x_mm, size_y_mm = shell.patch.size_mm
    size_mm = (size_x_mm + 2.0 * step_mm, size_y_mm + 2.0 * step_mm)
    return replace(shell, patch=replace(shell.patch, size_mm=size_mm))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PretensionEstimate:
    """The pretension over E, known, or estimated from what presses the sheet.

    Attributes:
        mean_mm: membrane force per length over E (N/mm over MPa, which is mm).
        std_mm: its standard deviation.
        is_estimated: whether it is estimated.
        information: of the mean, per mm^2: of the prior and of all frames, at most that of `most_frames` as
            good as the best one.
        best: information of the frame that determined it best, per mm^2.
        scatter_mm2: mean square of the recent corrections of its frames.
    """

    mean_mm: float
    std_mm: float
    is_estimated: bool
    information: float = 0.0
    best: float = 0.0
    scatter_mm2: float = 0.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PretensionEstimator:
    """Parameters of the estimate of an unknown pretension.

    Attributes:
        prior_strain, prior_strain_std: mean and standard deviation of the strain of a mounted sheet, if
            nothing is known.
        most_std: standard deviation of one frame by noise, over that of the prior, up to which the frame
            counts. Where an object presses so lightly that its forces are below those that the sparse prior
            distinguishes from none, the pretension of the frame is too low. Chosen on varied presses of the
            suite (ADR 148).
        most_frames: number of frames, each as good as the best one, that the mean contains: of a long
            recording those of the last presses count.
        memory: share of the scatter of the corrections that is kept from frame to frame.
        model_share, model_strain: standard deviation by the model, over the pretension and as a strain.
        new_model_stds, new_model_share: the model of the sheet is replaced when the mean has changed by this
            many standard deviations and by this share.
    """

    prior_strain: float = 0.01
    prior_strain_std: float = 0.015
    most_std: float = 0.33
    most_frames: float = 10.0
    memory: float = 0.8
    model_share: float = 0.3
    model_strain: float = 0.003
    new_model_stds: float = 0.3
    new_model_share: float = 0.02

    def start(self, model: InversionModel, sheet: Sheet) -> PretensionEstimate:
        """What is known before the first frame."""
        if sheet.states_pretension:
            std, young = sheet_std(sheet).pretension_N_per_mm or 0.0, sheet.young_MPa
            over_E_mm = 0.0 if young is None else std / young
            return PretensionEstimate(
                mean_mm=model.shell.pretension_over_E_mm, std_mm=over_E_mm, is_estimated=False
            )
        per_strain_mm = self._per_strain_mm(model)
        std_mm = self.prior_strain_std * per_strain_mm
        return PretensionEstimate(
            mean_mm=self.prior_strain * per_strain_mm,
            std_mm=std_mm,
            is_estimated=True,
            information=1.0 / std_mm**2,
        )

    def update(
        self, before: PretensionEstimate, model: InversionModel, gradient: float, information: float
    ) -> PretensionEstimate:
        """The pretension with the evidence of one more frame.

        Args:
            before: without it.
            model: of the frame.
            gradient: derivative of half the misfit by the pretension over E, 1/mm.
            information: its second derivative, 1/mm^2.
        """
        per_strain_mm = self._per_strain_mm(model)
        if information * (self.most_std * self.prior_strain_std * per_strain_mm) ** 2 < 1.0:
            return before
        off_mm = model.shell.pretension_over_E_mm - gradient / information - before.mean_mm
        largest_mm = 2.0 * self.prior_strain * per_strain_mm
        off_mm = float(np.clip(off_mm, -largest_mm, largest_mm))
        weight = information / (information + before.information)
        mean_mm = max(before.mean_mm + weight * off_mm, 0.0)
        scatter_mm2 = before.scatter_mm2 + (1.0 - self.memory) * weight * (off_mm**2 - before.scatter_mm2)
        best = max(before.best, information)
        model_mm = np.hypot(self.model_share * mean_mm, self.model_strain * per_strain_mm)
        return PretensionEstimate(
            mean_mm=mean_mm,
            std_mm=float(np.sqrt(1.0 / best + scatter_mm2 + model_mm**2)),
            is_estimated=True,
            information=min(before.information + information, self.most_frames * best),
            best=best,
            scatter_mm2=scatter_mm2,
        )

    def is_new_model_due(self, model: InversionModel, now: PretensionEstimate) -> bool:
        """Whether the estimate clearly differs from the pretension of the model."""
        off_mm = abs(now.mean_mm - model.shell.pretension_over_E_mm)
        return off_mm > self.new_model_stds * now.std_mm and off_mm > self.new_model_share * now.mean_mm

    def _per_strain_mm(self, model: InversionModel) -> float:
        """Membrane force per length over E for an equal strain in all directions."""
        return model.thickness_mm / (1.0 - model.shell.poisson)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ParameterResponse:
    """What the unknown parameters do to the estimate of one frame.

    Attributes:
        change_mm: (p, nodes, 3) change of the coefficients of the shape for one standard deviation of each
            parameter; of the outline, if all its sides are off by that; of the acceleration, for independent
            errors.
        force_change_mm2: (p, nodes, 3) the same of the forces over E.
        by_outline_mm2: (nodes,) the same for one standard deviation of the outline, with that of the shell's
            error next to a clamp; 0 where there is no clamp.
        by_acceleration_mm2: (a, nodes) derivatives of the normal forces over E by the acceleration of a body
            force, per g, along each axis; a is 0 if none is estimated.
        normal_mm2: (nodes,) normal forces over E, positive in compression, of the frame.
        total_mm2: their sum, without tension.
        balance_slope: (nodes, 3) derivative of tangential and normal forces over E by the pretension over E,
            mm, at shapes that fit the markers.
        image_slope_px: (m, 2) the same of the marker images, px/mm.
    """

    change_mm: Changes
    force_change_mm2: Changes
    by_outline_mm2: Float64[np.ndarray, " nodes"]
    by_acceleration_mm2: Float64[np.ndarray, "a nodes"]
    normal_mm2: Float64[np.ndarray, " nodes"]
    total_mm2: float
    balance_slope: Nodal
    image_slope_px: Points2

    @property
    def has_body_force(self) -> bool:
        """Whether a body force is one of the parameters."""
        return len(self.by_acceleration_mm2) > 0

    def is_stale(self, model: InversionModel, fit: Fit) -> bool:
        """Whether the total force of a frame clearly differs from that of the response."""
        total_mm2, before_mm2 = total_force_mm2(model, fit), self.total_mm2
        return not before_mm2 / _STALE <= total_mm2 <= before_mm2 * _STALE

    def may_wait(self, model: InversionModel, fit: Fit) -> bool:
        """Whether the response of this frame may be computed in the next one.

        It may after a full step, so that one frame does not take the time of both; but not if this response
        is that of a sheet at rest, which contains nothing about contacts, and something presses now.
        """
        is_at_rest = self.total_mm2 <= model.nodes.least_force_mm2
        return bool(fit.steps) and not (is_at_rest and self.is_stale(model, fit))

    def force_ratio(self, fit: Fit, label: Int64[np.ndarray, " nodes"], count: int) -> Scalars:
        """(c,) normal forces of clusters over those when this response was computed, at most `_MOST_GROWTH`.

        What a parameter of the sheet changes is about in proportion to the force.

        Args:
            fit: of this frame.
            label: (nodes,) cluster of each node, or -1.
            count: number of clusters.
        """
        inside = np.flatnonzero(label >= 0)
        before_mm2, now_mm2 = (
            np.maximum(np.bincount(label[inside], press_mm2[inside], minlength=count), 0.0)
            for press_mm2 in (self.normal_mm2, -fit.shape.force_mm2[:, 2])
        )
        before_mm2 = np.maximum(before_mm2, now_mm2 / _MOST_GROWTH)
        return np.divide(now_mm2, before_mm2, out=np.ones(count), where=before_mm2 > 0.0)

    def misfit_slope(self, model: InversionModel, fit: Fit, is_pressed: Mask) -> tuple[float, float]:
        """Gradient (1/mm) and information (1/mm^2): derivatives of half the misfit by the pretension over E.

        Args:
            model: of the sheet.
            fit: of this frame.
            is_pressed: (nodes,) nodes whose normal forces are those of contacts; their forces do not count.
        """
        weight = fit.posterior.weight.copy()
        weight[is_pressed] = 0.0
        now = balance(model, fit.shape.slope, fit.shape.force_mm2)
        information = fit.posterior.information
        pull = np.einsum("mij,mj->mi", information, self.image_slope_px)
        is_used = information[:, 0, 0] > 0.0
        residual_px = np.where(is_used[:, None], fit.residual_px, 0.0)
        gradient = float((weight * self.balance_slope * now).sum() + (pull * residual_px).sum())
        curvature = float((weight * self.balance_slope**2).sum() + (pull * self.image_slope_px).sum())
        return gradient, curvature


def total_force_mm2(model: InversionModel, fit: Fit) -> float:
    """Sum of the normal forces over E that press, at least the least force of a contact."""
    return max(float(np.maximum(-fit.shape.force_mm2[:, 2], 0.0).sum()), model.nodes.least_force_mm2)


def parameter_response(
    model: InversionModel, variants: tuple[SheetVariant, ...], pretension: PretensionEstimate, fit: Fit
) -> ParameterResponse:
    """The response of a fitted frame to the pretension, to each variant, and to a body force."""
    posterior, shape = fit.posterior, fit.shape
    linearisation, weight = posterior.linearisation, posterior.weight
    coefficient_mm, count = shape.coefficient_mm, len(posterior.information)
    more_mm2 = model.stretched.shell.forces(coefficient_mm) - shape.internal_mm2
    moved_px = model.stretched.displacement_px(coefficient_mm) - shape.displacement_px
    force_changes, image_changes = [more_mm2 / PRETENSION_STEP_MM], [moved_px / PRETENSION_STEP_MM]
    stds, outline_stds = [pretension.std_mm], [0.0]
    for variant in variants:
        changed_mm2 = np.zeros_like(shape.force_mm2)
        if variant.shell is not None:
            changed_mm2 = variant.shell.forces(coefficient_mm) - shape.internal_mm2
        force_changes.append(changed_mm2)
        moved = np.zeros((count, 2))
        if variant.marker_images is not None:
            moved = variant.marker_images.displacement_px(coefficient_mm) - shape.displacement_px
        image_changes.append(moved)
        stds.append(variant.std_over_step)
        outline_stds.append(variant.outline_std_over_step)
    std = np.diag(stds)
    if shape.body_force is not None:
        force_changes += list(-nodal_forces_mm2(model))
        image_changes += 3 * [np.zeros((count, 2))]
        std = block_diag(std, shape.body_force.deviations_g)
    balances = [balance(model, shape.slope, each) for each in force_changes]
    gradients = linearisation.gradients(
        np.stack(image_changes), posterior.information, weight * np.stack(balances)
    )
    solved = posterior.solve(gradients)
    by_step = np.stack(force_changes) - linearisation.force_changes(solved)
    node = model.dots.tips.basis.node
    return ParameterResponse(
        change_mm=-np.tensordot(std, solved, 1),
        force_change_mm2=np.tensordot(std, by_step, 1),
        by_acceleration_mm2=by_step[len(stds) :, :, 2].copy(),
        by_outline_mm2=np.array(outline_stds) @ by_step[: len(stds), :, 2],
        normal_mm2=-shape.force_mm2[:, 2],
        total_mm2=total_force_mm2(model, fit),
        balance_slope=balances[0] - linearisation.balance_change(solved[0]),
        image_slope_px=image_changes[0]
        - np.einsum("mjka,mka->mj", linearisation.derivative, solved[0][node]),
    )
