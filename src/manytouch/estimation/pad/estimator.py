"""Shape, contacts and forces of a bonded pad.

`PatchFitter` fits the patches of the frame before to the marker images; `PatchSearch` adds patches for what
they do not explain, as long as the misfit falls by more than chance and the model's error allow. Depth is
that of the contact face, with `large_strain`. Identities, slip, reference drift and outliers are those of
clamped sheets.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from manytouch.blas_threads import limit_blas_threads
from manytouch.estimation.contact_tracker import ContactTracker, ContactTrackerState
from manytouch.estimation.outlier_gate import OutlierGate
from manytouch.estimation.pad.pad_contacts import PadContacts, PadShape, pad_shape
from manytouch.estimation.pad.pad_model import MIN_MARKERS, NominalPad, PadModel
from manytouch.estimation.pad.patch_fit import OWN, PatchFit, PatchFitter
from manytouch.estimation.pad.patch_kernels import SHAPE
from manytouch.estimation.pad.patch_search import Candidates, PatchSearch
from manytouch.estimation.perimeter.marker_surface import unknown_surface
from manytouch.estimation.reference_drift import ReferenceDrift
from manytouch.estimation.slip_detector import SlipDetector, SlipState
from manytouch.geometry.neighbours import Neighbours, nearest_neighbours
from manytouch.geometry.refraction import rest_px
from manytouch.values import Contacts, Sensor, Status, Surface, TrackedGrid
from manytouch.values.arrays import Mask, Points2, Points3, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadState:
    """What a frame passes to the next.

    Attributes:
        model: of the pad.
        candidates: where a contact may begin.
        neighbours: of each marker.
        initial_reference_px, reference_px: (m, 2) marker images at rest, at the start and now.
        contact: (c, OWN) parameters of the patches of the last frame.
        displacement_mm: (m, 3) of the markers in the last frame.
        slip, tracks: of the contacts.
    """

    model: PadModel
    candidates: Candidates
    neighbours: Neighbours
    initial_reference_px: Points2
    reference_px: Points2
    contact: np.ndarray
    displacement_mm: np.ndarray
    slip: SlipState
    tracks: ContactTrackerState


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Measured:
    """The marker images of a frame.

    Attributes:
        moved_px: (m, 2) displacements, 0 where not seen.
        gate: (m,) weights of the markers.
        noise_px2: (m,) variances along an axis.
    """

    moved_px: Points2
    gate: Scalars
    noise_px2: Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadEstimator:
    """Contacts and shape of a bonded pad.

    Attributes:
        nominal_pad: properties of a pad that the sensor does not state.
        fitter: of the patches.
        search: of new patches.
        outlier_gate: weights of the markers.
        pad_contacts: contacts with their covariances.
        contact_tracker: identities of contacts.
        reference_drift: update of the reference while nothing touches the pad.
        slip_detector: flags contacts that slide.
        model_std_pitch: standard deviation of a marker image that the model does not explain, in pitches.
        model_share: the same over the displacement of the marker.
        max_contacts: largest number of contacts.
        start_gain: least reduction of the misfit by a new contact.
        start_stds, last_stds: least normal force of a contact that starts and of one that lasts, in standard
            deviations.
        least_depth: least depth of a contact, in thicknesses.
        split_misfit: misfit per image coordinate above which the widest contact may be two.
        merge_gain: least increase of the misfit if two near contacts were one.
    """

    nominal_pad: NominalPad = field(default_factory=NominalPad)
    fitter: PatchFitter = field(default_factory=PatchFitter)
    search: PatchSearch = field(default_factory=PatchSearch)
    outlier_gate: OutlierGate = field(default_factory=OutlierGate)
    pad_contacts: PadContacts = field(default_factory=PadContacts)
    contact_tracker: ContactTracker = field(default_factory=lambda: ContactTracker(confirm_frames=1))
    reference_drift: ReferenceDrift = field(default_factory=ReferenceDrift)
    slip_detector: SlipDetector = field(default_factory=SlipDetector)
    model_std_pitch: float = 5e-4
    model_share: float = 0.06
    max_contacts: int = 8
    start_gain: float = 40.0
    start_stds: float = 3.0
    last_stds: float = 2.0
    least_depth: float = 0.002
    split_misfit: float = 2.0
    merge_gain: float = 15.0

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
            initial_reference_px=read_only(at_rest_px.copy()),
            reference_px=read_only(at_rest_px.copy()),
            contact=read_only(np.zeros((0, OWN))),
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
        fit = self.fit_frame(state, grid)
        shape = pad_shape(model, fit)
        found = self.pad_contacts(model, fit, shape)
        least_mm = self.least_depth * model.thickness_mm
        may_start = [
            bool(contact.depth_mm >= least_mm and force >= self.start_stds * std)
            for contact, force, std in zip(found, fit.force_mm2, fit.force_std_mm2, strict=True)
        ]
        tracks, contacts = self.contact_tracker.step(
            state.tracks,
            found,
            may_start=may_start,
            is_loaded=lambda place_mm: _is_near(place_mm, fit, 2.0 * model.pitch_mm),
            status=grid.status,
        )
        slip, contacts = self.slip_detector(state.slip, contacts, model.pitch_mm)
        after = replace(
            state,
            contact=read_only(fit.contact),
            displacement_mm=read_only(fit.marker_mm(model)),
            slip=slip,
            tracks=tracks,
        )
        if grid.status is Status.OK and len(fit.contact) == 0 and not tracks.tracks:
            reference_px = self.reference_drift(
                state.reference_px, state.initial_reference_px, grid, model.pitch_px
            )
            after = replace(after, reference_px=reference_px)
        return after, self._surface(model, fit, shape, grid), contacts

    def fit_frame(self, state: PadState, grid: TrackedGrid) -> PatchFit:
        """The contacts of the next frame."""
        model, measured = state.model, self._measured(state, grid)
        fit = self._fit(model, state.contact, measured, state.displacement_mm)
        for _ in range(self.max_contacts):
            fit = self._pruned(model, fit, measured)
            guess, gain = self.search(state.candidates, fit.residual_px, fit.weight)
            if len(fit.contact) >= self.max_contacts:
                break
            longer = None
            if guess is not None and gain >= self.start_gain:
                longer = self._if_better(model, fit, np.vstack([fit.contact, guess]), measured)
            is_poor = fit.misfit > self.split_misfit * float((fit.weight > 0.0).sum())
            if longer is None and is_poor and len(fit.contact) > 0:
                widest = int(np.argmax((fit.contact[:, 2:SHAPE] ** 2).sum(axis=1)))
                longer = self._if_better(model, fit, _halved(fit.contact, widest), measured)
            if longer is None:
                break
            fit = longer
        return fit

    def _if_better(
        self, model: PadModel, fit: PatchFit, contact: np.ndarray, measured: _Measured
    ) -> PatchFit | None:
        """The fit of guesses, unless a contact is not clear or the misfit does not fall by enough."""
        found = self._fit(model, contact, measured, fit.marker_mm(model))
        if np.any(found.force_mm2 <= self.last_stds * found.force_std_mm2):
            return None
        linear_px = self._linear_px(model, measured, found.marker_mm(model))
        same = self.fitter(model, fit.contact, linear_px, found.weight)
        return found if same.misfit - found.misfit >= self.start_gain else None

    def _measured(self, state: PadState, grid: TrackedGrid) -> _Measured:
        moved_px = np.where(grid.is_seen[:, None], grid.position_px - state.reference_px, 0.0)
        linear_px = np.einsum("mij,mj->mi", state.model.slope_px, state.displacement_mm)
        noise_px2 = np.where(grid.is_seen, 0.5 * np.trace(grid.covariance_px2, axis1=1, axis2=2), 1.0)
        gate = self.outlier_gate(
            moved_px - linear_px, np.sqrt(noise_px2), grid.is_seen, state.neighbours.index
        )
        return _Measured(moved_px=moved_px, gate=gate, noise_px2=noise_px2)

    def _linear_px(
        self, model: PadModel, measured: _Measured, moved_mm: Points3
    ) -> Float64[np.ndarray, " r"]:
        """(2 m,) displacements without what is not linear in those of the markers."""
        linear_px = np.einsum("mij,mj->mi", model.slope_px, moved_mm)
        curved_px = model.project(moved_mm) - model.rest_px - linear_px
        return np.asarray((measured.moved_px - curved_px).ravel())

    def _fit(self, model: PadModel, contact: np.ndarray, measured: _Measured, moved_mm: Points3) -> PatchFit:
        """Patches for guesses, with the error of the model by the displacements (m, 3) of the markers."""
        fit = None
        for _ in range(2):
            linear_px = np.einsum("mij,mj->mi", model.slope_px, moved_mm)
            error_px2 = (self.model_std_pitch * model.pitch_px) ** 2
            error_px2 = error_px2 + self.model_share**2 * (linear_px**2).sum(axis=1)
            weight = np.repeat(measured.gate / (measured.noise_px2 + error_px2), 2)
            fit = self.fitter(model, contact, self._linear_px(model, measured, moved_mm), weight)
            contact, moved_mm = fit.contact, fit.marker_mm(model)
            if len(contact) == 0:
                break
        assert fit is not None
        return fit

    def _pruned(self, model: PadModel, fit: PatchFit, measured: _Measured) -> PatchFit:
        """The fit without contacts that are not significant, and with near ones as one if that is enough."""
        while len(fit.contact) > 0:
            stds = fit.force_mm2 / fit.force_std_mm2
            weakest = int(np.argmin(stds))
            if stds[weakest] >= self.last_stds:
                break
            rest = np.delete(fit.contact, weakest, axis=0)
            fit = self._fit(model, rest, measured, fit.marker_mm(model))
        while len(fit.contact) > 1:
            pair = self._nearest_pair(fit)
            if pair is None:
                break
            linear_px = self._linear_px(model, measured, fit.marker_mm(model))
            one = self.fitter(model, _joined(fit.contact, *pair), linear_px, fit.weight)
            if one.misfit - fit.misfit > self.merge_gain:
                break
            fit = one
        return fit

    def _nearest_pair(self, fit: PatchFit) -> tuple[int, int] | None:
        """Two contacts whose pressures overlap most; None if none do."""
        centre, root = fit.contact[:, :2], np.abs(fit.contact[:, 2:SHAPE])
        reach = np.sqrt(0.5 * (root**2).sum(axis=1))
        away = np.linalg.norm(centre[:, None] - centre, axis=2)
        overlap = away / (reach[:, None] + reach)
        overlap[np.diag_indices(len(centre))] = np.inf
        first, second = np.unravel_index(int(np.argmin(overlap)), overlap.shape)
        return None if overlap[first, second] > 3.0 else (int(first), int(second))

    def _surface(self, model: PadModel, fit: PatchFit, shape: PadShape, grid: TrackedGrid) -> Surface:
        return Surface(
            position_mm=read_only(model.layout.rest_mm + shape.face_mm),
            displacement_mm=read_only(shape.face_mm),
            covariance_mm2=read_only(self.pad_contacts.surface_covariance(model, fit, shape, grid.is_seen)),
            layout=model.layout,
            spline=model.spline(shape.coefficient_mm, shape.nodal_mm2),
            status=grid.status,
        )


def _is_near(place_mm: Points2, fit: PatchFit, reach_mm: float) -> Mask:
    """(k,) places with a fitted contact nearby."""
    away_mm = np.linalg.norm(place_mm[:, None] - fit.contact[:, :2], axis=2)
    return np.asarray(away_mm.min(axis=1, initial=np.inf) < reach_mm)


def _halved(contact: np.ndarray, number: int) -> np.ndarray:
    """The guesses with one contact as two halves along its longer axis."""
    own = contact[number]
    root = np.array([[own[2], 0.0], [own[3], own[4]]])
    size, axes = np.linalg.eigh(root @ root.T)
    arm, narrow = axes[:, 1] * np.sqrt(size[1]), float(np.sqrt(max(size[0], 0.05 * size[1])))
    half = own.copy()
    half[2:SHAPE], half[SHAPE : OWN - 1] = (narrow, 0.0, narrow), 0.5 * own[SHAPE : OWN - 1]
    halves = np.stack([half, half])
    halves[0, :2] += arm
    halves[1, :2] -= arm
    return np.vstack([np.delete(contact, number, axis=0), halves])


def _joined(contact: np.ndarray, first: int, second: int) -> np.ndarray:
    """The guesses with two contacts as one with their force, centre and moments."""
    press = contact[[first, second], SHAPE]
    share = press / press.sum()
    centre = share @ contact[[first, second], :2]
    spread = np.zeros((2, 2))
    for part, number in zip(share, (first, second), strict=True):
        xx, yx, yy = contact[number, 2:SHAPE]
        root = np.array([[xx, 0.0], [yx, yy]])
        arm = contact[number, :2] - centre
        spread += part * (root @ root.T + np.outer(arm, arm))
    root = np.linalg.cholesky(spread)
    load = contact[[first, second], SHAPE:].sum(axis=0)
    one = np.array([*centre, root[0, 0], root[1, 0], root[1, 1], *load])
    one[OWN - 1] = share @ contact[[first, second], OWN - 1]
    return np.vstack([np.delete(contact, [first, second], axis=0), one])
