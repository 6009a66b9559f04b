"""Contacts on a pad as patches of pressure and shear, fitted to the marker images.

The marker images do not determine three free tractions at every node: shear alone could explain any image of
a normal force. So each contact is a patch of pressure with one of the profiles of `Profile`. Its parameters
are `SHAPE` numbers for centre and second moment, and five loads that are distributed in proportion to the
pressure: normal force, shear along x and y, torque, and the radial shear of an object that sticks to the pad
while the pad spreads. Broad normal priors describe what the markers cannot show. The parameters are fitted by
Gauss-Newton steps that are damped as by D. W. Marquardt 1963 (doi:10.1137/0111030).
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.pad.pad_model import MOTIONS, BondedPadModel
from manytouch.estimation.pad.patch_forces import (
    FORCE,
    LOAD_COUNT,
    PARAMETER_COUNT,
    RADIAL_SHEAR,
    add_answers,
    add_tractions,
)
from manytouch.estimation.pad.patch_kernels import (
    DENSE_POINTS,
    DENSEST_POINTS,
    DISTRIBUTION_COUNT,
    POINTS,
    SHAPE,
    Profile,
    add_layer_images,
    add_pressure,
    density,
    moment_trace,
    radial_arms,
)
from manytouch.estimation.pad.patch_prior import PatchPrior
from manytouch.estimation.pad.patch_slopes import PatchPad
from manytouch.estimation.pad.patch_steps import Common, Limits, Measured, Problem, Work, iterate
from manytouch.estimation.pad.patches import Patches
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Mask, Points2, Points3, Scalars, read_only, read_only_view

_FITTED = 2
"""Number of parameters of the pad that are fitted, from the first one: Poisson's ratio and thickness. An
error of the third, the depth of the markers, has nearly the same images as another shape of a contact. It
only adds to the covariance, as a consider parameter (S. F. Schmidt 1966)."""
_KEPT_STD = 1e-6  # prior standard deviation that keeps a parameter as it is
_MIN_ROOT = 0.05  # least root of a second moment, in thicknesses
_MOST_ROOT = 12.0**-0.5
"""Largest root along an axis, in sizes of the pad: that of a uniform pressure on all of it."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchImages:
    """Images of some shapes of a contact.

    Attributes:
        nodal: (s, DISTRIBUTION_COUNT, nx, ny) nodal forces of the pressure with unit force.
        column: (s, LOAD_COUNT, 2 m) marker images by unit loads.
    """

    nodal: Float64[np.ndarray, "s 3 nx ny"]
    column: Float64[np.ndarray, "s 5 r"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadFit:
    """Contacts that were fitted to a frame.

    Attributes:
        patches: of the contacts.
        motion: (MOTIONS,) of the image: shift along x and y, growth, rotation, tilt about x and y.
        misfit: sum of the squared residuals over their variances, and of the squared deviations from the
            priors over theirs.
        residual_px: (2 m,) measured minus fitted.
        weight: (2 m,) inverse variances of the measurement, 0 where not seen.
        sheet: (k,) Poisson's ratio, thickness and depth of the markers, in standard deviations from those
            of the sensor.
        covariance: (p, p) of the p = PARAMETER_COUNT c + MOTIONS + k parameters of contacts, motion and pad,
            by noise and priors; (0, 0) where it was not requested.
        by_sheet: (p, f) change of these parameters by the part of the deviation of each of the f fitted
            parameters of the pad that is not fitted (`PatchFitter.fitted_share`); (0, 0) likewise.
    """

    patches: Patches
    motion: Float64[np.ndarray, "6"]
    misfit: float
    residual_px: Float64[np.ndarray, " r"]
    weight: Float64[np.ndarray, " r"]
    sheet: Float64[np.ndarray, " k"]
    covariance: Float64[np.ndarray, "p p"]
    by_sheet: Float64[np.ndarray, "p f"]

    @property
    def force_mm2(self) -> Scalars:
        """(c,) normal forces over E, positive in compression."""
        return self.patches.parameters[:, FORCE]

    @property
    def force_std_mm2(self) -> Scalars:
        """(c,) their standard deviations by noise and priors."""
        at = PARAMETER_COUNT * np.arange(len(self.patches)) + FORCE
        return np.asarray(np.sqrt(np.diag(self.covariance)[at]))

    def marker_residuals(self) -> tuple[Points2, Scalars, Mask]:
        """(m, 2) residuals of the marker images, (m,) variances along an axis, (m,) which are used."""
        weight = self.weight[::2]
        variance_px2 = np.asarray(1.0 / np.maximum(weight, 1e-12))
        return self.residual_px.reshape(-1, 2), variance_px2, read_only(weight > 0.0)

    def marker_mm(self, model: BondedPadModel) -> Points3:
        """(m, 3) linear displacement of the markers."""
        return forced(self.nodal_mm2(model), model.marker)

    def nodal_mm2(self, model: BondedPadModel) -> Nodal:
        """(n, 3) nodal forces over E of all contacts."""
        return model.by_node(tractions(model, self.patches))


def misfit_scale(fit: PadFit) -> float:
    """Misfit per degree of freedom, at least 1."""
    freedom = int((fit.weight > 0.0).sum()) - PARAMETER_COUNT * len(fit.patches) - MOTIONS
    return max(1.0, float(fit.weight @ fit.residual_px**2) / max(freedom, 1))


def tractions(model: BondedPadModel, patches: Patches) -> Float64[np.ndarray, "nx ny 3"]:
    """Nodal forces over E of patches."""
    spread, nodal = np.zeros((2, DISTRIBUTION_COUNT, model.grid.count_x + 3, model.grid.count_y + 3))
    every = read_only_view(patches.parameters)
    for parameters, profile in zip(every, patches.profile.tolist(), strict=True):
        add_tractions(parameters, profile, model.grid, density(parameters, model.grid), spread, nodal)
    return np.moveaxis(nodal, 0, -1)


def nodal_of(model: BondedPadModel, fit: PadFit, press_mm2: Scalars) -> Nodal:
    """(n, 3) nodal forces over E of the contacts of a fit, with other normal forces (c,) over E."""
    parameters = fit.patches.parameters.copy()
    parameters[:, FORCE] = press_mm2
    # the radial shear is over the normal force
    parameters[:, RADIAL_SHEAR] *= np.divide(
        fit.force_mm2, press_mm2, where=press_mm2 != 0.0, out=np.ones(len(parameters))
    )
    return model.by_node(tractions(model, Patches(parameters=parameters, profile=fit.patches.profile)))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchFitter:
    """Fits patches to marker images.

    Attributes:
        prior: of a contact.
        shift_px, growth, turn_rad, tilt_rad: prior standard deviations of the motion of the image: of its
            shift along each axis, of its growth over its size, of its rotation, and of the turn of the camera
            about each of its axes x and y.
        moved_stds: a motion of the image by more standard deviations than this means that the camera has
            moved. Its standard deviation is then set to the motion itself, and it adds as much to the misfit
            as a motion of this many deviations.
        fitted_share: share of the standard deviations of Poisson's ratio and of the thickness with which they
            are fitted; errors of the model would be attributed to them otherwise. The rest of the deviations
            only adds to the covariance.
        max_steps: largest number of steps.
        least_gain, rough_gain: a fit ends when a step reduces the misfit by less than `least_gain`; one that
            is followed by another fit, by less than `rough_gain`.
    """

    prior: PatchPrior = field(default_factory=PatchPrior)
    shift_px: float = 0.03
    growth: float = 3e-4
    turn_rad: float = 3e-4
    tilt_rad: float = 6e-5
    moved_stds: float = 4.0
    fitted_share: float = 0.4
    max_steps: int = 20
    least_gain: float = 1e-3
    rough_gain: float = 0.5

    def __call__(
        self,
        model: BondedPadModel,
        patches: Patches,
        measured_px: Float64[np.ndarray, " r"],
        weight: Float64[np.ndarray, " r"],
        *,
        is_sheet_known: bool = False,
        with_covariance: bool = True,
        is_rough: bool = False,
        needed: float = np.inf,
    ) -> PadFit:
        """The patches that explain the images best, from guesses.

        Args:
            model: of the pad.
            patches: guesses; their profiles stay.
            measured_px: (2 m,) displacements of the marker images, without what is not linear in them.
            weight: (2 m,) inverse variances, 0 where not seen.
            is_sheet_known: keep the parameters of the pad.
            with_covariance: False leaves the covariances empty.
            is_rough: whether another fit follows.
            needed: misfit above which the result is not used; it is then that of an unfinished fit. Without
                covariances only.
        """
        count, parameters, rows = len(patches), len(model.by_parameter), len(measured_px)
        sheet = np.zeros((0, parameters, LOAD_COUNT, rows))
        if not is_sheet_known and count > 0:
            shapes = read_only_view(patches.parameters)[:, :SHAPE]
            numbers = patches.profile.tolist()
            sheet = np.stack([_by_sheet(model, *each) for each in zip(shapes, numbers, strict=True)])
        common = Common(motion=model.motion, sheet=sheet, std=self._common_std(parameters))
        theta = np.concatenate([patches.parameters.ravel(), np.zeros(MOTIONS + parameters)])
        work = Work(
            residual=np.empty(rows),
            tried=np.empty(rows),
            slope=np.empty((len(theta), rows)),
            curved=np.empty((len(theta), len(theta))),
            pull=np.empty(len(theta)),
        )
        problem = Problem(
            profile=patches.profile,
            pad=PatchPad(model.grid, model.table, model.markers, model.by_sides),
            prior=self.prior.numbers(model),
            common=common,
            measured=Measured(np.ascontiguousarray(measured_px), np.ascontiguousarray(weight)),
        )
        limits = self._limits(model, self.rough_gain if is_rough else self.least_gain, needed)
        misfit = iterate(theta, count, problem, limits, work, with_covariance)
        contacts, motion, fitted = _parts(theta, count)
        has_moved = np.abs(motion) > self.moved_stds * common.std[:MOTIONS]
        if has_moved.any() and misfit <= needed:
            common.std[:MOTIONS][has_moved] = np.abs(motion[has_moved])
            misfit = iterate(theta, count, problem, limits, work, with_covariance)
            misfit += (self.moved_stds**2 - 1.0) * int(has_moved.sum())
        covariance = by_sheet = np.zeros((0, 0))
        if with_covariance:
            covariance, by_sheet = self._covariances(work.curved, count)
        return PadFit(
            patches=Patches(parameters=contacts, profile=patches.profile),
            motion=motion,
            sheet=fitted,
            misfit=misfit,
            residual_px=work.residual,
            weight=weight,
            covariance=covariance,
            by_sheet=by_sheet,
        )

    def _covariances(
        self, curvature: Float64[np.ndarray, "p p"], count: int
    ) -> tuple[Float64[np.ndarray, "p p"], Float64[np.ndarray, "p f"]]:
        """`PadFit.covariance` and `PadFit.by_sheet` by the curvature of the misfit."""
        size = np.sqrt(np.diag(curvature))
        covariance = np.linalg.inv(curvature / np.outer(size, size)) / np.outer(size, size)
        common = count * PARAMETER_COUNT + MOTIONS
        by_sheet = np.zeros((len(curvature), _FITTED))
        by_sheet[:common] = -np.linalg.solve(
            curvature[:common, :common], curvature[:common, common : common + _FITTED]
        )
        by_sheet[common : common + _FITTED] = np.eye(_FITTED)
        by_sheet *= np.sqrt(1.0 - self.fitted_share**2)
        kept = np.arange(common + _FITTED, len(curvature))
        change = -covariance @ curvature[:, kept]
        change[kept] = np.eye(len(kept))
        covariance += change @ change.T
        return covariance, by_sheet

    def images(
        self, model: BondedPadModel, shapes: Float64[np.ndarray, "s 5"], profile: Profile = Profile.DOME
    ) -> PatchImages:
        """Images of a contact with each of the shapes (s, SHAPE)."""
        grid, count = model.grid, len(shapes)
        nodal = np.zeros((count, DISTRIBUTION_COUNT, grid.count_x + 3, grid.count_y + 3))
        scale_mm2, arms = np.empty(count), np.empty((count, 3))
        column = np.zeros((count, LOAD_COUNT, 2 * len(model.rest_px)))
        for number, shape in enumerate(read_only_view(shapes)):
            add_pressure(shape, grid, _points(model, shape, profile), nodal[number])
            add_layer_images(shape, int(profile), model.table, model.markers, column[number])
            scale_mm2[number], arms[number] = moment_trace(shape), radial_arms(shape)
        window = _window(np.asarray(nodal[:, 0].any(axis=0)))
        load = nodal[:, :, *window].reshape(count * DISTRIBUTION_COUNT, -1)
        rows = column.shape[-1]
        x, y, z = (model.by_sides[axis][window].reshape(-1, rows) for axis in range(3))
        by_x, by_y = ((load @ axis).reshape(count, DISTRIBUTION_COUNT, rows) for axis in (x, y))
        column += _unit_loads(by_x, by_y, load[::DISTRIBUTION_COUNT] @ z, arms)
        column[:, 3] /= scale_mm2[:, None]
        return PatchImages(nodal=nodal, column=column)

    def _common_std(self, parameters: int) -> Scalars:
        """Standard deviations of the motion of the image and of the parameters of the pad."""
        sheet = np.full(parameters, self.fitted_share)
        sheet[_FITTED:] = _KEPT_STD
        motion = (self.shift_px, self.shift_px, self.growth, self.turn_rad, self.tilt_rad, self.tilt_rad)
        return np.array([*motion, *sheet])

    def _limits(self, model: BondedPadModel, least_gain: float, needed: float) -> Limits:
        """How far contacts may go, and when an iteration ends."""
        wide_mm, high_mm = model.patch.size_mm
        return Limits(
            least_mm=_MIN_ROOT * model.thickness_mm,
            most_x_mm=_MOST_ROOT * wide_mm,
            most_y_mm=_MOST_ROOT * high_mm,
            half_x_mm=0.5 * wide_mm,
            half_y_mm=0.5 * high_mm,
            step_mm=0.7 * model.thickness_mm,
            max_steps=self.max_steps,
            least_gain=least_gain,
            needed=needed,
        )


def _parts(theta: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Views of parameters: (count, PARAMETER_COUNT) of contacts, (MOTIONS,) of the image, (k,) of the pad."""
    end = PARAMETER_COUNT * count
    return theta[:end].reshape(count, PARAMETER_COUNT), theta[end : end + MOTIONS], theta[end + MOTIONS :]


def forced(nodal_mm2: Nodal, answer: Float64[np.ndarray, "nodes 3 k 3"]) -> Points3:
    """(k, 3) displacements by nodal forces over E (n, 3) with the response to each."""
    moved_mm = np.zeros(answer.shape[2:])
    add_answers(nodal_mm2, answer, moved_mm)
    return moved_mm


def _window(is_used: np.ndarray) -> tuple[slice, slice]:
    """The rectangle of nodes (nx, ny) that are used."""
    used_x, used_y = np.flatnonzero(is_used.any(axis=1)), np.flatnonzero(is_used.any(axis=0))
    return slice(used_x[0], used_x[-1] + 1), slice(used_y[0], used_y[-1] + 1)


def _unit_loads(
    by_x: np.ndarray, by_y: np.ndarray, by_z: np.ndarray, arms: Float64[np.ndarray, "s 3"]
) -> Float64[np.ndarray, "s 5 r"]:
    """(s, LOAD_COUNT, r) images from those by the distributions of force along x and y, and by force along z.

    Args:
        by_x, by_y: (s, DISTRIBUTION_COUNT, r) by force along x and along y.
        by_z: (s, r) by force along z, distributed as the pressure.
        arms: (s, 3) `radial_arms` of each shape, 1/mm.
    """
    xx, yx, yy = arms.T[:, :, None]
    radial = xx * by_x[:, 1] + yx * (by_x[:, 2] + by_y[:, 1]) + yy * by_y[:, 2]
    return np.stack([-by_z, by_x[:, 0], by_y[:, 0], by_y[:, 1] - by_x[:, 2], radial], axis=1)


def _by_sheet(
    model: BondedPadModel, shape: Float64[np.ndarray, "5"], profile: int
) -> Float64[np.ndarray, "k 5 r"]:
    """(k, LOAD_COUNT, 2 m) changes of the images of a shape by the parameters of the pad."""
    nodal = np.zeros((DISTRIBUTION_COUNT, model.grid.count_x + 3, model.grid.count_y + 3))
    add_pressure(shape, model.grid, _points(model, shape, profile), nodal)
    window = _window(nodal[0].astype(np.bool_))
    load = nodal[:, *window].reshape(DISTRIBUTION_COUNT, -1)
    count, rows = len(model.by_parameter), model.by_parameter.shape[-1]
    x, y, z = (model.by_parameter[:, axis, *window].reshape(count, -1, rows) for axis in range(3))
    column = _unit_loads(load @ x, load @ y, load[0] @ z, np.tile(radial_arms(shape), (count, 1)))
    column[:, 3] /= moment_trace(shape)
    return column


def _points(model: BondedPadModel, shape: np.ndarray, profile: int) -> Float64[np.ndarray, "q 3"]:
    """The quadrature of the nodal forces of a shape."""
    return np.asarray((POINTS, DENSE_POINTS, DENSEST_POINTS)[density(shape, model.grid)][profile])
