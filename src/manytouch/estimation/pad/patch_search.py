"""Changes of a fit that may explain the markers better: one more patch, another profile or width of a patch,
or one patch instead of several near ones."""

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
    """Small patches with their centres on a lattice, one of which a search chooses.

    Attributes:
        centre_mm: (k, 2) of each, sheet frame.
        column: (3 k, 2 m) marker images by the unit loads of each: normal force, shear x, shear y.
        inverse: (k, 3, 3) inverse of the products of these three images with each other.
        root_mm: root of the second moment, the same of all.
    """

    centre_mm: Points2
    column: Float64[np.ndarray, "c r"]
    inverse: Float64[np.ndarray, "k 3 3"]
    root_mm: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchSearch:
    """Finds the small patch that reduces a misfit most.

    Attributes:
        step: distance of neighbouring candidates, in thicknesses; at most one pitch, but at least 2 % of the
            longer side.
        root: root of the second moment of the candidates, in thicknesses.
        wider: factors of this root that are tried at the place of the best candidate. From a guess that is
            much too narrow, the fit of a wide contact ends at a worse minimum.
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
        """The patch that reduces the misfit most, and by how much.

        Args:
            candidates: of the pad.
            residual_px: (2 m,) measured minus fitted.
            weight: (2 m,) inverse variances of the measurement, 0 where not seen.

        Returns:
            A guess (PARAMETER_COUNT,) for a fit, and the reduction of the misfit; None and 0 if no candidate
            has best loads that press, with a shear of at most `max_shear`.
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
        """The guess with one of the roots of `wider`, or its own, whichever reduces the misfit most.

        Args:
            model: of the pad.
            fitter: computes the marker images.
            guess: (PARAMETER_COUNT,) of a round patch.
            residual_px, weight: as in a search.
        """
        root_mm = guess[2] * np.array([1.0, *self.wider])
        shapes = np.stack([_guess(guess[:2], root, np.zeros(_COLUMNS))[:SHAPE] for root in root_mm])
        column = fitter.images(model, shapes).column[:, :_COLUMNS]
        pull = _pulls(column.reshape(-1, column.shape[-1]), residual_px, weight)
        load, gain = _loads(np.linalg.inv(column @ column.transpose(0, 2, 1)), pull, weight)
        best = int(np.argmax(np.where(self._is_press(load), gain, -1.0)))
        return _guess(guess[:2], root_mm[best], load[best]) if best > 0 else guess

    def _is_press(self, load: Float64[np.ndarray, "k 3"]) -> Mask:
        """(k,) whether the loads press, with a shear that friction can hold."""
        return np.asarray(
            (load[:, 0] > 0.0) & (np.hypot(load[:, 1], load[:, 2]) <= self.max_shear * load[:, 0])
        )


def _pulls(
    column: Float64[np.ndarray, "c r"],
    residual_px: Float64[np.ndarray, " r"],
    weight: Float64[np.ndarray, " r"],
) -> Float64[np.ndarray, "k 3"]:
    """(k, 3) products of the images by the unit loads of each patch with the weighted residuals."""
    return np.asarray((column @ (weight * residual_px)).reshape(-1, _COLUMNS))


def _loads(
    inverse: Float64[np.ndarray, "k 3 3"], pull: Float64[np.ndarray, "k 3"], weight: Float64[np.ndarray, " r"]
) -> tuple[Float64[np.ndarray, "k 3"], Scalars]:
    """Loads (k, 3) of each patch with the least misfit, and by how much they reduce it (k,).

    So that `inverse` does not depend on the frame, all markers get the median weight of those that are seen;
    one that is not seen counts with a residual of 0.
    """
    usual = float(np.median(weight[weight > 0.0])) if (weight > 0.0).any() else 0.0
    load = np.einsum("kij,kj->ki", inverse, pull) / max(usual, 1e-300)
    return load, np.asarray((load * pull).sum(axis=1))


def _guess(centre_mm: np.ndarray, root_mm: float, load: np.ndarray) -> Float64[np.ndarray, "10"]:
    """The parameters of a round patch with a root of its second moment and with three loads."""
    guess = np.zeros(PARAMETER_COUNT)
    guess[:SHAPE] = *centre_mm, root_mm, 0.0, root_mm
    guess[SHAPE : SHAPE + _COLUMNS] = load
    return guess


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ProfileChoice:
    """Tries other profiles of wide contacts, narrow contacts as wide ones, and several near contacts as one.

    Attributes:
        gain: another profile or width must reduce the misfit by at least this number of times the misfit per
            degree of freedom of the new fit (`misfit_scale`); one contact instead of several near ones may
            increase it by as much.
        rim_gain: further reduction that each additional rim requires: within a radius of a thickness the
            markers hardly show whether the middle of a contact is loaded, and flat faces are more common. A
            face that sticks has less misfit by up to 20 as a rim, rings by 400 and more.
        root: other profiles are tried of contacts whose second moment has at least this root, in thicknesses;
            of narrower ones the markers hardly show the profile. One contact instead of several is tried with
            each profile.
        between: a contact with a smaller root, in pitches, lies between markers. It may be a minimum of the
            misfit that is worse than that of a wide contact.
        wider: such a contact is tried as a round dome, whose root is this factor of the quadratic mean of its
            principal roots.
    """

    gain: float = 15.0
    rim_gain: float = 30.0
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

        before = fitted(fit.patches)  # with the parameters of the pad that the fits it is compared with have
        best, best_merit = None, 0.0

        def compare(patches: Patches, *, is_start: bool = False) -> PadFit:
            """The fit of guesses, which becomes `best` if it is better than that.

            It is left unfinished if it cannot become the best one and is not the start of another fit.
            """
            nonlocal best, best_merit
            is_same_count = len(patches) == len(fit.patches)
            more_rims = _rims(patches) - _rims(fit.patches)
            least_gain = self.gain * (1 if is_same_count else -1) + self.rim_gain * more_rims + best_merit
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
