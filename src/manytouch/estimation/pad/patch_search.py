"""What may explain the markers better: a small patch where a pad may be pressed, another profile or width, or
near contacts as one."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.pad.pad_model import BondedPadModel
from manytouch.estimation.pad.patch_fit import PadFit, PatchFitter, misfit_scale
from manytouch.estimation.pad.patch_forces import PARAMETER_COUNT
from manytouch.estimation.pad.patch_kernels import ROOT_XX, ROOT_YY, SHAPE, Profile
from manytouch.estimation.pad.patches import Patches, joined, near_groups, widened
from manytouch.values.arrays import Mask, Points2, Scalars, read_only

_COLUMNS = 3  # normal force, shear x, shear y


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchCandidates:
    """Small patches on a lattice.

    Attributes:
        centre_mm: (k, 2) of each.
        column: (3 k, 2 m) marker images by unit loads: normal force, shear x, shear y.
        inverse: (k, 3, 3) inverse matrices of their products.
        root_mm: root of their second moment.
    """

    centre_mm: Points2
    column: Float64[np.ndarray, "c r"]
    inverse: Float64[np.ndarray, "k 3 3"]
    root_mm: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchSearch:
    """Finds the patch that reduces a misfit most.

    Attributes:
        step, root: distance of candidates and root of their second moment, in thicknesses; the distance is at
            most one pitch, but at least a fiftieth of the longer side.
        wider: roots of the guess at the best candidate that are tried too, over that of the candidate: from a
            guess that is much too narrow, a fit of a wide contact ends at a worse minimum.
        max_shear: largest ratio of shear to normal force of a candidate.
    """

    step: float = 0.4
    root: float = 0.25
    wider: tuple[float, ...] = (2.0, 4.0)
    max_shear: float = 1.0

    def start(self, model: BondedPadModel, fitter: PatchFitter) -> PatchCandidates:
        """The candidates of a pad."""
        root_mm = self.root * model.thickness_mm
        half_mm = 0.5 * np.array(model.patch.size_mm) - 0.5 * root_mm
        step_mm = max(min(self.step * model.thickness_mm, model.pitch_mm), 0.04 * float(half_mm.max()))
        along = [np.linspace(-half, half, max(int(np.rint(2.0 * half / step_mm)), 1) + 1) for half in half_mm]
        centre_mm = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2)
        column = [
            fitter.images(model, np.array([[*centre, root_mm, 0.0, root_mm]])).column[0, :_COLUMNS]
            for centre in centre_mm
        ]
        every = np.stack(column)
        return PatchCandidates(
            centre_mm=read_only(centre_mm),
            column=read_only(np.concatenate(column)),
            root_mm=root_mm,
            inverse=read_only(np.linalg.inv(every @ every.transpose(0, 2, 1))),
        )

    def __call__(
        self,
        candidates: PatchCandidates,
        residual_px: Float64[np.ndarray, " r"],
        weight: Float64[np.ndarray, " r"],
    ) -> tuple[np.ndarray | None, float]:
        """The guess (PARAMETER_COUNT,) that reduces the misfit most, and this gain; None if none presses.

        `residual_px` is measured minus fitted.
        """
        pull = _pulls(candidates.column, residual_px, weight)
        load, gain = _loads(candidates.inverse, pull, weight)
        is_press = self._is_press(load)
        if not is_press.any():
            return None, 0.0
        best = int(np.argmax(np.where(is_press, gain, -1.0)))
        return _guess(candidates.centre_mm[best], candidates.root_mm, load[best]), float(gain[best])

    def widened(
        self,
        model: BondedPadModel,
        fitter: PatchFitter,
        guess: Float64[np.ndarray, "10"],
        residual_px: Float64[np.ndarray, " r"],
        weight: Float64[np.ndarray, " r"],
    ) -> Float64[np.ndarray, "10"]:
        """The guess with the root of the second moment that reduces the misfit most; residuals as above."""
        root_mm = guess[2] * np.array([1.0, *self.wider])
        shapes = np.stack([_guess(guess[:2], root, np.zeros(_COLUMNS))[:SHAPE] for root in root_mm])
        column = fitter.images(model, shapes).column[:, :_COLUMNS]
        pull = _pulls(column.reshape(-1, column.shape[-1]), residual_px, weight)
        load, gain = _loads(np.linalg.inv(column @ column.transpose(0, 2, 1)), pull, weight)
        best = int(np.argmax(np.where(self._is_press(load), gain, -1.0)))
        return _guess(guess[:2], root_mm[best], load[best]) if best > 0 else guess

    def _is_press(self, load: Float64[np.ndarray, "k 3"]) -> Mask:
        """(k,) whether loads press, and shear no more than they can."""
        return np.asarray(
            (load[:, 0] > 0.0) & (np.hypot(load[:, 1], load[:, 2]) <= self.max_shear * load[:, 0])
        )


def _pulls(
    column: Float64[np.ndarray, "c r"],
    residual_px: Float64[np.ndarray, " r"],
    weight: Float64[np.ndarray, " r"],
) -> Float64[np.ndarray, "k 3"]:
    """Weighted products of images by unit loads with residuals."""
    return np.asarray((column @ (weight * residual_px)).reshape(-1, _COLUMNS))


def _loads(
    inverse: Float64[np.ndarray, "k 3 3"], pull: Float64[np.ndarray, "k 3"], weight: Float64[np.ndarray, " r"]
) -> tuple[Float64[np.ndarray, "k 3"], Scalars]:
    """Loads (k, 3) with the least misfit, and by how much each reduces it (k,).

    With the median weight for all markers; what is not seen counts as a residual of 0.
    """
    usual = float(np.median(weight[weight > 0.0])) if (weight > 0.0).any() else 0.0
    load = np.einsum("kij,kj->ki", inverse, pull) / max(usual, 1e-300)
    return load, np.asarray((load * pull).sum(axis=1))


def _guess(centre_mm: np.ndarray, root_mm: float, load: np.ndarray) -> Float64[np.ndarray, "10"]:
    """A round contact with a root of its second moment."""
    guess = np.zeros(PARAMETER_COUNT)
    guess[:SHAPE] = *centre_mm, root_mm, 0.0, root_mm
    guess[SHAPE : SHAPE + _COLUMNS] = load
    return guess


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ProfileChoice:
    """Tries other profiles of wide contacts, narrow contacts as wide ones, and near contacts as one.

    Attributes:
        gain: by how much another profile or width must reduce the misfit, and by how much near contacts as
            one may increase it, in units of the misfit per degree of freedom of the fit that is tried (at
            least 1, `misfit_scale`). A rim must reduce it by as much more: within a radius of a thickness
            markers hardly show whether the middle of a contact is loaded, and flat faces are more usual.
        root: least root of the second moment, in thicknesses, of a contact whose other profiles are tried;
            the markers hardly show that of narrower ones. Near contacts as one are tried with each profile.
        between: root, in pitches, below which a contact is between markers: it may be another minimum of the
            misfit than that of a wide contact.
        wider: root of a round dome as which it is tried then, over the quadratic mean of its principal roots.
    """

    gain: float = 15.0
    root: float = 0.35
    between: float = 0.3
    wider: float = 4.0

    def applies(self, model: BondedPadModel, fit: PadFit) -> bool:
        """Whether there is anything to try."""
        may_change = self._wide(model, fit.patches) or self._narrow(model, fit)
        return len(may_change) > 0 or len(near_groups(fit.patches)) > 0

    def __call__(
        self, model: BondedPadModel, fitter: PatchFitter, fit: PadFit, linear_px: Float64[np.ndarray, " r"]
    ) -> PadFit | None:
        """The fit with another profile or width of a contact, or with near ones as one, where that is better;
        None where nothing is. The parameters of the pad are those of the sensor file, and covariances are
        empty: it is a guess for another fit.

        Args:
            model: of the pad.
            fitter: of the patches.
            fit: of the frame.
            linear_px: (2 m,) displacements of the marker images, px, without what is not linear in the
                displacements of the markers.
        """

        def fitted(patches: Patches, needed: float = np.inf) -> PadFit:
            return fitter(
                model,
                patches,
                linear_px,
                fit.weight,
                is_sheet_known=True,
                with_covariance=False,
                needed=needed,
            )

        before = fitted(fit.patches)  # with the same parameters of the pad as what is compared
        best, best_merit = None, 0.0

        def compare(patches: Patches, *, is_start: bool = False) -> PadFit:
            """The fit of guesses; unfinished where it cannot be the best and no other one starts with it."""
            nonlocal best, best_merit
            more = len(patches) == len(fit.patches)
            least_gain = self.gain * ((1 if more else -1) + _rims(patches) - _rims(fit.patches)) + best_merit
            needed = before.misfit - least_gain if least_gain >= 0.0 and not is_start else np.inf
            found = fitted(patches, needed)
            merit = (before.misfit - found.misfit) / misfit_scale(found) - least_gain
            if merit >= 0.0 if best is None else merit > 0.0:
                best, best_merit = found, best_merit + merit
            return found

        for number in self._wide(model, fit.patches):
            _try_others(compare, before, number)
        for number in self._narrow(model, fit):
            compare(widened(fit.patches, number, self.wider)[Profile.DOME])
        for group in near_groups(fit.patches):
            one = compare(joined(fit.patches, group), is_start=True)
            _try_others(compare, one, len(one.patches) - 1)
        return best

    def _wide(self, model: BondedPadModel, patches: Patches) -> list[int]:
        """Numbers of the patches that are wide enough for other profiles."""
        return [int(number) for number in np.flatnonzero(_root_mm(patches) >= self.root * model.thickness_mm)]

    def _narrow(self, model: BondedPadModel, fit: PadFit) -> list[int]:
        """Numbers of the patches that may be wide ones: none if the misfit cannot fall by `gain`."""
        if fit.misfit < self.gain:
            return []
        least_mm = min(self.root * model.thickness_mm, self.between * model.pitch_mm)
        return [int(number) for number in np.flatnonzero(_root_mm(fit.patches) < least_mm)]


def _rims(patches: Patches) -> int:
    """Number of patches with the profile of a rim."""
    return int((patches.profile == Profile.RIM).sum())


def _root_mm(patches: Patches) -> Scalars:
    """(c,) roots of the second moments: geometric means along the principal directions."""
    return np.asarray(np.sqrt(np.abs(patches.parameters[:, ROOT_XX] * patches.parameters[:, ROOT_YY])))


def _try_others(compare: Callable[..., PadFit], fit: PadFit, number: int) -> None:
    """Compare the fits with each other profile of a patch, each from that with the next profile to it.

    From a profile that is less alike, a fit may end at a worse minimum.
    """
    now = int(fit.patches.profile[number])
    for profiles in (tuple(Profile)[now + 1 :], tuple(Profile)[:now][::-1]):
        start = fit.patches
        for profile in profiles:
            found = compare(start.with_profile(number, profile), is_start=profile is not profiles[-1])
            start = found.patches
