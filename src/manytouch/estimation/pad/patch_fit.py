"""Contacts on a pad as patches of pressure and shear, fitted to the marker images.

Three free tractions at every node do not determine a normal force: shear explains every squeeze. So each
contact is a dome of pressure with the parameters `SHAPE` of its centre and second moment, and five loads in
proportion to that pressure: normal force, shear along x and y, torque, and a radial shear, that of an object
that sticks to the pad while the pad spreads. Broad normal priors state what the markers cannot show.
Parameters are found by Gauss-Newton steps, damped as by D. W. Marquardt 1963 (doi:10.1137/0111030).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.pad.pad_model import PadModel
from manytouch.estimation.pad.patch_kernels import DOME, SHAPE, SPREADS, add_dome, add_layer_images
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Points3, Scalars

LOADS = 5
"""Loads of a contact: normal force, shear x, y and torque, over E; radial shear over the normal force."""
OWN = SHAPE + LOADS
"""Parameters of a contact: those of its shape, then its loads."""
MOTIONS = 4
"""Motion of the whole image: shift x, y in px; growth and turn about the middle, as ratio and in rad."""
_STEP_MM = 1e-3
_MIN_ROOT = 0.05  # least root of a second moment, in thicknesses


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchImages:
    """Images of one contact.

    Attributes:
        nodal: (1 + SHAPE, SPREADS, nx, ny) nodal forces of the pressure with unit force, and the same with
            each parameter of the shape moved by `_STEP_MM`.
        column: (1 + SHAPE, LOADS, 2 m) marker images by unit loads, for the same shapes.
        scale: (1 + SHAPE, 2) what the torque and the radial shear are divided by.
    """

    nodal: Float64[np.ndarray, "6 3 nx ny"]
    column: Float64[np.ndarray, "6 5 r"]
    scale: Float64[np.ndarray, "6 2"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchFit:
    """Contacts that were fitted to a frame.

    Attributes:
        contact: (c, OWN) parameters.
        motion: (MOTIONS,) of the image.
        images: of each contact.
        misfit: squared whitened residual with the priors.
        residual_px: (2 m,) measured minus fitted.
        weight: (2 m,) inverse variances of the measurement, 0 where not seen.
        covariance: (OWN c + MOTIONS, ...) of all parameters by noise and priors.
        sheet_covariance: the same by the parameters of the pad.
    """

    contact: Float64[np.ndarray, "c 10"]
    motion: Float64[np.ndarray, "4"]
    images: tuple[PatchImages, ...]
    misfit: float
    residual_px: Float64[np.ndarray, " r"]
    weight: Float64[np.ndarray, " r"]
    covariance: Float64[np.ndarray, "p p"]
    sheet_covariance: Float64[np.ndarray, "p p"]

    @property
    def force_mm2(self) -> Scalars:
        """(c,) normal forces over E, positive in compression."""
        return self.contact[:, SHAPE]

    @property
    def force_std_mm2(self) -> Scalars:
        """(c,) their standard deviations by noise and priors."""
        at = OWN * np.arange(len(self.contact)) + SHAPE
        return np.asarray(np.sqrt(np.diag(self.covariance)[at]))

    def marker_mm(self, model: PadModel) -> Points3:
        """(m, 3) linear displacement of the markers."""
        nodal_mm2 = self.nodal_mm2(model)
        node = np.flatnonzero(nodal_mm2.any(axis=1))
        rows = model.marker[node].reshape(3 * len(node), 3 * len(model.rest_px))
        return np.asarray((nodal_mm2[node].ravel() @ rows).reshape(-1, 3))

    def nodal_mm2(self, model: PadModel) -> Nodal:
        """(n, 3) nodal forces over E of all contacts."""
        total = np.zeros((model.grid.count_x + 3, model.grid.count_y + 3, 3))
        for contact, images in zip(self.contact, self.images, strict=True):
            total += tractions(images, contact, 0)
        return model.by_node(total)


def tractions(images: PatchImages, contact: np.ndarray, shape: int) -> Float64[np.ndarray, "nx ny 3"]:
    """Nodal forces over E of a contact, for one of the shapes of its images."""
    press, shear_x, shear_y, torque, radial = contact[SHAPE:]
    even, by_x, by_y = images.nodal[shape]
    turn, grow = torque / images.scale[shape, 0], press * radial / images.scale[shape, 1]
    return np.stack(
        [
            shear_x * even - turn * by_y + grow * by_x,
            shear_y * even + turn * by_x + grow * by_y,
            -press * even,
        ],
        axis=-1,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchFitter:
    """Fits patches to marker images.

    Attributes:
        usual_radius: radius of a rigid ball, in thicknesses, whose contact on a half-space with the same
            force (H. Hertz 1882) has the root of the second moment that the prior expects,
        root_limits: within these limits, in thicknesses,
        root_spread: and the standard deviation of its logarithm.
        stretch_spread: standard deviation of the difference of both principal moments over their sum.
        friction: standard deviation of shear over normal force,
        radial_mean, radial_friction: mean and standard deviation of radial shear over normal force; it is
            negative where an object sticks to a pad that spreads under it.
        shift_px, growth, turn_rad: standard deviations of the motion of the image.
        max_steps: of the iteration.
    """

    usual_radius: float = 1.0
    root_limits: tuple[float, float] = (0.08, 0.35)
    root_spread: float = 0.6
    stretch_spread: float = 0.5
    friction: float = 1.0
    radial_mean: float = -0.06
    radial_friction: float = 0.12
    shift_px: float = 0.03
    growth: float = 3e-4
    turn_rad: float = 3e-4
    max_steps: int = 8

    def __call__(
        self,
        model: PadModel,
        contact: Float64[np.ndarray, "c 10"],
        measured_px: Float64[np.ndarray, " r"],
        weight: Float64[np.ndarray, " r"],
    ) -> PatchFit:
        """The patches that explain the images best, from guesses.

        Args:
            model: of the pad.
            contact: (c, OWN) guesses.
            measured_px: (2 m,) displacements of the marker images, without what is not linear in them.
            weight: (2 m,) inverse variances, 0 where not seen.
        """
        motion_column = self._motion_columns(model)
        theta = np.concatenate([contact.ravel(), np.zeros(MOTIONS)])
        now = self._evaluate(model, theta, measured_px, weight, motion_column)
        damping = 1e-4
        for _ in range(self.max_steps):
            pull, curved = now.gradient(weight)
            before = now.misfit
            for _ in range(4):
                damped = curved + damping * np.diag(np.diag(curved))
                moved = self._limited(model, theta, theta + np.linalg.solve(damped, pull))
                tried = self._evaluate(model, moved, measured_px, weight, motion_column)
                if tried.misfit <= now.misfit:
                    theta, now, damping = moved, tried, 0.1 * damping
                    break
                damping = max(10.0 * damping, 1e-3)
            if before - now.misfit < 1e-3 * before + 0.02:
                break
        _, curved = now.gradient(weight)
        size = np.sqrt(np.diag(curved))
        covariance = np.linalg.inv(curved / np.outer(size, size)) / np.outer(size, size)
        found = theta[:-MOTIONS].reshape(-1, OWN)
        return PatchFit(
            contact=found,
            motion=theta[-MOTIONS:],
            images=now.images,
            misfit=now.misfit,
            residual_px=now.residual_px,
            weight=weight,
            covariance=covariance,
            sheet_covariance=self._sheet_covariance(model, found, now, weight, covariance),
        )

    def images(self, model: PadModel, shape: Float64[np.ndarray, "5"]) -> PatchImages:
        """Images of a contact with a shape."""
        grid = model.grid
        nodal = np.zeros((1 + SHAPE, SPREADS, grid.count_x + 3, grid.count_y + 3))
        scale = np.empty((1 + SHAPE, 2))
        column = np.zeros((1 + SHAPE, LOADS, 2 * len(model.rest_px)))
        for number in range(1 + SHAPE):
            moved = shape.copy()
            if number > 0:
                moved[number - 1] += _STEP_MM
            add_dome(moved, grid, DOME, nodal[number])
            add_layer_images(moved, model.table, DOME, model.markers, column[number])
            trace = moved[2] ** 2 + moved[3] ** 2 + moved[4] ** 2
            scale[number] = trace, np.sqrt(0.5 * trace)
        used_x, used_y = (
            np.flatnonzero(nodal[:, 0].any(axis=(0, 2))),
            np.flatnonzero(nodal[:, 0].any(axis=(0, 1))),
        )
        window = (slice(used_x[0], used_x[-1] + 1), slice(used_y[0], used_y[-1] + 1))
        load = nodal[:, :, *window].reshape((1 + SHAPE) * SPREADS, -1)
        rows = column.shape[-1]
        x, y, z = (model.by_sides[axis][window].reshape(-1, rows) for axis in range(3))
        by_x, by_y = ((load @ axis).reshape(1 + SHAPE, SPREADS, rows) for axis in (x, y))
        column[:, 0] -= load.reshape(1 + SHAPE, SPREADS, -1)[:, 0] @ z
        column[:, 1] += by_x[:, 0]
        column[:, 2] += by_y[:, 0]
        column[:, 3] += by_y[:, 1] - by_x[:, 2]
        column[:, 4] += by_x[:, 1] + by_y[:, 2]
        column[:, 3:] /= scale[:, :, None]
        return PatchImages(nodal=nodal, column=column, scale=scale)

    def _evaluate(
        self,
        model: PadModel,
        theta: np.ndarray,
        measured_px: np.ndarray,
        weight: np.ndarray,
        motion_column: np.ndarray,
    ) -> "_Evaluation":
        contact = theta[:-MOTIONS].reshape(-1, OWN)
        slope = np.empty((len(theta), len(measured_px)))
        slope[-MOTIONS:] = motion_column
        residual_px = measured_px - theta[-MOTIONS:] @ motion_column
        images, prior = [], []
        for number, own in enumerate(contact):
            found = self.images(model, own[:SHAPE])
            images.append(found)
            press, radial = own[SHAPE], own[OWN - 1]
            load = np.array([*own[SHAPE : OWN - 1], press * radial])
            fitted = load @ found.column
            part = slope[OWN * number : OWN * (number + 1)]
            part[:SHAPE] = (fitted[1:] - fitted[0]) / _STEP_MM
            part[SHAPE:] = found.column[0]
            part[SHAPE] += radial * found.column[0, LOADS - 1]
            part[OWN - 1] *= press
            residual_px -= fitted[0]
            prior.append(self._prior(model, own))
        own_pull = np.zeros(len(theta))
        own_curved = np.zeros((len(theta), len(theta)))
        misfit = float(weight @ residual_px**2)
        for number, (value, jacobian) in enumerate(prior):
            own_slice = slice(OWN * number, OWN * (number + 1))
            own_pull[own_slice] = -jacobian.T @ value
            own_curved[own_slice, own_slice] = jacobian.T @ jacobian
            misfit += float(value @ value)
        motion = 1.0 / np.square([self.shift_px, self.shift_px, self.growth, self.turn_rad])
        own_pull[-MOTIONS:] = -motion * theta[-MOTIONS:]
        own_curved[range(-MOTIONS, 0), range(-MOTIONS, 0)] = motion
        misfit += float(motion @ theta[-MOTIONS:] ** 2)
        return _Evaluation(
            misfit=misfit,
            residual_px=residual_px,
            slope=slope,
            images=tuple(images),
            prior_pull=own_pull,
            prior_curved=own_curved,
        )

    def _prior(self, model: PadModel, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whitened deviations of a contact from the prior, and their derivatives (7, OWN)."""
        xx, yx, yy = own[2:SHAPE]
        press = max(abs(own[SHAPE]), 1e-9)
        radius_mm = self.usual_radius * model.thickness_mm
        hertz_mm = (0.75 * press * (1.0 - model.poisson**2) * radius_mm) ** (1.0 / 3.0)
        least_mm, most_mm = (limit * model.thickness_mm for limit in self.root_limits)
        usual_mm = min(max(hertz_mm / np.sqrt(5.0), least_mm), most_mm)

        def shape_terms(root: np.ndarray) -> np.ndarray:
            trace = float(root @ root)
            return np.array(
                [
                    np.log(np.sqrt(abs(root[0] * root[2])) / usual_mm) / self.root_spread,
                    (root[0] ** 2 - root[1] ** 2 - root[2] ** 2) / trace / self.stretch_spread,
                    2.0 * root[0] * root[1] / trace / self.stretch_spread,
                ]
            )

        root = np.array([xx, yx, yy])
        value, jacobian = np.zeros(7), np.zeros((7, OWN))
        value[:3] = shape_terms(root)
        for number in range(3):
            moved = root.copy()
            moved[number] += 1e-5
            jacobian[:3, 2 + number] = (shape_terms(moved) - value[:3]) / 1e-5
        arm = np.sqrt(xx**2 + yx**2 + yy**2)
        std = np.array([self.friction * press, self.friction * press, self.friction * press * arm])
        value[3:6] = own[SHAPE + 1 : SHAPE + 4] / std
        jacobian[range(3, 6), range(SHAPE + 1, SHAPE + 4)] = 1.0 / std
        value[6] = (own[OWN - 1] - self.radial_mean) / self.radial_friction
        jacobian[6, OWN - 1] = 1.0 / self.radial_friction
        return value, jacobian

    def _limited(self, model: PadModel, before: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Parameters with moments that are not 0, and centres on the pad, near those before."""
        contact = theta[:-MOTIONS].reshape(-1, OWN)
        old = before[:-MOTIONS].reshape(-1, OWN)
        least_mm, most_mm = _MIN_ROOT * model.thickness_mm, 0.5 * min(model.patch.size_mm)
        half_mm = 0.5 * np.array(model.patch.size_mm)
        step_mm = 0.7 * model.thickness_mm
        contact[:, :2] = np.clip(contact[:, :2], old[:, :2] - step_mm, old[:, :2] + step_mm)
        contact[:, :2] = np.clip(contact[:, :2], -half_mm, half_mm)
        contact[:, [2, 4]] = np.clip(contact[:, [2, 4]], 0.5 * old[:, [2, 4]], 2.0 * old[:, [2, 4]])
        contact[:, [2, 4]] = np.clip(contact[:, [2, 4]], least_mm, most_mm)
        contact[:, 3] = np.clip(contact[:, 3], -most_mm, most_mm)
        contact[:, OWN - 1] = np.clip(contact[:, OWN - 1], -1.0, 1.0)
        return theta

    def _motion_columns(self, model: PadModel) -> Float64[np.ndarray, "4 r"]:
        """Marker images by the motion of the image."""
        away_px = model.rest_px - model.rest_px.mean(axis=0)
        turned_px = np.column_stack([-away_px[:, 1], away_px[:, 0]])
        count = len(away_px)
        return np.stack(
            [np.tile([1.0, 0.0], count), np.tile([0.0, 1.0], count), away_px.ravel(), turned_px.ravel()]
        )

    def _sheet_covariance(
        self,
        model: PadModel,
        contact: np.ndarray,
        found: "_Evaluation",
        weight: np.ndarray,
        covariance: np.ndarray,
    ) -> Float64[np.ndarray, "p p"]:
        """Covariance of the parameters by those of the pad that are not exactly known."""
        total = np.zeros_like(covariance)
        if len(contact) == 0:
            return total
        nodal = np.sum(
            [tractions(images, own, 0) for own, images in zip(contact, found.images, strict=True)], axis=0
        )
        used_x, used_y = np.flatnonzero(nodal.any(axis=(1, 2))), np.flatnonzero(nodal.any(axis=(0, 2)))
        window = (slice(used_x[0], used_x[-1] + 1), slice(used_y[0], used_y[-1] + 1))
        load = np.ascontiguousarray(nodal[window].transpose(2, 0, 1)).ravel()
        for by_parameter in model.by_parameter:
            changed_px = load @ by_parameter[:, *window].reshape(len(load), -1)
            moved = covariance @ (found.slope @ (weight * changed_px))
            total += np.outer(moved, moved)
        return total


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Evaluation:
    """The misfit of parameters and its derivatives."""

    misfit: float
    residual_px: np.ndarray
    slope: np.ndarray
    images: tuple[PatchImages, ...]
    prior_pull: np.ndarray
    prior_curved: np.ndarray

    def gradient(self, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pull towards smaller misfits, and its curvature."""
        weighted = self.slope * weight
        return weighted @ self.residual_px + self.prior_pull, weighted @ self.slope.T + self.prior_curved
