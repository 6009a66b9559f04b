"""What the method `mechanics` keeps from frame to frame."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.contact_tracker import ContactTrackerState
from manytouch.estimation.frame_interval import USUAL_S, interval_s
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters, EarlierClusters, PreviousContacts
from manytouch.estimation.mechanics.clusters.local_deflection import LocalDeflection
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.inversion.sheet_parameters import (
    ParameterResponse,
    PretensionEstimate,
    SheetVariant,
)
from manytouch.estimation.mechanics.inversion.sheet_shape import SheetShape
from manytouch.estimation.mechanics.surface_covariance import (
    DisplacementCovariance,
    DisplacementCovarianceState,
)
from manytouch.estimation.mechanics.undescribed_frames import WithoutSheet
from manytouch.estimation.reference_drift import ReferenceDrift
from manytouch.estimation.slip_detector import SlipState
from manytouch.geometry.neighbours import Neighbours
from manytouch.mechanics.solver.posterior import Posterior
from manytouch.values import Surface, TrackedGrid
from manytouch.values.arrays import Mask, Points2, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MechanicsState:
    """What stays the same between frames, and what a frame passes to the next one.

    Attributes:
        model: of the sheet.
        neighbours: of each marker.
        displacement_covariance: what the covariances of marker displacements have in common in all frames.
        local: depth under narrow loads that the elements are too coarse to show.
        is_at_clamp: (m,) markers that are so near the clamp that they show the motion of the view.
        initial_reference_px, reference_px: (m, 2) marker images at rest, at the start and now.
        pitch_px: pitch in the image.
        model_std_px: standard deviation of a marker image by the errors of model and rest position.
        excess_px2: variance of the marker images that their detection does not know of, along an axis.
        shape: of the previous frame.
        posterior: of the last frame with a full or a reweighted step; None before the first.
        posterior_frames: number of frames since then.
        posterior_worst_chi2: `Fit.worst_chi2` of the last full step.
        pretension: of the sheet.
        variants: the sheet with one of its other parameters changed, for each of them.
        response: how the result of the last full step depends on pretension and other parameters; None before
            the first full step.
        response_is_due: whether the response of a later full step still has to be computed.
        previous: clusters of the previous frame, whether they were contacts or not.
        earlier_mm2: (nodes,) normal forces over E of earlier frames, see `KeptForces`.
        rest_cost: see `BodyForceEstimator.rest_cost`.
        slip: state of the detection of slip.
        tracks: contacts of the previous frames.
        without_sheet: surface and contacts without a model of the sheet.
        undescribed: number of frames in a row that the sheet did not describe.
        unlike: the same, without those in which the markers hardly moved.
        timestamp_ns: time of the last frame; None: not known, or there was none.
        elapsed_s: time between that frame and the one before.
    """

    model: InversionModel
    neighbours: Neighbours
    displacement_covariance: DisplacementCovarianceState
    local: LocalDeflection
    is_at_clamp: Mask
    initial_reference_px: Points2
    reference_px: Points2
    pitch_px: float
    model_std_px: float
    excess_px2: float = 0.0
    shape: SheetShape
    posterior: Posterior | None = None
    posterior_frames: int = 0
    posterior_worst_chi2: float = 0.0
    pretension: PretensionEstimate
    variants: tuple[SheetVariant, ...]
    response: ParameterResponse | None = None
    response_is_due: bool = False
    previous: EarlierClusters
    earlier_mm2: Float64[np.ndarray, " nodes"]
    rest_cost: float = float("nan")
    slip: SlipState
    tracks: ContactTrackerState
    without_sheet: WithoutSheet
    undescribed: int = 0
    unlike: int = 0
    timestamp_ns: int | None = None
    elapsed_s: float = USUAL_S

    @property
    def touching_mm(self) -> Points2:
        """(k, 2) centres of the contacts of the previous frame."""
        return np.array([contact.centre_mm for contact in self.tracks.touching]).reshape(-1, 2)

    def previous_contacts(self, least: float) -> PreviousContacts:
        """The contacts of the previous frame whose normal force is at least so many least forces."""
        forces_mm2 = [contact.normal_force_over_E_mm2 for contact in self.tracks.touching]
        normal_mm2 = np.array(forces_mm2, dtype=np.float64)
        is_chosen = ~(normal_mm2 < least * self.model.nodes.least_force_mm2)
        return PreviousContacts(
            centre_mm=self.touching_mm[is_chosen],
            normal_mm2=normal_mm2[is_chosen],
            age_s=self.tracks.touching_s[is_chosen] + self.elapsed_s,
        )

    def with_fit(self, fit: Fit) -> "MechanicsState":
        """The state after a fit."""
        frames = self.posterior_frames + 1 if fit.posterior is self.posterior else 0
        worst_chi2 = fit.worst_chi2 if fit.steps > 0 else self.posterior_worst_chi2
        return replace(
            self,
            shape=fit.shape,
            posterior=fit.posterior,
            posterior_frames=frames,
            posterior_worst_chi2=worst_chi2,
        )

    def at_rest(self) -> "MechanicsState":
        """The state from which the next fit begins at rest.

        A fit that begins with a shape that failed may fail again.
        """
        rest = SheetShape.at_rest(self.model, self.shape.body_force)
        state = replace(self, shape=rest, posterior=None, posterior_frames=0)
        return replace(state, response=None, response_is_due=False)

    def at_time(self, timestamp_ns: int | None) -> "MechanicsState":
        """The state in which the frame of this time begins."""
        elapsed_s = interval_s(self.timestamp_ns, timestamp_ns)
        return replace(self, timestamp_ns=timestamp_ns, elapsed_s=elapsed_s)

    def with_drift(self, drift: ReferenceDrift, grid: TrackedGrid) -> "MechanicsState":
        """The state with the reference that follows a frame in which nothing touches the sheet."""
        before_px, first_px = self.reference_px, self.initial_reference_px
        reference_px = drift(before_px, first_px, grid, self.pitch_px, elapsed_s=self.elapsed_s)
        return replace(self, reference_px=reference_px)

    def surface(
        self,
        error: DisplacementCovariance,
        grid: TrackedGrid,
        shape: SheetShape,
        clusters: Clusters,
        std_px: float,
    ) -> Surface:
        """Positions of the markers of a frame with a shape; `std_px` is that of the marker images."""
        model = self.model
        displacement_mm = model.dots.displacement_mm(shape.coefficient_mm)
        displacement_mm[:, 2] -= self.local.depth_mm(clusters, model.dots.face.point_mm)
        covariance_mm2 = error(
            model,
            self.displacement_covariance,
            displacement_mm,
            shape.force_mm2,
            grid.is_seen,
            std_px=std_px,
        )
        return Surface(
            position_mm=read_only(model.layout.rest_mm + displacement_mm),
            displacement_mm=read_only(displacement_mm),
            covariance_mm2=read_only(covariance_mm2),
            layout=model.layout,
            spline=model.spline(
                shape.coefficient_mm,
                shape.force_mm2,
                self.pretension.std_mm,
            ),
            status=grid.status,
        )
