"""Contacts on a pad as patches of pressure and shear, fitted to the marker images.

Three free tractions at every node do not determine a normal force: shear explains every squeeze. So each
contact is a dome of pressure with the parameters `SHAPE` of its centre and second moment, and five loads in
proportion to that pressure: normal force, shear along x and y, torque, and a radial shear, that of an object
that sticks to the pad while the pad spreads. Broad normal priors state what the markers cannot show.
Parameters are found by Gauss-Newton steps, damped as by D. W. Marquardt 1963 (doi:10.1137/0111030).
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.pad.pad_model import PadModel
from manytouch.estimation.pad.patch_kernels import DOME, SHAPE, SPREADS, add_dome, add_layer_images
from manytouch.estimation.pad.patch_prior import LOADS, OWN, PatchPrior
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Points3, Scalars

MOTIONS = 4
"""Motion of the whole image: shift x, y in px; growth and turn about the middle, as ratio and in rad."""
STEP_MM = 1e-3
_FITTED = 2
"""Parameters of the pad that are fitted: the first two. The depth of the markers looks like the shape of a
contact; it counts in the covariance only, as a consider parameter (S. F. Schmidt 1966)."""
_KEPT_STD = 1e-6  # of a parameter that is not fitted
_MIN_ROOT = 0.05  # least root of a second moment, in thicknesses


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchImages:
    """Images of some shapes of a contact.

    Attributes:
        nodal: (s, SPREADS, nx, ny) nodal forces of the pressure with unit force.
        column: (s, LOADS, 2 m) marker images by unit loads.
        scale: (s, 2) what the torque and the radial shear are divided by.
    """

    nodal: Float64[np.ndarray, "s 3 nx ny"]
    column: Float64[np.ndarray, "s 5 r"]
    scale: Float64[np.ndarray, "s 2"]

    def with_more(self, other: "PatchImages") -> "PatchImages":
        """These shapes, then the others."""
        return PatchImages(
            nodal=np.concatenate([self.nodal, other.nodal]),
            column=np.concatenate([self.column, other.column]),
            scale=np.concatenate([self.scale, other.scale]),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchFit:
    """Contacts that were fitted to a frame.

    Attributes:
        contact: (c, OWN) parameters.
        motion: (MOTIONS,) of the image.
        images: of each contact, for its shape and the `SHAPE` shapes that differ by `STEP_MM`.
        misfit: squared whitened residual with the priors.
        residual_px: (2 m,) measured minus fitted.
        weight: (2 m,) inverse variances of the measurement, 0 where not seen.
        sheet: (k,) Poisson's ratio, thickness and depth of the markers, in standard deviations from those
            of the sensor.
        covariance: (OWN c + MOTIONS + k, ...) of all parameters by noise and priors.
        by_sheet: (OWN c + MOTIONS + k, f) their change by the share of each parameter's deviation that is not
            fitted.
    """

    contact: Float64[np.ndarray, "c 10"]
    motion: Float64[np.ndarray, "4"]
    images: tuple[PatchImages, ...]
    misfit: float
    residual_px: Float64[np.ndarray, " r"]
    weight: Float64[np.ndarray, " r"]
    sheet: Float64[np.ndarray, " k"]
    covariance: Float64[np.ndarray, "p p"]
    by_sheet: Float64[np.ndarray, "p f"]

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
        prior: of a contact.
        shift_px, growth, turn_rad: standard deviations of the motion of the image.
        fitted_share: share of the standard deviations of Poisson's ratio and of the thickness that is fitted.
            The rest counts in the covariance only, since the error of the model is taken for theirs.
        max_steps: of the iteration.
    """

    prior: PatchPrior = field(default_factory=PatchPrior)
    shift_px: float = 0.03
    growth: float = 3e-4
    turn_rad: float = 3e-4
    fitted_share: float = 0.4
    max_steps: int = 20

    def __call__(
        self,
        model: PadModel,
        contact: Float64[np.ndarray, "c 10"],
        measured_px: Float64[np.ndarray, " r"],
        weight: Float64[np.ndarray, " r"],
        *,
        is_sheet_known: bool = False,
    ) -> PatchFit:
        """The patches that explain the images best, from guesses.

        Args:
            model: of the pad.
            contact: (c, OWN) guesses.
            measured_px: (2 m,) displacements of the marker images, without what is not linear in them.
            weight: (2 m,) inverse variances, 0 where not seen.
            is_sheet_known: keep the parameters of the pad.
        """
        still = np.zeros((len(model.by_parameter), LOADS, len(measured_px)))
        columns = _Columns(
            motion=self._motion_columns(model),
            sheet=tuple(still if is_sheet_known else _by_sheet(model, own[:SHAPE]) for own in contact),
        )
        count = len(contact)
        theta = np.concatenate([contact.ravel(), np.zeros(MOTIONS + len(model.by_parameter))])
        now = self._evaluate(model, theta, measured_px, weight, columns)
        damping = 1e-4
        for _ in range(self.max_steps):
            pull, curved, _ = self._slopes(model, theta, now, weight, columns)
            before = now.misfit
            for _ in range(4):
                damped = curved + damping * np.diag(np.diag(curved))
                moved = theta + np.linalg.solve(damped, pull)
                self._limit(model, _parts(theta, count)[0], _parts(moved, count)[0])
                tried = self._evaluate(model, moved, measured_px, weight, columns)
                if tried.misfit <= now.misfit:
                    theta, now, damping = moved, tried, 0.1 * damping
                    break
                damping = max(10.0 * damping, 1e-3)
            if before - now.misfit < 1e-4 * before + 0.02:
                break
        _, curved, images = self._slopes(model, theta, now, weight, columns)
        size = np.sqrt(np.diag(curved))
        covariance = np.linalg.inv(curved / np.outer(size, size)) / np.outer(size, size)
        common = count * OWN + MOTIONS
        by_sheet = np.zeros((len(theta), _FITTED))
        by_sheet[:common] = -np.linalg.solve(
            curved[:common, :common], curved[:common, common : common + _FITTED]
        )
        by_sheet[common : common + _FITTED] = np.eye(_FITTED)
        by_sheet *= np.sqrt(1.0 - self.fitted_share**2)
        kept = np.arange(common + _FITTED, len(theta))
        change = -covariance @ curved[:, kept]
        change[kept] = np.eye(len(kept))
        covariance += change @ change.T
        contacts, motion, sheet = _parts(theta, count)
        return PatchFit(
            contact=contacts,
            motion=motion,
            sheet=sheet,
            images=images,
            misfit=now.misfit,
            residual_px=now.residual_px,
            weight=weight,
            covariance=covariance,
            by_sheet=by_sheet,
        )

    def images(self, model: PadModel, shapes: Float64[np.ndarray, "s 5"]) -> PatchImages:
        """Images of a contact with each of the shapes (s, SHAPE)."""
        grid, count = model.grid, len(shapes)
        nodal = np.zeros((count, SPREADS, grid.count_x + 3, grid.count_y + 3))
        scale = np.empty((count, 2))
        column = np.zeros((count, LOADS, 2 * len(model.rest_px)))
        for number, shape in enumerate(shapes):
            add_dome(shape, grid, DOME, nodal[number])
            add_layer_images(shape, model.table, DOME, model.markers, column[number])
            scale[number] = _load_scale(shape)
        window = _window(np.asarray(nodal[:, 0].any(axis=0)))
        load = nodal[:, :, *window].reshape(count * SPREADS, -1)
        rows = column.shape[-1]
        x, y, z = (model.by_sides[axis][window].reshape(-1, rows) for axis in range(3))
        by_x, by_y = ((load @ axis).reshape(count, SPREADS, rows) for axis in (x, y))
        column += _unit_loads(by_x, by_y, load[::SPREADS] @ z)
        column[:, 3:] /= scale[:, :, None]
        return PatchImages(nodal=nodal, column=column, scale=scale)

    def _evaluate(
        self,
        model: PadModel,
        theta: np.ndarray,
        measured_px: np.ndarray,
        weight: np.ndarray,
        columns: "_Columns",
    ) -> "_Evaluation":
        """The misfit of parameters."""
        contact, motion, sheet = _parts(theta, len(columns.sheet))
        residual_px = measured_px - motion @ columns.motion
        misfit = float(np.sum(np.square(theta[contact.size :] / self._common_std(len(sheet)))))
        images = []
        for own, by_sheet in zip(contact, columns.sheet, strict=True):
            found = self.images(model, own[None, :SHAPE])
            images.append(found)
            residual_px -= _load(own) @ (found.column[0] + np.tensordot(sheet, by_sheet, axes=1))
            misfit += float(np.sum(self.prior(model, own)[0] ** 2))
        misfit += float(weight @ residual_px**2)
        return _Evaluation(misfit=misfit, residual_px=residual_px, images=tuple(images))

    def _slopes(
        self,
        model: PadModel,
        theta: np.ndarray,
        now: "_Evaluation",
        weight: np.ndarray,
        columns: "_Columns",
    ) -> tuple[np.ndarray, np.ndarray, tuple[PatchImages, ...]]:
        """Pull towards smaller misfits, its curvature, and the images with those of the moved shapes."""
        contact, _, sheet = _parts(theta, len(columns.sheet))
        slope = np.empty((len(theta), len(now.residual_px)))
        after = contact.size + MOTIONS
        slope[contact.size : after] = columns.motion
        slope[after:] = 0.0
        pull, curved = np.zeros(len(theta)), np.zeros((len(theta), len(theta)))
        images = []
        for number, (own, by_sheet) in enumerate(zip(contact, columns.sheet, strict=True)):
            one, load = now.images[number], _load(own)
            moved = self.images(model, own[:SHAPE] + STEP_MM * np.eye(SHAPE))
            images.append(one.with_more(moved))
            at = slice(OWN * number, OWN * (number + 1))
            part = slope[at]
            part[:SHAPE] = (load @ moved.column - load @ one.column[0]) / STEP_MM
            part[SHAPE:] = one.column[0] + np.tensordot(sheet, by_sheet, axes=1)
            part[SHAPE] += own[OWN - 1] * part[OWN - 1]
            part[OWN - 1] *= own[SHAPE]
            slope[after:] += load @ by_sheet
            value, jacobian = self.prior(model, own)
            pull[at] = -jacobian.T @ value
            curved[at, at] = jacobian.T @ jacobian
        common = np.arange(contact.size, len(theta))
        stiffness = 1.0 / self._common_std(len(sheet)) ** 2
        pull[common] = -stiffness * theta[common]
        curved[common, common] = stiffness
        weighted = slope * weight
        return weighted @ now.residual_px + pull, weighted @ slope.T + curved, tuple(images)

    def _common_std(self, parameters: int) -> Scalars:
        """Standard deviations of the motion of the image and of the parameters of the pad."""
        sheet = np.full(parameters, self.fitted_share)
        sheet[_FITTED:] = _KEPT_STD
        return np.array([self.shift_px, self.shift_px, self.growth, self.turn_rad, *sheet])

    def _limit(self, model: PadModel, old: np.ndarray, contact: np.ndarray) -> None:
        """Keep contacts (c, OWN) near the old ones, their moments above 0, their centres on the pad."""
        least_mm, most_mm = _MIN_ROOT * model.thickness_mm, 0.5 * min(model.patch.size_mm)
        half_mm = 0.5 * np.array(model.patch.size_mm)
        step_mm = 0.7 * model.thickness_mm
        contact[:, :2] = np.clip(contact[:, :2], old[:, :2] - step_mm, old[:, :2] + step_mm)
        contact[:, :2] = np.clip(contact[:, :2], -half_mm, half_mm)
        contact[:, [2, 4]] = np.clip(contact[:, [2, 4]], 0.5 * old[:, [2, 4]], 2.0 * old[:, [2, 4]])
        contact[:, [2, 4]] = np.clip(contact[:, [2, 4]], least_mm, most_mm)
        contact[:, 3] = np.clip(contact[:, 3], -most_mm, most_mm)
        contact[:, OWN - 1] = np.clip(contact[:, OWN - 1], -1.0, 1.0)

    def _motion_columns(self, model: PadModel) -> Float64[np.ndarray, "4 r"]:
        """Marker images by the motion of the image."""
        away_px = model.rest_px - model.rest_px.mean(axis=0)
        turned_px = np.column_stack([-away_px[:, 1], away_px[:, 0]])
        count = len(away_px)
        return np.stack(
            [np.tile([1.0, 0.0], count), np.tile([0.0, 1.0], count), away_px.ravel(), turned_px.ravel()]
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Columns:
    """Marker images by what all contacts have in common.

    Attributes:
        motion: (MOTIONS, 2 m) by the motion of the image.
        sheet: of each contact (k, LOADS, 2 m), by unit loads for one standard deviation of each parameter of
            the pad, for the shape that the contact begins with.
    """

    motion: Float64[np.ndarray, "4 r"]
    sheet: tuple[Float64[np.ndarray, "k 5 r"], ...]


def _parts(theta: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Views of the parameters: (count, OWN) of contacts, (MOTIONS,) of the image, (k,) of the pad."""
    own = OWN * count
    return theta[:own].reshape(count, OWN), theta[own : own + MOTIONS], theta[own + MOTIONS :]


def _window(is_used: np.ndarray) -> tuple[slice, slice]:
    """The rectangle of nodes (nx, ny) that are used."""
    used_x, used_y = np.flatnonzero(is_used.any(axis=1)), np.flatnonzero(is_used.any(axis=0))
    return slice(used_x[0], used_x[-1] + 1), slice(used_y[0], used_y[-1] + 1)


def _unit_loads(by_x: np.ndarray, by_y: np.ndarray, by_z: np.ndarray) -> Float64[np.ndarray, "s 5 r"]:
    """(s, LOADS, r) images from those by forces along x, y (s, SPREADS, r) and z (s, r) as in `SPREADS`."""
    return np.stack([-by_z, by_x[:, 0], by_y[:, 0], by_y[:, 1] - by_x[:, 2], by_x[:, 1] + by_y[:, 2]], axis=1)


def _by_sheet(model: PadModel, shape: Float64[np.ndarray, "5"]) -> Float64[np.ndarray, "k 5 r"]:
    """(k, LOADS, 2 m) changes of the images of a shape by the parameters of the pad."""
    nodal = np.zeros((SPREADS, model.grid.count_x + 3, model.grid.count_y + 3))
    add_dome(shape, model.grid, DOME, nodal)
    window = _window(nodal[0].astype(np.bool_))
    load = nodal[:, *window].reshape(SPREADS, -1)
    count, rows = len(model.by_parameter), model.by_parameter.shape[-1]
    x, y, z = (model.by_parameter[:, axis, *window].reshape(count, -1, rows) for axis in range(3))
    column = _unit_loads(load @ x, load @ y, load[0] @ z)
    column[:, 3:] /= _load_scale(shape)[:, None]
    return column


def _load_scale(shape: np.ndarray) -> Float64[np.ndarray, "2"]:
    """What the torque and the radial shear of a shape are divided by."""
    trace = shape[2] ** 2 + shape[3] ** 2 + shape[4] ** 2
    return np.array([trace, np.sqrt(0.5 * trace)])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Evaluation:
    """The misfit of parameters, with the images of the shapes."""

    misfit: float
    residual_px: np.ndarray
    images: tuple[PatchImages, ...]


def _load(own: np.ndarray) -> Scalars:
    """(LOADS,) of a contact; the radial shear as a force."""
    return np.array([*own[SHAPE : OWN - 1], own[SHAPE] * own[OWN - 1]])
