"""The method `mechanics`: depth, contacts and forces from one inversion of the sheet's mechanics.

`GaussNewton` fits the shape of the sheet that explains the marker images with few, compressive forces. Depth
is evaluated on the shape, contacts are clusters of its nodal forces (`force_clusters`), standard deviations
come from the posterior of the last step and the model's error. For a sheet that was assumed, contacts are
found from the swelling of dots (`uncalibrated`), and the shape only gives their forces.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.contact_finder import ContactFinder
from manytouch.estimation.contact_tracker import ContactTracker, ContactTrackerState
from manytouch.estimation.mechanics.contact_rules import ContactRules, has_force_near, is_far_from
from manytouch.estimation.mechanics.contacts import ContactEstimator, with_forces
from manytouch.estimation.mechanics.evidence import evidence_at
from manytouch.estimation.mechanics.force_clusters import Clusters, ForceClusters
from manytouch.estimation.mechanics.gauss_newton import Fit, GaussNewton, SheetShape
from manytouch.estimation.mechanics.model_order import ModelOrder
from manytouch.estimation.mechanics.sheet_model import InversionModel, NominalSheet
from manytouch.estimation.mechanics.solid_correction import SolidCorrection
from manytouch.estimation.mechanics.surface_covariance import (
    MarkerDeviation,
    MarkerNoise,
    SurfaceError,
    marker_variances_px2,
)
from manytouch.estimation.outlier_gate import OutlierGate
from manytouch.estimation.perimeter.marker_surface import MarkerGeometry, MarkerSurface
from manytouch.estimation.reference_drift import ReferenceDrift
from manytouch.estimation.slip_detector import SlipDetector, SlipState
from manytouch.estimation.uncalibrated.swelling_load import uncalibrated_contact_finder
from manytouch.geometry.camera import mm_per_px, project
from manytouch.geometry.neighbours import Neighbours, nearest_neighbours
from manytouch.mechanics.solver.posterior import Posterior
from manytouch.values import Contacts, Sensor, Status, Surface, TrackedGrid
from manytouch.values.arrays import Covariances2, Mask, Points2, Scalars, read_only

MIN_MARKERS = 12
"""A frame with fewer seen markers has the status `few_markers`."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MechanicsState:
    """What stays the same between frames, and what a frame passes to the next.

    Attributes:
        model: of the sheet.
        neighbours: of each marker.
        deviation: of the marker displacements.
        initial_reference_px, reference_px: (m, 2) marker images at rest, at the start and now.
        pitch_px: pitch in the image.
        model_std_px: standard deviation of a marker image that the model does not explain.
        shape: of the previous frame.
        posterior: of the last frame with a full step; None before the first.
        posterior_frames: number of frames since then.
        previous_mm: (k, 2) centres of the clusters of the previous frame, contacts or not.
        slip: of the contacts.
        tracks: of the contacts.
        uncalibrated: geometry of the markers and state of the contact finder, for a sheet that was assumed;
            else None.
    """

    model: InversionModel
    neighbours: Neighbours
    deviation: MarkerDeviation
    initial_reference_px: Points2
    reference_px: Points2
    pitch_px: float
    model_std_px: float
    shape: SheetShape
    posterior: Posterior | None
    posterior_frames: int
    previous_mm: Float64[np.ndarray, "k 2"]
    slip: SlipState
    tracks: ContactTrackerState
    uncalibrated: tuple[MarkerGeometry, Any] | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MechanicsEstimator:
    """Shape, contacts and forces by mechanics.

    Attributes:
        nominal_sheet: properties of a sheet that the sensor does not state.
        marker_noise: standard deviations of marker images.
        outlier_gate: weights of the markers.
        gauss_newton: the inversion.
        force_clusters: groups of nodal forces.
        model_order: number and centres of the contacts in a group.
        contact_rules: which groups are contacts.
        solid_correction: depth of a solid's face minus that of a shell, at the markers.
        contact_estimator: contacts with their covariances.
        contact_tracker: identities of contacts.
        surface_error: covariances of the marker displacements.
        reference_drift: update of the reference while nothing touches the sheet.
        slip_detector: flags contacts that slide.
        marker_surface: depth of the markers of a sheet that was assumed.
        uncalibrated_contact_finder: finds the contacts of such a sheet.
        own_force_pitch: forces within this distance of such a contact are its own, in pitches.
    """

    nominal_sheet: NominalSheet = field(default_factory=NominalSheet)
    marker_noise: MarkerNoise = field(default_factory=MarkerNoise)
    outlier_gate: OutlierGate = field(default_factory=OutlierGate)
    gauss_newton: GaussNewton = field(default_factory=GaussNewton)
    force_clusters: ForceClusters = field(default_factory=ForceClusters)
    model_order: ModelOrder = field(default_factory=ModelOrder)
    contact_rules: ContactRules = field(default_factory=ContactRules)
    solid_correction: SolidCorrection = field(default_factory=SolidCorrection)
    contact_estimator: ContactEstimator = field(default_factory=ContactEstimator)
    contact_tracker: ContactTracker = field(default_factory=lambda: ContactTracker(confirm_frames=1))
    surface_error: SurfaceError = field(default_factory=SurfaceError)
    reference_drift: ReferenceDrift = field(default_factory=ReferenceDrift)
    slip_detector: SlipDetector = field(default_factory=SlipDetector)
    marker_surface: MarkerSurface = field(default_factory=MarkerSurface)
    uncalibrated_contact_finder: ContactFinder = field(default_factory=uncalibrated_contact_finder)
    own_force_pitch: float = 2.0

    def start(self, sensor: Sensor) -> MechanicsState:
        """Computes everything that depends on the sensor only.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: it has too few markers.
        """
        model = self.nominal_sheet(sensor)
        layout = model.layout
        rest_px = project(sensor.camera, layout.rest_mm) if layout.rest_px is None else layout.rest_px
        pitch_px = model.pitch_mm / mm_per_px(sensor.camera)
        model_std_px = self.marker_noise.model_std_px(pitch_px, is_assumed=model.is_nominal)
        rest_mm = read_only(np.zeros((model.patch.node_count, 3)))
        weight_mm4 = self.gauss_newton.weights(model, rest_mm)
        centre_noise_px = sensor.centre_noise_px or self.marker_noise.default_centre_noise_px
        std_px = float(np.hypot(model_std_px, centre_noise_px))
        return MechanicsState(
            model=model,
            neighbours=nearest_neighbours(layout.rest_mm[:, :2]),
            deviation=self.surface_error.start(model, weight_mm4, std_px),
            initial_reference_px=read_only(rest_px.copy()),
            reference_px=read_only(rest_px.copy()),
            pitch_px=pitch_px,
            model_std_px=model_std_px,
            shape=SheetShape.at(model, rest_mm),
            posterior=None,
            posterior_frames=0,
            previous_mm=read_only(np.zeros((0, 2))),
            slip=SlipState(),
            tracks=self.contact_tracker.start(sensor),
            uncalibrated=self._start_uncalibrated(sensor) if model.is_nominal else None,
        )

    def _start_uncalibrated(self, sensor: Sensor) -> tuple[MarkerGeometry, Any]:
        return self.marker_surface.start(sensor), self.uncalibrated_contact_finder.start(sensor)

    def step(self, state: MechanicsState, grid: TrackedGrid) -> tuple[MechanicsState, Surface, Contacts]:
        """Surface and contacts of the next frame. It never raises; an unusable frame has a status."""
        if grid.is_seen.sum() < MIN_MARKERS:
            return self._step_without_markers(state, grid)
        fit = self.fit_frame(state, grid)
        status = grid.status if grid.status is not Status.OK else fit.status
        noise = self.marker_noise.noise_ratio(grid, state.model_std_px)
        clusters, significance = self._clusters(state, fit, noise)
        surface = self._surface(state, grid, fit, clusters, status)
        after = replace(
            state,
            shape=fit.shape,
            posterior=fit.posterior,
            posterior_frames=0 if fit.steps else state.posterior_frames + 1,
        )
        if state.uncalibrated is not None:
            return self._step_uncalibrated(after, state.uncalibrated, grid, fit, surface)
        may_start = self._may_start(state, clusters) & (significance >= self.contact_rules.start_stds)
        may_start &= fit.status is Status.OK
        after, contacts = self._track(after, clusters, fit, may_start=may_start, noise=noise, status=status)
        if status is Status.OK and not after.tracks.tracks and not may_start.any():
            after = self._update_reference(after, grid)
        return after, surface, contacts

    def fit_frame(self, state: MechanicsState, grid: TrackedGrid) -> Fit:
        """The shape of the sheet in the next frame."""
        measured_px = np.where(grid.is_seen[:, None], grid.position_px - state.reference_px, 0.0)
        return self.gauss_newton(
            state.model,
            state.shape,
            measured_px,
            self.information(state, grid, measured_px),
            self.marker_noise.noise_ratio(grid, state.model_std_px),
            posterior=state.posterior,
            posterior_frames=state.posterior_frames,
        )

    def information(self, state: MechanicsState, grid: TrackedGrid, measured_px: Points2) -> Covariances2:
        """(m, 2, 2) inverse covariances of the marker displacements times their weights, per px^2."""
        variance_px2 = marker_variances_px2(grid, state.model_std_px)
        weight = self.outlier_gate(
            measured_px - state.shape.displacement_px,
            np.sqrt(variance_px2),
            grid.is_seen,
            state.neighbours.index,
        )
        return np.asarray((weight / variance_px2)[:, None, None] * np.eye(2))

    def _clusters(self, state: MechanicsState, fit: Fit, noise: float) -> tuple[Clusters, Scalars]:
        """Force clusters that noise does not explain, and their normal forces in standard deviations (c,)."""
        model = state.model
        unit_mm2 = model.lattice.force_unit_mm2
        force_mm2 = np.where(model.is_excluded[:, None] | ~model.patch.is_free, 0.0, fit.shape.force_mm2)
        rules, negligible = self.contact_rules, self.gauss_newton.negligible_force
        hidden_mm2 = rules.noise_share * (noise - 1.0) * negligible * unit_mm2
        force_mm2 = np.where(force_mm2[:, 2:] > -hidden_mm2, 0.0, force_mm2)
        clusters = self.force_clusters(model.lattice, force_mm2)
        held_mm = np.array([contact.centre_mm for contact in state.tracks.touching]).reshape(-1, 2)
        clusters = self.model_order(
            model.lattice,
            force_mm2,
            clusters,
            held_mm,
            evidence_at=lambda node: evidence_at(model, fit, node),
            noise=noise,
        )
        inside = clusters.label == np.arange(len(clusters))[:, None]
        significance = clusters.normal_mm2 / fit.posterior.force_std(inside.astype(np.float64), 2)
        chosen = np.flatnonzero(significance >= rules.last_stds)
        return clusters.select(chosen), significance[chosen]

    def _may_start(self, state: MechanicsState, clusters: Clusters) -> Mask:
        model = state.model
        gate_mm = self.contact_tracker.gate_pitch * model.pitch_mm
        return self.contact_rules.may_start(
            model.lattice,
            clusters,
            is_far_from(clusters, state.previous_mm, gate_mm),
            least_mm2=self.force_clusters.min_force * model.lattice.force_unit_mm2,
            thickness_mm=model.thickness_mm,
        )

    def _track(
        self,
        state: MechanicsState,
        clusters: Clusters,
        fit: Fit,
        *,
        may_start: Mask,
        noise: float,
        status: Status,
    ) -> tuple[MechanicsState, Contacts]:
        """Contacts with identities and slip, and the state that contains them."""
        model = state.model
        least_mm2 = noise * self.force_clusters.min_force * model.lattice.force_unit_mm2
        found = self.contact_estimator(model, clusters, fit)
        tracks, contacts = self.contact_tracker.step(
            state.tracks,
            found,
            may_start=may_start.tolist(),
            is_loaded=lambda place_mm: has_force_near(
                model.lattice,
                fit.shape.force_mm2,
                place_mm,
                radius_mm=model.pitch_mm,
                least_mm2=least_mm2,
            ),
            status=status,
        )
        slip, contacts = self.slip_detector(state.slip, contacts, model.pitch_mm)
        previous_mm = read_only(np.array([contact.centre_mm for contact in found]).reshape(-1, 2))
        return replace(state, tracks=tracks, slip=slip, previous_mm=previous_mm), contacts

    def _find_uncalibrated(
        self, uncalibrated: tuple[MarkerGeometry, Any], grid: TrackedGrid
    ) -> tuple[tuple[MarkerGeometry, Any], Contacts]:
        """Contacts of a sheet that was assumed, without forces."""
        geometry, finder_state = uncalibrated
        motion = self.marker_surface(geometry, grid)
        finder_state, contacts = self.uncalibrated_contact_finder.step(finder_state, grid, motion)
        return (geometry, finder_state), contacts

    def _step_uncalibrated(
        self,
        state: MechanicsState,
        uncalibrated: tuple[MarkerGeometry, Any],
        grid: TrackedGrid,
        fit: Fit,
        surface: Surface,
    ) -> tuple[MechanicsState, Surface, Contacts]:
        """Contacts by the swelling of dots, with forces over E from the shape."""
        model = state.model
        uncalibrated, contacts = self._find_uncalibrated(uncalibrated, grid)
        contacts = with_forces(
            contacts,
            model.patch.place_mm,
            fit.shape.force_mm2 if fit.status == "ok" else np.zeros_like(fit.shape.force_mm2),
            reach_mm=self.own_force_pitch * model.pitch_mm,
            least_mm2=self.force_clusters.min_force * model.lattice.force_unit_mm2,
        )
        if surface.status == "ok" and not self.uncalibrated_contact_finder.is_touched(uncalibrated[1]):
            state = self._update_reference(state, grid)
        return replace(state, uncalibrated=uncalibrated), surface, contacts

    def _update_reference(self, state: MechanicsState, grid: TrackedGrid) -> MechanicsState:
        reference_px = self.reference_drift(
            state.reference_px, state.initial_reference_px, grid, state.pitch_px
        )
        return replace(state, reference_px=reference_px)

    def _step_without_markers(
        self, state: MechanicsState, grid: TrackedGrid
    ) -> tuple[MechanicsState, Surface, Contacts]:
        """A frame with too few markers: no surface, and contacts that wait."""
        status = Status.FEW_MARKERS if grid.status is Status.OK else grid.status
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
        tracks, contacts = self.contact_tracker.step(state.tracks, (), status=status)
        return replace(state, tracks=tracks), surface, contacts

    def _surface(
        self, state: MechanicsState, grid: TrackedGrid, fit: Fit, clusters: Clusters, status: Status
    ) -> Surface:
        model, shape = state.model, fit.shape
        displacement_mm = model.dots.displacement_mm(shape.coefficient_mm)
        place_mm = model.dots.face.point_mm
        displacement_mm[:, 2] -= self.solid_correction.depth_under_contacts(model, clusters, place_mm)
        displacement_mm[:, 2] -= self.solid_correction.depth_along_clamp(model, shape.coefficient_mm)
        covariance_mm2 = self.surface_error(
            model,
            state.deviation,
            displacement_mm,
            shape.force_mm2,
            grid.is_seen,
            std_px=self.marker_noise.frame_std_px(grid, state.model_std_px),
        )
        return Surface(
            position_mm=read_only(model.layout.rest_mm + displacement_mm),
            displacement_mm=read_only(displacement_mm),
            covariance_mm2=read_only(covariance_mm2),
            layout=model.layout,
            spline=model.spline(shape.coefficient_mm, shape.force_mm2),
            status=status,
        )
