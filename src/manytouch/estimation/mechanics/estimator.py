"""The method `mechanics`: depth, contacts and forces from one inversion of the sheet's mechanics.

`GaussNewton` fits the shape of the sheet that explains the marker images with few, compressive forces. Depth
is that of the shape, contacts are clusters of its nodal forces, standard deviations come from the last step
and the error of the model. What the sheet does not describe is estimated by `perimeter`.
"""

from dataclasses import dataclass, field, replace
from itertools import compress
from typing import Any

import numpy as np

from manytouch.blas_threads import limit_blas_threads
from manytouch.errors import SensorError
from manytouch.estimation.bonded_protocol import BondedEstimator
from manytouch.estimation.contact_tracker import ContactTracker
from manytouch.estimation.excess_noise import ExcessNoise
from manytouch.estimation.mechanics import sheet_updates
from manytouch.estimation.mechanics.clusters.evidence import ForcePosterior
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters, EarlierClusters, ForceClusters
from manytouch.estimation.mechanics.clusters.friction_fits import Friction, FrictionFits
from manytouch.estimation.mechanics.clusters.local_deflection import local_deflection
from manytouch.estimation.mechanics.clusters.model_order import ModelOrder
from manytouch.estimation.mechanics.clusters.rigid_faces import RigidFaces
from manytouch.estimation.mechanics.contact_pressures import with_contact_pressures
from manytouch.estimation.mechanics.contact_rules import ContactRules, is_far_from, significant
from manytouch.estimation.mechanics.contacts import ContactEstimator
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit, GaussNewton
from manytouch.estimation.mechanics.inversion.sheet_model import MIN_MARKERS, NominalSheet, checked_layout
from manytouch.estimation.mechanics.inversion.sheet_parameters import (
    PretensionEstimator,
    sheet_variants,
)
from manytouch.estimation.mechanics.inversion.sheet_shape import SheetShape
from manytouch.estimation.mechanics.kept_forces import KeptForces
from manytouch.estimation.mechanics.marker_noise import MarkerNoise, marker_variances_px2, with_excess
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.estimation.mechanics.surface_covariance import DisplacementCovariance
from manytouch.estimation.mechanics.undescribed_frames import UndescribedFrames
from manytouch.estimation.mechanics.view_motion import ViewMotion
from manytouch.estimation.outlier_gate import OutlierGate
from manytouch.estimation.perimeter.marker_surface import unknown_surface
from manytouch.estimation.reference_drift import ReferenceDrift
from manytouch.estimation.slip_detector import SlipDetector, SlipState
from manytouch.geometry.camera import mm_per_px
from manytouch.geometry.neighbours import nearest_neighbours
from manytouch.geometry.refraction import rest_px
from manytouch.values import Contacts, Layout, Sensor, Sheet, Status, Surface, TrackedGrid
from manytouch.values.arrays import Covariances2, Mask, Points2, read_only
from manytouch.values.sensor_file.assumed_sheet import assumed_sheet


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MechanicsEstimator:
    """Shape, contacts and forces by mechanics.

    Attributes:
        nominal_sheet: properties of a sheet that the sensor does not state.
        marker_noise: standard deviations of marker images.
        excess_noise: noise that the detection of markers does not know of.
        outlier_gate: weights of the markers.
        view_motion: motion of the whole image.
        gauss_newton: the inversion.
        force_clusters: groups of nodal forces.
        model_order: number and centres of the contacts in a group.
        rigid_faces: joins groups under one rigid object.
        friction_fits: shear of the contacts without the reduction by the prior.
        contact_rules: which groups are contacts.
        kept_forces: what the sheet may keep of earlier presses.
        contact_estimator: contacts with their covariances.
        pretension: estimate of a pretension that the sensor does not state.
        contact_tracker: identities of contacts.
        surface_error: covariances of the marker displacements.
        reference_drift: update of the reference while nothing touches the sheet.
        slip_detector: flags contacts that slide.
        undescribed_frames: those that the sheet does not describe.
        pad: the estimator of sheets with boundary = "bonded"; None refuses them.
    """

    nominal_sheet: NominalSheet = field(default_factory=NominalSheet)
    marker_noise: MarkerNoise = field(default_factory=MarkerNoise)
    excess_noise: ExcessNoise = field(default_factory=ExcessNoise)
    outlier_gate: OutlierGate = field(default_factory=OutlierGate)
    view_motion: ViewMotion = field(default_factory=ViewMotion)
    gauss_newton: GaussNewton = field(default_factory=GaussNewton)
    force_clusters: ForceClusters = field(default_factory=ForceClusters)
    model_order: ModelOrder = field(default_factory=ModelOrder)
    rigid_faces: RigidFaces = field(default_factory=RigidFaces)
    friction_fits: FrictionFits = field(default_factory=FrictionFits)
    contact_rules: ContactRules = field(default_factory=ContactRules)
    kept_forces: KeptForces = field(default_factory=KeptForces)
    contact_estimator: ContactEstimator = field(default_factory=ContactEstimator)
    pretension: PretensionEstimator = field(default_factory=PretensionEstimator)
    contact_tracker: ContactTracker = field(default_factory=lambda: ContactTracker(confirm_frames=1))
    surface_error: DisplacementCovariance = field(default_factory=DisplacementCovariance)
    reference_drift: ReferenceDrift = field(default_factory=ReferenceDrift)
    slip_detector: SlipDetector = field(default_factory=SlipDetector)
    undescribed_frames: UndescribedFrames = field(default_factory=UndescribedFrames)
    pad: BondedEstimator | None = None

    def start(self, sensor: Sensor) -> Any:
        """The `MechanicsState` before the first frame, or the state of `pad`; limits BLAS to one thread.

        Raises:
            SensorError: the sensor has no layout, or its sheet is bonded and `pad` is None.
            LayoutError: it has too few markers.
        """
        limit_blas_threads()
        layout = checked_layout(sensor)
        sheet = assumed_sheet(layout) if sensor.sheet is None else sensor.sheet
        if sheet.boundary == "bonded":
            if self.pad is None:
                raise SensorError(
                    f'the sheet of sensor {sensor.name!r} is a pad with boundary = "bonded": use '
                    "MechanicsEstimator(pad=PadEstimator()), or the method perimeter or paper"
                )
            return self.pad.start(sensor)
        return self._start(sensor, sheet, layout)

    def _start(self, sensor: Sensor, sheet: Sheet, layout: Layout) -> MechanicsState:
        """The state before the first frame on a sheet that is not bonded."""
        pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
        pitch_px = pitch_mm / mm_per_px(sensor.camera)
        model_std_px = self.marker_noise.constant_std_px(pitch_px, pitch_mm / sheet.thickness_mm, sensor)
        usual_std_px = self.marker_noise.usual_std_px(model_std_px)
        model = self.nominal_sheet(replace(sensor, sheet=sheet), usual_std_px)
        pretension = self.pretension.start(model, sheet)
        if pretension.is_estimated:
            model = model.with_pretension(pretension.mean_mm)
        at_rest_px, shape = rest_px(sensor, layout), SheetShape.at_rest(model)
        weight_per_mm4 = self.gauss_newton.weights(model, shape, usual_std_px=usual_std_px)
        centre_noise_px = sensor.centre_noise_px or self.marker_noise.default_centre_noise_px
        std_px = float(np.hypot(model_std_px, centre_noise_px))
        return MechanicsState(
            model=model,
            neighbours=nearest_neighbours(layout.rest_mm[:, :2]),
            displacement_covariance=self.surface_error.start(model, weight_per_mm4, std_px),
            local=local_deflection(model.shell),
            is_at_clamp=read_only(self.view_motion.is_used(model)),
            initial_reference_px=read_only(at_rest_px.copy()),
            reference_px=read_only(at_rest_px.copy()),
            pitch_px=pitch_px,
            model_std_px=model_std_px,
            shape=shape,
            pretension=pretension,
            variants=sheet_variants(model, sheet),
            previous=EarlierClusters.none(),
            earlier_mm2=read_only(np.zeros(model.patch.node_count)),
            slip=SlipState(),
            tracks=self.contact_tracker.start(sensor),
            without_sheet=self.undescribed_frames.start(sensor),
        )

    def step(self, state: Any, grid: TrackedGrid) -> tuple[Any, Surface, Contacts]:
        """Surface and contacts of the next frame. It never raises; an unusable frame has a status."""
        if self.pad is not None and not isinstance(state, MechanicsState):
            return self.pad.step(state, grid)
        state = state.at_time(grid.timestamp_ns)
        model, rules = state.model, self.undescribed_frames
        if model.is_assumed:
            state = replace(state, without_sheet=rules.step(state.without_sheet, grid))
        if grid.is_seen.sum() < MIN_MARKERS:
            return self._step_unusable(state, grid, Status.FEW_MARKERS)
        if not rules.is_fitted(model, state.undescribed, grid, state.reference_px):
            return self._step_undescribed(state.at_rest(), grid)
        std_px = rules.model_std_px(model, grid, state.reference_px, state.model_std_px)
        grid = with_excess(grid, state.excess_px2)
        fitted_from = replace(state, model_std_px=std_px)
        fit = self._with_body_force(fitted_from, grid, self.fit_frame(fitted_from, grid))
        residuals = fit.residual_px, self.marker_noise.rough_px2(grid, std_px), grid.is_seen, state.neighbours
        excess_px2 = self.excess_noise.after_fit(state.excess_px2, *residuals)
        is_described = rules.describes(model, fit, grid, state.reference_px, state.pitch_px)
        if is_described and (state.undescribed == 0 or rules.shows(model, fit, grid, state.unlike)):
            described = replace(state, undescribed=0, unlike=0, excess_px2=excess_px2)
            after, surface, contacts = self._step_described(described, grid, fit)
            may_be_wrong = model.is_assumed and bool(state.tracks.touching) and not contacts.touching
            at_px, found = (state.reference_px, state.pitch_px), state.without_sheet
            if not (may_be_wrong and rules.is_doubtful(fit, found, grid, *at_px)):
                return after, surface, contacts
            is_described = False
        is_lost = fit.status is not Status.OK or (model.is_assumed and not is_described)
        state = replace(state.at_rest() if is_lost else state.with_fit(fit), unlike=state.unlike + 1)
        if model.is_assumed or state.undescribed >= rules.wait_frames:
            return self._step_undescribed(state, grid)
        waiting = replace(state, undescribed=state.undescribed + 1)
        return self._step_unusable(waiting, grid, Status.NOT_CONVERGED)

    def _step_described(
        self, state: MechanicsState, grid: TrackedGrid, fit: Fit
    ) -> tuple[MechanicsState, Surface, Contacts]:
        """A frame that the sheet describes: its contacts are the clusters of the forces of the fit."""
        model, status, earlier_response = state.model, grid.status, state.response
        noise = self.marker_noise.noise_ratio(grid, state.model_std_px)
        state = sheet_updates.with_response(state, fit)
        forces = ForcePosterior(model, fit)
        clusters = self._clusters(state, fit, forces, noise=noise)
        shape = forces.unbiased_shape(clusters.fitted_mm2)
        clusters = self.rigid_faces(
            model,
            shape.coefficient_mm,
            clusters,
            forces.evidence,
            state.previous_contacts(self.contact_rules.decided_force),
            earlier=state.previous,
        )
        clusters, stds = self.contact_rules.certain(model, clusters, fit, state.response, state.touching_mm)
        kept_std_mm2 = self.kept_forces.std_mm2(model.nodes, clusters, state.earlier_mm2)
        clusters = clusters.with_force_std(kept_std_mm2)
        friction = self.friction_fits(fit, clusters, shape.force_mm2)
        if friction is not None:
            shape = shape.moved(model, friction.change_mm, friction.force_change_mm2)
            clusters = replace(clusters, centre_mm=clusters.centre_mm + friction.centre_change_mm)
        std_px = self.marker_noise.frame_std_px(grid, state.model_std_px)
        surface = state.surface(self.surface_error, grid, shape, clusters, std_px)
        may_start = self._may_start(state, clusters, fit) & (stds >= self.contact_rules.start_stds)
        after, contacts = self._track(
            state.with_fit(fit),
            clusters,
            replace(fit, shape=shape),
            friction,
            may_start=may_start,
            noise=noise,
            status=status,
        )
        if status is Status.OK and not after.tracks.tracks and not may_start.any():
            after = after.with_drift(self.reference_drift, grid)
            at_rest = self.undescribed_frames.at_rest(model, after.without_sheet, grid)
            rest_cost = self.gauss_newton.body_force.rest_cost(after.rest_cost, fit.force_cost)
            after = replace(after, without_sheet=at_rest, rest_cost=rest_cost)
        if state.response is not earlier_response and status is Status.OK and contacts.touching:
            after = sheet_updates.with_pretension(after, self.pretension, fit, clusters)
        return after, with_contact_pressures(surface, model.nodes, clusters, contacts), contacts

    def _with_body_force(self, state: MechanicsState, grid: TrackedGrid, fit: Fit) -> Fit:
        """The fit, or that with a body force if nothing has touched the sheet for long and this explains it.

        Args:
            state: before the frame.
            grid: of the frame.
            fit: without a body force.
        """
        estimator, ages_s = self.gauss_newton.body_force, state.tracks.touching_s + state.elapsed_s
        if state.shape.body_force is not None or ages_s.max(initial=0.0) > estimator.most_s:
            return fit
        body_force = estimator.first(
            state.model,
            fit.posterior,
            fit.shape,
            fit.balance_mm2,
            rest_cost=float(np.nan_to_num(state.rest_cost)),
            is_touched=bool(state.tracks.tracks),
        )
        if body_force is None:
            return fit
        state = replace(state.with_fit(fit), shape=replace(fit.shape, body_force=body_force))
        for _ in range(estimator.first_steps):
            found = self.fit_frame(state, grid)
            if found.status is not Status.OK:
                return fit
            state = state.with_fit(found)
        left_mm2 = -float(found.shape.force_mm2[:, 2].min())
        negligible_mm2 = self.gauss_newton.negligible_force * found.force_unit_mm2
        return found if left_mm2 <= estimator.most_left * negligible_mm2 else fit

    def _measured_px(self, state: MechanicsState, grid: TrackedGrid) -> Points2:
        """(m, 2) displacements of the marker images without the motion of the views; 0 where not seen."""
        measured_px = np.where(grid.is_seen[:, None], grid.position_px - state.reference_px, 0.0)
        shape_px, is_used = state.shape.displacement_px, state.is_at_clamp & grid.is_seen
        for chosen in state.model.dots.part_of_views:
            measured_px[chosen] -= self.view_motion(
                state.initial_reference_px[chosen], measured_px[chosen], shape_px[chosen], is_used[chosen]
            )
        return measured_px

    def fit_frame(self, state: MechanicsState, grid: TrackedGrid) -> Fit:
        """The shape of the sheet in the next frame."""
        measured_px = self._measured_px(state, grid)
        return self.gauss_newton(
            state.model,
            state.shape,
            measured_px,
            self.information(state, grid, measured_px),
            self.marker_noise.noise_ratio(grid, state.model_std_px),
            usual_std_px=self.marker_noise.usual_std_px(state.model_std_px),
            posterior=state.posterior,
            posterior_frames=state.posterior_frames,
            posterior_worst_chi2=state.posterior_worst_chi2,
            elapsed_s=state.elapsed_s,
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

    def _clusters(self, state: MechanicsState, fit: Fit, forces: ForcePosterior, *, noise: float) -> Clusters:
        """Force clusters that neither noise nor earlier presses explain."""
        model = state.model
        force_mm2 = np.where(model.is_excluded[:, None] | ~model.patch.is_free, 0.0, fit.shape.force_mm2)
        rules, nodes = self.contact_rules, replace(model.nodes, force_unit_mm2=fit.force_unit_mm2)
        hidden = rules.noise_share * (noise - 1.0) * self.gauss_newton.negligible_force
        force_mm2 = np.where(force_mm2[:, 2:] > -hidden * nodes.force_unit_mm2, 0.0, force_mm2)
        beyond_mm2 = -float(fit.shape.force_mm2[nodes.is_beyond, 2].sum())
        clusters = self.force_clusters(nodes, force_mm2, beyond_mm2=beyond_mm2, is_assumed=model.is_assumed)
        clusters, _ = significant(clusters, fit, rules.least_stds)
        decided = state.previous_contacts(rules.decided_force)
        clusters = self.model_order(
            nodes, force_mm2, clusters, decided.centre_mm, evidence_at=forces.evidence, noise=noise
        )
        clusters, _ = significant(clusters, fit, rules.last_stds)
        return self.kept_forces.without_kept(model.nodes, clusters, state.earlier_mm2)

    def _may_start(self, state: MechanicsState, clusters: Clusters, fit: Fit) -> Mask:
        model, rules = state.model, self.contact_rules
        gate_mm = self.contact_tracker.gate_pitch * model.pitch_mm
        is_new = is_far_from(clusters, state.previous.centre_mm, gate_mm)
        return rules.may_start(model, clusters, fit, is_new, is_response_due=state.response_is_due)

    def _track(
        self,
        state: MechanicsState,
        clusters: Clusters,
        fit: Fit,
        friction: Friction | None,
        *,
        may_start: Mask,
        noise: float,
        status: Status,
    ) -> tuple[MechanicsState, Contacts]:
        """Contacts with identities and slip, and the state that contains them."""
        model = state.model
        is_in_face = np.append(clusters.is_face, False)[clusters.label]
        own_mm2 = np.where(is_in_face[:, None], 0.0, fit.shape.force_mm2)
        found = self.contact_estimator(
            model, clusters, fit, state.local, friction=friction, response=state.response
        )
        is_pressed = np.array([contact.depth_mm > 0.0 for contact in found], dtype=np.bool_)
        found, may_start = list(compress(found, is_pressed)), may_start[is_pressed]
        tracks, contacts = self.contact_tracker.step(
            state.tracks,
            found,
            may_start=may_start.tolist(),
            is_loaded=lambda contact: self.contact_rules.may_last(model, own_mm2, contact, noise),
            status=status,
            elapsed_s=state.elapsed_s,
        )
        slip, contacts = self.slip_detector(state.slip, contacts, model.pitch_mm, elapsed_s=state.elapsed_s)
        reach_mm, chosen = self.rigid_faces.same_centre_pitch * model.pitch_mm, np.flatnonzero(is_pressed)
        nodal_mm2 = fit.shape.force_mm2[:, 2]
        previous = state.previous.followed_by(clusters.select(chosen), nodal_mm2, reach_mm)
        earlier_mm2 = self.kept_forces.after(
            model.nodes, state.earlier_mm2, -nodal_mm2, elapsed_s=state.elapsed_s
        )
        return replace(state, tracks=tracks, slip=slip, previous=previous, earlier_mm2=earlier_mm2), contacts

    def _step_undescribed(
        self, state: MechanicsState, grid: TrackedGrid
    ) -> tuple[MechanicsState, Surface, Contacts]:
        """A frame that the sheet does not describe: surface and contacts are those of `perimeter`."""
        model, found, rules = state.model, state.without_sheet, self.undescribed_frames
        may_last = rules.may_last(model, state.undescribed)
        state = replace(state, undescribed=state.undescribed + 1)
        if not model.is_assumed:
            if rules.is_torn(grid, state.reference_px, state.neighbours):
                return self._step_unusable(state, grid, Status.NOT_CONVERGED)
            found = rules.step(found, grid)
        surface = unknown_surface(model.layout, grid.status) if found.surface is None else found.surface
        tracks, contacts = self.contact_tracker.step(
            state.tracks, found.touching, is_loaded=may_last, status=grid.status, elapsed_s=state.elapsed_s
        )
        after = replace(state, tracks=tracks, without_sheet=found)
        if grid.status is Status.OK and not found.is_touched:
            after = after.with_drift(self.reference_drift, grid)
        return after, surface, contacts

    def _step_unusable(
        self, state: MechanicsState, grid: TrackedGrid, reason: Status
    ) -> tuple[MechanicsState, Surface, Contacts]:
        """A frame with too few markers or whose fit failed: the surface is not known, and contacts wait."""
        status = reason if grid.status is Status.OK else grid.status
        tracks, contacts = self.contact_tracker.step(
            state.tracks, (), status=status, elapsed_s=state.elapsed_s
        )
        return replace(state, tracks=tracks), unknown_surface(state.model.layout, status), contacts
