"""Shape, contacts and forces of a bonded pad.

`PatchFitter` fits the patches of the previous frame to the marker images. `PatchSearch` adds patches for what
they do not explain, as long as each reduces the misfit by more than noise and the error of the model do.
Depth is that of the contact face, with `large_strain`. Identities, slip, reference drift and outliers are
determined as on clamped sheets.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from manytouch.blas_threads import limit_blas_threads
from manytouch.estimation.contact_tracker import ContactTracker, ContactTrackerState
from manytouch.estimation.excess_noise import ExcessNoise
from manytouch.estimation.frame_interval import interval_s
from manytouch.estimation.local_motion import LocalMotion, MarkerGroups, TouchMemory, marker_groups
from manytouch.estimation.outlier_gate import OutlierGate
from manytouch.estimation.pad.contacts.pad_contacts import PadContacts
from manytouch.estimation.pad.contacts.pad_shape import PadShape, pad_shape
from manytouch.estimation.pad.image_error import ImageError, MeasuredImages
from manytouch.estimation.pad.pad_model import MIN_MARKERS, BondedPadModel, NominalPad
from manytouch.estimation.pad.patch_fit import PadFit, PatchFitter, misfit_scale, nodal_of
from manytouch.estimation.pad.patch_kernels import Profile
from manytouch.estimation.pad.patch_search import PatchCandidates, PatchSearch, ProfileChoice
from manytouch.estimation.pad.patches import NO_PATCHES, Patches, halved_or_wider, joined, nearest_pair
from manytouch.estimation.perimeter.marker_surface import unknown_surface
from manytouch.estimation.reference_drift import ReferenceDrift
from manytouch.estimation.slip_detector import SlipDetector, SlipState
from manytouch.geometry.neighbours import Neighbours, nearest_neighbours
from manytouch.geometry.refraction import rest_px
from manytouch.medians import median
from manytouch.values import Contact, Contacts, Sensor, Status, Surface, TrackedGrid
from manytouch.values.arrays import Points2, Points3, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadState:
    """What stays the same between frames, and what a frame passes to the next one.

    Attributes:
        model: of the pad.
        candidates: where a contact may begin.
        neighbours: of each marker.
        around: (m, m) weights of the markers around each.
        groups: of neighbouring markers, for their local motion.
        touch: local motions of the frames before.
        initial_reference_px, reference_px: (m, 2) marker images at rest, at the start and now.
        patches: of the last frame.
        displacement_mm: (m, 3) of the markers in the last frame.
        excess_px2: variance of the marker images that their detection does not know of, along an axis.
        refused_misfit: misfit of the frame in which another contact or profile was last tried in vain; 0
            if none was.
        slip, tracks: of the contacts.
        timestamp_ns: time of the last frame; None: not known, or there was none.
    """

    model: BondedPadModel
    candidates: PatchCandidates
    neighbours: Neighbours
    around: Float64[np.ndarray, "m m"]
    groups: MarkerGroups
    touch: TouchMemory = field(default_factory=TouchMemory)
    initial_reference_px: Points2
    reference_px: Points2
    patches: Patches = NO_PATCHES
    displacement_mm: np.ndarray
    excess_px2: float = 0.0
    refused_misfit: float = 0.0
    slip: SlipState
    tracks: ContactTrackerState
    timestamp_ns: int | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadEstimator:
    """Contacts and shape of a bonded pad.

    Attributes:
        nominal_pad: properties of a pad that the sensor does not state.
        fitter: of the patches.
        search: of new patches.
        profile_choice: tries other profiles and widths of the patches.
        image_error: errors of the marker images that the model does not explain.
        excess_noise: noise that the detection of markers does not know of.
        outlier_gate: weights of the markers.
        pad_contacts: contacts with their covariances.
        contact_tracker: identities of contacts.
        local_motion: what a pad may keep of an earlier press.
        reference_drift: update of the reference while nothing touches the pad.
        slip_detector: flags contacts that slide.
        max_contacts: largest number of contacts.
        start_gain: a first contact must reduce the misfit by at least this, with weights that contain the
            error of the model under it; a further contact, by this times the misfit per degree of freedom
            with it (`misfit_scale`).
        sure_gain: the same with weights that lack the error of the model under the contact. A contact with
            this gain is accepted at once.
        start_stds, last_stds: least normal force of a contact that starts and of one that lasts, in standard
            deviations by noise and priors. Where the markers may only have stayed displaced after an earlier
            press, the force or the depth must also be `last_stds` of the reported deviations. The only
            contact on a pad that is certainly touched needs no force.
        least_depth: least depth of a contact, in thicknesses.
        retry_misfit: another contact or profile is tried again when the misfit is this factor of that of the
            frame in which it was last tried in vain.
        refusal_lasts: in each further frame, the misfit of that frame is multiplied by this factor, or
            becomes the misfit of the further frame if that is less.
        split_misfit: if the misfit per image coordinate is larger, the widest contact is also tried as two
            contacts and as a wider one.
        merge_gain: two near contacts become one unless that increases the misfit by this times the misfit per
            degree of freedom (`misfit_scale`).
        same_share: weights and guesses of the previous frame are used if the marker images have changed by at
            most this share of their displacement (root mean squares).
    """

    nominal_pad: NominalPad = field(default_factory=NominalPad)
    fitter: PatchFitter = field(default_factory=PatchFitter)
    search: PatchSearch = field(default_factory=PatchSearch)
    profile_choice: ProfileChoice = field(default_factory=ProfileChoice)
    image_error: ImageError = field(default_factory=ImageError)
    excess_noise: ExcessNoise = field(default_factory=ExcessNoise)
    outlier_gate: OutlierGate = field(default_factory=OutlierGate)
    pad_contacts: PadContacts = field(default_factory=PadContacts)
    contact_tracker: ContactTracker = field(
        default_factory=lambda: ContactTracker(confirm_frames=1, gate_stds=2.0)
    )
    local_motion: LocalMotion = field(default_factory=lambda: LocalMotion(refinements=4))
    reference_drift: ReferenceDrift = field(default_factory=ReferenceDrift)
    slip_detector: SlipDetector = field(default_factory=SlipDetector)
    max_contacts: int = 8
    start_gain: float = 40.0
    sure_gain: float = 400.0
    start_stds: float = 3.0
    last_stds: float = 2.0
    least_depth: float = 0.002
    retry_misfit: float = 1.3
    refusal_lasts: float = 0.97
    split_misfit: float = 2.0
    merge_gain: float = 15.0
    same_share: float = 0.1

    def start(self, sensor: Sensor) -> PadState:
        """Computes everything that depends on the sensor only, and limits BLAS to one thread.

        Raises:
            SensorError: the sensor has no layout or no sheet.
            LayoutError: it has too few markers.
        """
        limit_blas_threads()
        model = self.nominal_pad(sensor)
        layout = model.layout
        at_rest_px = rest_px(sensor, layout)
        return PadState(
            model=model,
            candidates=self.search.start(model, self.fitter),
            neighbours=nearest_neighbours(layout.rest_mm[:, :2]),
            around=self.image_error.weights(model),
            groups=marker_groups(layout.rest_mm[:, :2], model.pitch_mm),
            initial_reference_px=read_only(at_rest_px.copy()),
            reference_px=read_only(at_rest_px.copy()),
            displacement_mm=read_only(np.zeros((len(layout.rest_mm), 3))),
            slip=SlipState(),
            tracks=self.contact_tracker.start(sensor),
        )

    def step(self, state: PadState, grid: TrackedGrid) -> tuple[PadState, Surface, Contacts]:
        """Surface and contacts of the next frame. It never raises; an unusable frame has a status."""
        model = state.model
        if grid.is_seen.sum() < MIN_MARKERS:
            status = Status.FEW_MARKERS if grid.status is Status.OK else grid.status
            tracks, contacts = self.contact_tracker.step(state.tracks, (), status=status)
            return replace(state, tracks=tracks), unknown_surface(model.layout, status), contacts
        elapsed_s = interval_s(state.timestamp_ns, grid.timestamp_ns)
        measured, touch = self._measured(state, grid), state.touch
        fit, refused_misfit = self._fit_contacts(state, measured)
        shape = pad_shape(model, fit)
        found = self.pad_contacts(model, fit, shape)
        if grid.status is Status.OK:
            touch = self.local_motion.remember(touch, measured.local_pitch, elapsed_s=elapsed_s)
        may_be_kept = not measured.is_touched and measured.local_pitch <= self.local_motion.kept(touch)
        is_sure = may_be_kept and self.local_motion.is_surely_kept(measured.local_pitch, touch)
        is_kept = np.array([is_sure or (may_be_kept and not self._is_clear(each)) for each in found], bool)
        if is_kept.any():
            others = fit.patches.without(np.flatnonzero(is_kept))
            fit = self._fit(model, others, measured, fit.marker_mm(model))
            refused_misfit, shape = fit.misfit, pad_shape(model, fit)
            found = self.pad_contacts(model, fit, shape)
        least_mm = self.least_depth * model.thickness_mm
        force_std_mm2 = np.sqrt(misfit_scale(fit)) * fit.force_std_mm2
        start_stds = self.start_stds if self._last_stds(fit.patches, measured) > 0.0 else 0.0
        is_deep = np.array([not contact.depth_mm < least_mm for contact in found], bool)
        may_start = is_deep & (fit.force_mm2 >= start_stds * force_std_mm2)
        tracks, contacts = self.contact_tracker.step(
            state.tracks,
            found,
            may_start=may_start.tolist(),
            is_loaded=lambda old: bool(fit.patches.are_near(old.centre_mm[None], 2.0 * model.pitch_mm)[0]),
            status=grid.status,
        )
        slip, contacts = self.slip_detector(state.slip, contacts, model.pitch_mm, elapsed_s=elapsed_s)
        after = replace(
            state,
            patches=fit.patches,
            displacement_mm=read_only(fit.marker_mm(model)),
            excess_px2=self.excess_noise.after_fit(
                state.excess_px2, *fit.marker_residuals(), state.neighbours, is_touched=len(fit.patches) > 0
            ),
            refused_misfit=refused_misfit,
            touch=touch,
            slip=slip,
            tracks=tracks,
            timestamp_ns=grid.timestamp_ns,
        )
        if grid.status is Status.OK and len(fit.patches) == 0 and not tracks.tracks:
            before_px, first_px = state.reference_px, state.initial_reference_px
            now_px = self.reference_drift(before_px, first_px, grid, model.pitch_px, elapsed_s=elapsed_s)
            after = replace(after, reference_px=now_px)
        return after, self._surface(model, fit, found, shape, grid), contacts

    def _is_clear(self, contact: Contact) -> bool:
        """Whether force or depth of a contact are more than their deviations."""
        is_deep = contact.depth_mm >= self.last_stds * contact.std("depth")
        return is_deep or bool(-contact.force_N[2] >= self.last_stds * contact.std("normal_force"))

    def fit_frame(self, state: PadState, grid: TrackedGrid) -> PadFit:
        """The contacts of the next frame."""
        return self._fit_contacts(state, self._measured(state, grid))[0]

    def _last_stds(self, patches: Patches, measured: MeasuredImages) -> float:
        """`last_stds`; 0 for the only contact on a touched pad, which is one also if its force is unclear."""
        return 0.0 if measured.is_touched and len(patches) == 1 else self.last_stds

    def _fit_contacts(self, state: PadState, measured: MeasuredImages) -> tuple[PadFit, float]:
        """The contacts of the next frame, and `PadState.refused_misfit`.

        After a new contact was found, whatever else may explain the images better is tried in the next frame.
        In the first frame everything is tried at once, since it may be the only one.
        """
        model = state.model
        fit = self._pruned(model, self._fit(model, state.patches, measured, state.displacement_mm), measured)
        refused_misfit, may_wait, is_chosen = state.refused_misfit, state.refused_misfit > 0.0, False
        for _ in range(2 * self.max_contacts):  # a contact, and its profile
            if len(fit.patches) != len(state.patches):
                refused_misfit = 0.0
            if 0.0 < fit.misfit < self.retry_misfit * refused_misfit:
                refused_misfit = min(self.refusal_lasts * refused_misfit, fit.misfit)
                break
            better = None if is_chosen else self._with_profile(model, fit, measured)
            is_chosen = better is not None and len(better.patches) == 1  # no other profile is left to try
            if better is None and len(fit.patches) < self.max_contacts:
                better = self._with_more(state, fit, measured)
            if better is None:
                refused_misfit = fit.misfit
                break
            fit = self._pruned(model, better, measured)
            if (
                may_wait
                and not is_chosen
                and not self._is_poor(fit)
                and self.profile_choice.applies(model, fit)
            ):
                refused_misfit = 0.0
                break
        return fit, refused_misfit

    def _with_profile(self, model: BondedPadModel, fit: PadFit, measured: MeasuredImages) -> PadFit | None:
        """The fit with another profile or width of a contact, or near ones as one, where that is better."""
        if not self.profile_choice.applies(model, fit):
            return None
        linear_px, _ = self.image_error.images(model, measured, fit.marker_mm(model))
        guess = self.profile_choice(model, self.fitter, fit, linear_px)
        return None if guess is None else self._fit(model, guess.patches, measured, guess.marker_mm(model))

    def _with_more(self, state: PadState, fit: PadFit, measured: MeasuredImages) -> PadFit | None:
        """The fit with one contact more or a wider one, where that explains the images better."""
        model = state.model
        guess, gain = self.search(state.candidates, fit.residual_px, fit.weight)
        more = None
        if guess is not None and gain >= self.start_gain:
            guess = self.search.widened(model, self.fitter, guess, fit.residual_px, fit.weight)
            more = self._if_better(model, fit, fit.patches.with_more(guess[None], Profile.DOME), measured)
        if not self._is_poor(fit) or len(fit.patches) == 0:
            return more
        tried = [self._if_better(model, fit, each, measured) for each in halved_or_wider(fit.patches)]
        return min(filter(None, [more, *tried]), key=self._cost, default=None)

    def _is_poor(self, fit: PadFit) -> bool:
        """Whether the images are explained badly."""
        return fit.misfit > self.split_misfit * float((fit.weight > 0.0).sum())

    def _cost(self, fit: PadFit) -> float:
        """Misfit of a fit, with the least gain of each of its contacts."""
        return fit.misfit + self.start_gain * len(fit.patches)

    def _if_better(
        self, model: BondedPadModel, fit: PadFit, patches: Patches, measured: MeasuredImages
    ) -> PadFit | None:
        """The fit of guesses, unless a contact is not clear or the misfit does not fall by enough."""
        images = self.image_error.images(model, measured, fit.marker_mm(model))
        needed = fit.misfit - self.start_gain
        first = self.fitter(
            model, patches, *images, is_sheet_known=True, with_covariance=False, is_rough=True, needed=needed
        )
        if first.misfit > needed:
            return None
        found = self._fit(model, first.patches, measured, first.marker_mm(model))
        if np.any(found.force_mm2 <= self._last_stds(patches, measured) * found.force_std_mm2):
            return None
        # with the weights before the contact, which lack the model's error for it, the gain must be clear
        # a first contact is better than none, also where the model explains it badly
        unexplained = misfit_scale(found) if len(fit.patches) > 0 else 1.0
        if fit.misfit - first.misfit >= self.sure_gain * unexplained:
            return found
        linear_px, _ = self.image_error.images(model, measured, found.marker_mm(model))
        same = self.fitter(model, fit.patches, linear_px, found.weight, with_covariance=False)
        return found if same.misfit - found.misfit >= self.start_gain * unexplained else None

    def _measured(self, state: PadState, grid: TrackedGrid) -> MeasuredImages:
        moved_px = np.where(grid.is_seen[:, None], grid.position_px - state.reference_px, 0.0)
        linear_px = np.einsum("mij,mj->mi", state.model.slope_px, state.displacement_mm)
        noise_px2 = 0.5 * np.trace(grid.covariance_px2, axis1=1, axis2=2) + state.excess_px2
        noise_px2[~grid.is_seen] = median(noise_px2[grid.is_seen])
        larger_px2 = np.maximum((moved_px**2).sum(axis=1), (linear_px**2).sum(axis=1))
        std_px = np.sqrt(noise_px2 + self.image_error(state.model, state.around, larger_px2, noise_px2))
        # a marker that moves like its neighbours is no outlier, also where the model does not explain it:
        # else those under a contact would be lost first
        is_seen, neighbour = grid.is_seen, state.neighbours.index
        moves_px = (moved_px - linear_px, moved_px)
        gates = [self.outlier_gate(each, std_px, is_seen, neighbour) for each in moves_px]
        moved_mm = state.model.pitch_mm / state.model.pitch_px * moved_px
        local_pitch = float(self.local_motion(state.groups, moved_mm, is_seen).max())
        noise_pitch = float(np.sqrt(median(noise_px2))) / state.model.pitch_px
        return MeasuredImages(
            moved_px=moved_px,
            gate=np.maximum(*gates),
            noise_px2=noise_px2,
            around=state.around,
            local_pitch=local_pitch,
            is_touched=self.local_motion.is_touched(
                local_pitch, state.touch, noise_pitch, lasts=len(state.patches) > 0
            ),
        )

    def _fit(
        self, model: BondedPadModel, patches: Patches, measured: MeasuredImages, moved_mm: Points3
    ) -> PadFit:
        """Patches for guesses, with the weights for displacements (m, 3) of the markers or for fitted ones.

        The parameters of the pad are fitted last: before, they would explain what is wrong with the guesses.
        """
        images = self.image_error.images(model, measured, moved_mm)
        if len(patches) > 0 and not self._is_same(model, measured, moved_mm):
            rough = self.fitter(
                model, patches, *images, is_sheet_known=True, with_covariance=False, is_rough=True
            )
            patches, images = rough.patches, self.image_error.images(model, measured, rough.marker_mm(model))
        return self.fitter(model, patches, *images)

    def _is_same(self, model: BondedPadModel, measured: MeasuredImages, moved_mm: Points3) -> bool:
        """Whether the marker images are nearly those of displacements (m, 3)."""
        linear_px = np.einsum("mij,mj->mi", model.slope_px, moved_mm)
        change_px2 = ((measured.moved_px - linear_px) ** 2).sum(axis=1)
        most_px2 = self.same_share**2 * (linear_px**2).sum(axis=1)
        return bool(measured.gate @ change_px2 <= measured.gate @ most_px2)

    def _pruned(self, model: BondedPadModel, fit: PadFit, measured: MeasuredImages) -> PadFit:
        """The fit without contacts that are not significant, and with near ones as one if that is enough."""
        while len(fit.patches) > 0:
            stds = fit.force_mm2 / fit.force_std_mm2
            weakest = int(np.argmin(stds))
            least_stds = self._last_stds(fit.patches, measured)
            if stds[weakest] >= least_stds and len(fit.patches) <= self.max_contacts:
                break
            rest = fit.patches.without(weakest)
            fit = self._fit(model, rest, measured, fit.marker_mm(model))
        while len(fit.patches) > 1:
            pair = nearest_pair(fit.patches)
            if pair is None:
                break
            linear_px, _ = self.image_error.images(model, measured, fit.marker_mm(model))
            one = self.fitter(model, joined(fit.patches, pair), linear_px, fit.weight)
            if one.misfit - fit.misfit > self.merge_gain * misfit_scale(fit):
                break
            fit = one
        return fit

    def _surface(
        self, model: BondedPadModel, fit: PadFit, found: Sequence[Contact], shape: PadShape, grid: TrackedGrid
    ) -> Surface:
        covariance_mm2 = self.pad_contacts.surface_covariance(model, fit, found, shape, grid.is_seen)
        press_mm2 = np.array([contact.normal_force_over_E_mm2 for contact in found])
        return Surface(
            position_mm=read_only(model.layout.rest_mm + shape.face_mm),
            displacement_mm=read_only(shape.face_mm),
            covariance_mm2=read_only(covariance_mm2),
            layout=model.layout,
            spline=model.spline(shape.coefficient_mm, nodal_of(model, fit, press_mm2)),
            status=grid.status,
        )
