"""The method `mechanics`: depth, contacts and forces from one inversion of the sheet's mechanics.

Of all shapes of the sheet that explain where the dots are, the one is taken that is held by the fewest
forces, which press and do not pull (`descent`). Depth is read from the shape, contacts from the forces
(`force_clusters`), deviations from the normal matrix of the last step and the model's error. Where the
sheet had to be assumed, contacts are found from the swelling of the dots (`uncalibrated`), and the shape
gives their forces.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.contact_finder import ContactFinder
from manytouch.estimation.contact_tracker import ContactTracker, ContactTrackerState
from manytouch.estimation.mechanics.contacts import Touching
from manytouch.estimation.mechanics.evidence import evidence
from manytouch.estimation.mechanics.force_clusters import Clusters, ForceClusters
from manytouch.estimation.mechanics.gauss_newton import Fit, GaussNewton, SheetShape
from manytouch.estimation.mechanics.model_order import ModelOrder
from manytouch.estimation.mechanics.sheet_model import NominalSheet, SheetModel
from manytouch.estimation.mechanics.solid_correction import SolidCorrection
from manytouch.estimation.mechanics.surface_covariance import MarkerTrust, SurfaceError
from manytouch.estimation.outlier_gate import OutlierGate
from manytouch.estimation.perimeter.marker_surface import MarkerGeometry, MarkerSurface
from manytouch.estimation.reference_drift import ReferenceDrift
from manytouch.estimation.slip_detector import SlipDetector, SlipState
from manytouch.estimation.uncalibrated.swelling_load import uncalibrated_contact_finder
from manytouch.geometry.camera import mm_per_px, project
from manytouch.geometry.neighbours import Neighbours, nearest_neighbours
from manytouch.mechanics.solver.normal_equations import Curvature
from manytouch.values import Contacts, Sensor, Surface, TrackedGrid
from manytouch.values.arrays import Covariances2, Mask, Points2, Scalars, read_only

_LEAST_MARKERS = 12


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MechanicsState:
    """What stays the same between frames, and what is remembered.

    Attributes:
        model: of the sheet.
        neighbours: of each marker.
        trust: in the displacements of markers.
        began_px, reference_px: (m, 2) dots of the untouched sheet, at the start and now.
        pitch_px, model_px: pitch in the image, and what the model does not explain of a dot's place.
        shape: of the frame before.
        near: curvature of the last frame that took a whole step; None before the first.
        near_frames: frames since then.
        seen_mm: (k, 2) where forces stood in the frame before, contacts or not.
        grips: of the contacts on the sheet.
        tracks: of the contacts.
        uncalibrated: geometry of the markers, and state of the finder of contacts, where the sheet was
            assumed; else None.
    """

    model: SheetModel
    neighbours: Neighbours
    trust: MarkerTrust
    began_px: Points2
    reference_px: Points2
    pitch_px: float
    model_px: float
    shape: SheetShape
    near: Curvature | None
    near_frames: int
    seen_mm: Float64[np.ndarray, "k 2"]
    grips: SlipState
    tracks: ContactTrackerState
    uncalibrated: tuple[MarkerGeometry, Any] | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MechanicsEstimator:
    """Shape and forces of the sheet by mechanics.

    Attributes:
        nominal: what is assumed of the sheet.
        gate: which dots to believe.
        descend: to the shape.
        cluster: forces to contacts.
        order: which clusters are two contacts, and where contacts are.
        solid: what the face of a solid is deeper than that of a shell, at the markers.
        touch: contacts with their deviations.
        identity: which contact is which of the frame before.
        error: of the displacements of markers.
        settle: reference while nothing touches.
        slip: which contacts slide.
        marker_surface: depth of the markers where the sheet was assumed.
        uncalibrated_contact_finder: finds contacts there.
        pad_pitch: forces so near to one of these are its own.
        model_std_pitch, nominal_std_pitch: of a dot's place, what the model does not explain, when the
            sheet is known and when it was assumed.
        firm_at_rim: so many times that within `rim_thickness` thicknesses of the part without a rim.
        most_friction: shear over normal force that a new contact may have.
        usual_noise_px: of centres where the sensor does not say it.
        usual: deviation of a dot's place, noise and model, in units of the model's, that is nothing unusual.
        firm, clear: least normal force of a new contact, in units of that which lets one last: where
            there was a force in the frame before, and where there was none.
        hidden: where dots are noisier than usual, nodes whose force is below this share of what the noise
            adds to `descend.sparse` belong to no contact.
        lasting_stds, new_stds: a contact's normal force is so many deviations of its noise to last, to begin.
    """

    nominal: NominalSheet = field(default_factory=NominalSheet)
    gate: OutlierGate = field(default_factory=OutlierGate)
    descend: GaussNewton = field(default_factory=GaussNewton)
    cluster: ForceClusters = field(default_factory=ForceClusters)
    order: ModelOrder = field(default_factory=ModelOrder)
    solid: SolidCorrection = field(default_factory=SolidCorrection)
    touch: Touching = field(default_factory=Touching)
    identity: ContactTracker = field(default_factory=lambda: ContactTracker(confirm_frames=1))
    error: SurfaceError = field(default_factory=SurfaceError)
    settle: ReferenceDrift = field(default_factory=ReferenceDrift)
    slip: SlipDetector = field(default_factory=SlipDetector)
    marker_surface: MarkerSurface = field(default_factory=MarkerSurface)
    uncalibrated_contact_finder: ContactFinder = field(default_factory=uncalibrated_contact_finder)
    pad_pitch: float = 2.0
    model_std_pitch: float = 8.4e-4
    nominal_std_pitch: float = 5e-3
    usual: float = 1.5
    firm: float = 1.5
    clear: float = 4.0
    hidden: float = 0.3
    lasting_stds: float = 2.5
    new_stds: float = 4.0
    firm_at_rim: float = 3.0
    rim_thickness: float = 2.0
    most_friction: float = 1.5
    usual_noise_px: float = 0.05

    def start(self, sensor: Sensor) -> MechanicsState:
        """Works out everything that only the sensor decides.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: it has too few markers.
        """
        model = self.nominal(sensor)
        layout = model.layout
        rest_px = project(sensor.camera, layout.rest_mm) if layout.rest_px is None else layout.rest_px
        pitch_px = model.pitch_mm / mm_per_px(sensor.camera)
        model_px = pitch_px * (self.nominal_std_pitch if model.is_nominal else self.model_std_pitch)
        still = read_only(np.zeros((model.patch.node_count, 3)))
        weight_mm4 = self.descend.weights(model, still)
        std_px = float(np.hypot(model_px, sensor.centre_noise_px or self.usual_noise_px))
        return MechanicsState(
            model=model,
            neighbours=nearest_neighbours(layout.rest_mm[:, :2]),
            trust=self.error.start(model, weight_mm4, std_px),
            began_px=read_only(rest_px.copy()),
            reference_px=read_only(rest_px.copy()),
            pitch_px=pitch_px,
            model_px=model_px,
            shape=SheetShape.of(model, still),
            near=None,
            near_frames=0,
            seen_mm=read_only(np.zeros((0, 2))),
            grips=SlipState(),
            tracks=self.identity.start(sensor),
            uncalibrated=self._start_uncalibrated(sensor) if model.is_nominal else None,
        )

    def _start_uncalibrated(self, sensor: Sensor) -> tuple[MarkerGeometry, Any]:
        return self.marker_surface.start(sensor), self.uncalibrated_contact_finder.start(sensor)

    def _find_uncalibrated(
        self, uncalibrated: tuple[MarkerGeometry, Any], grid: TrackedGrid
    ) -> tuple[tuple[MarkerGeometry, Any], Contacts]:
        """Contacts, without forces, of the next frame of a sheet that was assumed."""
        geometry, finder_state = uncalibrated
        motion = self.marker_surface(geometry, grid)
        finder_state, contacts = self.uncalibrated_contact_finder.step(finder_state, grid, motion)
        return (geometry, finder_state), contacts

    def step(self, state: MechanicsState, grid: TrackedGrid) -> tuple[MechanicsState, Surface, Contacts]:
        """Surface and contacts of the next frame. It never raises: a bad frame has a status."""
        if grid.is_seen.sum() < _LEAST_MARKERS:
            return self._blind(state, grid)
        model = state.model
        measured_px = np.where(grid.is_seen[:, None], grid.position_px - state.reference_px, 0.0)
        information = self.information(state, grid, measured_px)
        noise = self.noise(state, grid)
        fit = self.descend(
            model,
            state.shape,
            measured_px,
            information,
            noise,
            near=state.near,
            near_frames=state.near_frames,
        )
        status = grid.status if grid.status != "ok" else fit.status
        clusters, significance = self._clusters(state, fit, noise)
        surface = self._surface(state, grid, fit, clusters, status)
        if state.uncalibrated is not None:
            return self._step_uncalibrated(state, state.uncalibrated, grid, fit, surface)
        found = self.touch(model, clusters, fit.shape.coefficient_mm, fit.shape.force_mm2)
        is_firm = (self._is_firm(model, clusters, state.seen_mm) & (significance >= self.new_stds)).tolist()
        seen_mm = read_only(np.array([contact.centre_mm for contact in found]).reshape(-1, 2))
        tracks, contacts = self.identity.step(
            state.tracks,
            found,
            may_start=is_firm if fit.status == "ok" else [False] * len(found),
            is_loaded=lambda place_mm: self._is_there(model, fit, place_mm, noise),
            status=status,
        )
        grips, contacts = self.slip(state.grips, contacts, model.pitch_mm)
        reference_px = state.reference_px
        if status == "ok" and not tracks.tracks and not any(is_firm):
            reference_px = self.settle(reference_px, state.began_px, grid, state.pitch_px)
        after = replace(
            state,
            shape=fit.shape,
            near=fit.near,
            near_frames=0 if fit.steps else state.near_frames + 1,
            tracks=tracks,
            grips=grips,
            reference_px=reference_px,
            seen_mm=seen_mm,
        )
        return after, surface, contacts

    def _step_uncalibrated(
        self,
        state: MechanicsState,
        uncalibrated: tuple[MarkerGeometry, Any],
        grid: TrackedGrid,
        fit: Fit,
        surface: Surface,
    ) -> tuple[MechanicsState, Surface, Contacts]:
        """Contacts by how the dots swell; forces over E by the shape, NaN where it explains none there."""
        uncalibrated, contacts = self._find_uncalibrated(uncalibrated, grid)
        centre_mm = np.array([contact.centre_mm for contact in contacts.contacts]).reshape(-1, 2)
        away_mm = np.linalg.norm(state.model.patch.place_mm[:, None] - centre_mm, axis=2)
        told = []
        for number, contact in enumerate(contacts.contacts):
            is_near = away_mm[:, number] <= away_mm.min(axis=1)
            is_own = is_near & (away_mm[:, number] < self.pad_pitch * state.model.pitch_mm)
            force_mm2 = fit.shape.force_mm2[is_own].sum(axis=0)
            if fit.status != "ok" or -force_mm2[2] < self.cluster.least * state.model.lattice.force_unit_mm2:
                force_mm2 = np.full(3, np.nan)
            told.append(
                replace(
                    contact,
                    normal_force_over_E_mm2=-float(force_mm2[2]),
                    shear_over_E_mm2=(float(force_mm2[0]), float(force_mm2[1])),
                )
            )
        reference_px = state.reference_px
        if surface.status == "ok" and not self.uncalibrated_contact_finder.is_touched(uncalibrated[1]):
            reference_px = self.settle(reference_px, state.began_px, grid, state.pitch_px)
        after = replace(
            state,
            shape=fit.shape,
            near=fit.near,
            near_frames=0 if fit.steps else state.near_frames + 1,
            uncalibrated=uncalibrated,
            reference_px=reference_px,
        )
        return after, surface, replace(contacts, contacts=tuple(told))

    @staticmethod
    def _std_px(state: MechanicsState, grid: TrackedGrid) -> float:
        """Deviation of a dot's place along an axis: noise of this frame, and what the model leaves out."""
        noise_px2 = 0.5 * np.trace(grid.covariance_px2[grid.is_seen], axis1=1, axis2=2)
        return float(np.sqrt(np.median(noise_px2) + state.model_px**2))

    def noise(self, state: MechanicsState, grid: TrackedGrid) -> float:
        """How much noisier than usual the dots of a frame are; 1 where they are not."""
        return max(1.0, self._std_px(state, grid) / (self.usual * state.model_px))

    def information(self, state: MechanicsState, grid: TrackedGrid, measured_px: Points2) -> Covariances2:
        """(m, 2, 2) inverse covariances of the displacements times the trust in them."""
        noise_px2 = np.where(grid.is_seen, 0.5 * np.trace(grid.covariance_px2, axis1=1, axis2=2), 1.0)
        variance_px2 = noise_px2 + state.model_px**2
        trust = self.gate(
            measured_px - state.shape.moved_px, np.sqrt(variance_px2), grid.is_seen, state.neighbours.index
        )
        return np.asarray((trust / variance_px2)[:, None, None] * np.eye(2))

    def _blind(self, state: MechanicsState, grid: TrackedGrid) -> tuple[MechanicsState, Surface, Contacts]:
        """A frame that shows nothing."""
        status = "few_markers" if grid.status == "ok" else grid.status
        count = len(state.reference_px)
        surface = Surface(
            position_mm=read_only(np.full((count, 3), np.nan)),
            displacement_mm=read_only(np.full((count, 3), np.nan)),
            covariance_mm2=read_only(np.full((count, 3, 3), np.nan)),
            layout=state.model.layout,
            status=status,
        )
        if state.uncalibrated is not None:
            uncalibrated, contacts = self._find_uncalibrated(state.uncalibrated, grid)
            return replace(state, uncalibrated=uncalibrated), surface, contacts
        tracks, contacts = self.identity.step(state.tracks, (), status=status)
        return replace(state, tracks=tracks), surface, contacts

    def _surface(
        self, state: MechanicsState, grid: TrackedGrid, fit: Fit, clusters: Clusters, status: str
    ) -> Surface:
        model, shape = state.model, fit.shape
        displacement_mm = model.dots.displacement_mm(shape.coefficient_mm)
        displacement_mm[:, 2] -= self.solid.under_contacts(model, clusters, model.dots.face.point_mm)
        displacement_mm[:, 2] -= self.solid.along_clamp(model, shape.coefficient_mm)
        covariance_mm2 = self.error(
            model,
            state.trust,
            displacement_mm,
            shape.force_mm2,
            grid.is_seen,
            std_px=self._std_px(state, grid),
        )
        return Surface(
            position_mm=read_only(model.layout.rest_mm + displacement_mm),
            displacement_mm=read_only(displacement_mm),
            covariance_mm2=read_only(covariance_mm2),
            spline=model.spline(shape.coefficient_mm, shape.force_mm2),
            layout=model.layout,
            status=status,
        )

    def _clusters(self, state: MechanicsState, fit: Fit, noise: float) -> tuple[Clusters, Scalars]:
        """What presses, and how many deviations of its noise each normal force is.

        What noise alone may have made is left out.
        """
        model = state.model
        force_mm2 = np.where(model.is_beyond[:, None] | ~model.patch.is_free, 0.0, fit.shape.force_mm2)
        hidden_mm2 = self.hidden * (noise - 1.0) * self.descend.sparse * model.lattice.force_unit_mm2
        force_mm2 = np.where(force_mm2[:, 2:] > -hidden_mm2, 0.0, force_mm2)
        clusters = self.cluster(model.lattice, force_mm2)
        held_mm = np.array([contact.centre_mm for contact in state.tracks.touching]).reshape(-1, 2)
        clusters = self.order(
            model.lattice,
            force_mm2,
            clusters,
            held_mm,
            weigh=lambda node: evidence(model, fit, node),
            noise=noise,
        )
        inside = clusters.label == np.arange(len(clusters))[:, None]
        significance = clusters.normal_mm2 / model.normal.force_std(inside.astype(np.float64), 2)
        lasts = np.flatnonzero(significance >= self.lasting_stds)
        return clusters.chosen(lasts), significance[lasts]

    def _is_there(self, model: SheetModel, fit: Fit, place_mm: Points2, noise: float) -> Mask:
        """(k,) whether anything presses within a pitch of a place."""
        away_mm = np.linalg.norm(place_mm[:, None] - model.patch.place_mm, axis=2)
        press_mm2 = np.maximum(-fit.shape.force_mm2[:, 2], 0.0)
        near_mm2 = (away_mm < model.pitch_mm) @ press_mm2
        return np.asarray(near_mm2 >= noise * self.cluster.least * model.lattice.force_unit_mm2)

    def _is_firm(self, model: SheetModel, clusters: Clusters, seen_mm: Float64[np.ndarray, "k 2"]) -> Mask:
        """(c,) clusters that are clear enough to begin a contact.

        A camera that moves a little seems to drag the whole sheet along, against which the clamped outline
        pulls: that makes small forces near it, mostly tangential ones.
        """
        away_mm = np.linalg.norm(clusters.centre_mm[:, None] - seen_mm, axis=2).min(axis=1, initial=np.inf)
        is_new = away_mm > self.identity.gate_pitch * model.pitch_mm
        unit_mm2 = self.cluster.least * model.lattice.force_unit_mm2
        least_mm2 = unit_mm2 * np.where(is_new, self.clear, self.firm)
        left_mm = (model.lattice.inner_mm - np.abs(clusters.centre_mm)).min(axis=1, initial=np.inf)
        is_near_rim = left_mm < self.rim_thickness * model.thickness_mm
        shear_mm2 = np.linalg.norm(clusters.force_mm2[:, :2], axis=1)
        is_strong = clusters.normal_mm2 >= np.where(is_near_rim, self.firm_at_rim * least_mm2, least_mm2)
        return np.asarray(is_strong & (shear_mm2 <= self.most_friction * clusters.normal_mm2))
