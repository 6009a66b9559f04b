"""Frames that the sheet does not describe, and what is known of them.

The outline, the thickness and the pretension of an assumed sheet differ from the true ones, so that its
marker images differ by a share of the motion of the markers; a pad bonded to a window, or a sheet that is
drawn in from beyond the view, differs by much more. So does a sheet that is not that of the sensor file. Such
frames have the surface and the contacts of `perimeter`, without forces. An assumed sheet
that did not describe a frame must be shown again by one: while little moves, a pad looks like a sheet.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from manytouch.estimation.contact_finder import ContactFinder
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.perimeter.marker_surface import MarkerGeometry, MarkerSurface
from manytouch.estimation.uncalibrated.swelling_load import uncalibrated_contact_finder
from manytouch.geometry.neighbours import Neighbours
from manytouch.values import Contact, Sensor, Status, Surface, TrackedGrid
from manytouch.values.arrays import Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WithoutSheet:
    """What the markers show without a model of the sheet, and its state between frames.

    Attributes:
        geometry: of the markers.
        finder_state: of the contact finder.
        surface: of this frame; None before the first and where too few markers are seen.
        touching: contacts of this frame; their forces are not known.
        is_touched: whether anything may touch the sheet.
        frames_at_rest: number of frames in which nothing touched a known sheet that described them.
    """

    geometry: MarkerGeometry
    finder_state: Any
    surface: Surface | None = None
    touching: tuple[Contact, ...] = ()
    is_touched: bool = False
    frames_at_rest: int = 0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class UndescribedFrames:
    """Parameters of the frames that the sheet does not describe.

    Attributes:
        marker_surface: depth of the markers without a model of the sheet.
        contact_finder: finds contacts without one.
        least_inner: an assumed sheet with fewer markers two pitches inside the outermost ones describes no
            frame: forces beyond few markers explain any motion.
        model_share: standard deviation of a marker image by the wrong parameters of the sheet, over the RMS
            motion of the markers in this frame.
        most_misfit: largest RMS residual of a sheet that is described, over the RMS motion of the markers.
        doubtful_misfit: the same of an assumed sheet that does not show the contact of the frame before,
            which the markers without a sheet show. Chosen on one recording of a real sheet (ADR 173).
        misfit_pitch: residuals below this are no misfit, in pitches.
        light_misfit: largest RMS residual that noise does not explain, over the RMS motion, where an assumed
            sheet moves little. Presses on 39 simulated sheets have .07 to .17 at best, those on 16 pads .2
            or more.
        unlike_frames, unlike_misfit: after so many pressed frames in a row that an assumed sheet does not
            describe, its largest RMS residual is this share of the RMS motion: it is hardly a sheet.
            Chosen on the same recording.
        noise_stds: noise explains an RMS residual of this many deviations of the positions of the markers.
        most_chi2: least mean square of residuals over their deviation that is a misfit of a known sheet; the
            varied cases, with drawn sensor files too, have 5 at most.
        wait_frames: number of frames in a row that a known sheet may not describe before `perimeter` is used;
            tracking may have failed in them.
        retry_frames: after these, as many in each group of this number of frames are fitted.
        rest_frames, rest_interval: the dots at rest are observed in the first `rest_frames` frames in which a
            known sheet is not touched, and then once in `rest_interval`, because it takes time.
        moved_stds: least RMS motion of the markers, over its deviation, of a frame that may show an assumed
            sheet again.
        most_rough: largest RMS difference of the motions of a marker and of its nearest neighbour, over the
            RMS motion, that a sheet has; above it tracking has failed, and contacts wait.
    """

    marker_surface: MarkerSurface = field(default_factory=MarkerSurface)
    contact_finder: ContactFinder = field(default_factory=uncalibrated_contact_finder)
    least_inner: int = 12
    model_share: float = 0.005
    most_misfit: float = 0.07
    doubtful_misfit: float = 0.035
    misfit_pitch: float = 0.003
    light_misfit: float = 0.2
    unlike_frames: int = 20
    unlike_misfit: float = 0.02
    noise_stds: float = 1.5
    most_chi2: float = 10.0
    wait_frames: int = 5
    retry_frames: int = 15
    rest_frames: int = 15
    rest_interval: int = 10
    moved_stds: float = 3.0
    most_rough: float = 0.7

    def start(self, sensor: Sensor) -> WithoutSheet:
        """The state before the first frame."""
        return WithoutSheet(
            geometry=self.marker_surface.start(sensor), finder_state=self.contact_finder.start(sensor)
        )

    def step(self, before: WithoutSheet, grid: TrackedGrid) -> WithoutSheet:
        """Surface and contacts of the next frame without a model of the sheet."""
        motion = self.marker_surface(before.geometry, grid)
        finder_state, contacts = self.contact_finder.step(before.finder_state, grid, motion)
        return replace(
            before,
            finder_state=finder_state,
            surface=None if motion is None else motion.surface,
            touching=contacts.touching,
            is_touched=self.contact_finder.is_touched(finder_state),
        )

    def at_rest(self, model: InversionModel, before: WithoutSheet, grid: TrackedGrid) -> WithoutSheet:
        """The state after a frame that the sheet describes, and in which nothing touches it.

        What follows is compared with the dots at rest, which must not be those of the first frame that the
        sheet does not describe: something touches it there. With an assumed sheet each frame is observed
        anyway.
        """
        if model.is_assumed:
            return before
        count = before.frames_at_rest
        is_observed = count < self.rest_frames or count % self.rest_interval == 0
        return replace(self.step(before, grid) if is_observed else before, frames_at_rest=count + 1)

    def model_std_px(
        self, model: InversionModel, grid: TrackedGrid, reference_px: Points2, model_std_px: float
    ) -> float:
        """Standard deviation of a marker image that the sheet does not explain in a frame."""
        if not model.is_assumed:
            return model_std_px
        return float(np.hypot(model_std_px, self.model_share * _rms(grid.position_px - reference_px, grid)))

    def is_fitted(
        self, model: InversionModel, undescribed: int, grid: TrackedGrid, reference_px: Points2
    ) -> bool:
        """Whether the next frame is fitted, after so many in a row that the sheet did not describe.

        Motion that is mostly noise does not show an assumed sheet.
        """
        if not model.is_assumed:
            return undescribed % self.retry_frames < self.wait_frames
        if model.inner_markers < self.least_inner:
            return False
        if undescribed == 0:
            return True
        return _rms(grid.position_px - reference_px, grid) > self.moved_stds * _noise_px(grid)

    def is_torn(self, grid: TrackedGrid, reference_px: Points2, neighbours: Neighbours) -> bool:
        """Whether neighbours move so differently that the markers are not those of one sheet."""
        motion_px, nearest = grid.position_px - reference_px, neighbours.index[:, 0]
        both = grid.is_seen & grid.is_seen[nearest]
        rough_px = motion_px[both] - motion_px[nearest[both]]
        return bool(np.square(rough_px).sum() > self.most_rough**2 * np.square(motion_px[both]).sum())

    def describes(
        self,
        model: InversionModel,
        fit: Fit,
        grid: TrackedGrid,
        reference_px: Points2,
        pitch_px: float,
    ) -> bool:
        """Whether the sheet describes the frame."""
        if fit.status is not Status.OK:
            return False
        if not model.is_assumed and fit.chi2 <= self.most_chi2:
            return True
        moved_px, misfit_px = _rms(grid.position_px - reference_px, grid), _rms(fit.residual_px, grid)
        if misfit_px > max(self.most_misfit * moved_px, self.misfit_pitch * pitch_px):
            return False
        if not model.is_assumed:
            return True
        return misfit_px <= float(np.hypot(self.noise_stds * _noise_px(grid), self.light_misfit * moved_px))

    def is_doubtful(
        self, fit: Fit, found: WithoutSheet, grid: TrackedGrid, reference_px: Points2, pitch_px: float
    ) -> bool:
        """Whether an assumed sheet that shows no contact is not to be trusted in that."""
        moved_px, misfit_px = _rms(grid.position_px - reference_px, grid), _rms(fit.residual_px, grid)
        least_px = max(self.doubtful_misfit * moved_px, self.misfit_pitch * pitch_px)
        return len(found.touching) > 0 and misfit_px > least_px

    def shows(self, model: InversionModel, fit: Fit, grid: TrackedGrid, unlike: int) -> bool:
        """Whether a frame that the sheet describes is evidence of it; a known sheet needs none.

        `unlike` is that of `MechanicsState`.
        """
        moved_px = _rms(fit.shape.displacement_px, grid)
        most = self.light_misfit if unlike < self.unlike_frames else self.unlike_misfit
        return not model.is_assumed or _rms(fit.residual_px, grid) <= most * moved_px

    def may_last(self, model: InversionModel, undescribed: int) -> Callable[[Contact], bool] | None:
        """Whether a contact may last that a frame without a model of the sheet does not show.

        Any one (None) in the first of such frames, after so many in a row that the sheet did not describe;
        later none: the contact finder has waited already.
        """
        return None if undescribed <= (0 if model.is_assumed else self.wait_frames) else _has_ended


def _has_ended(_contact: Contact) -> bool:
    return False


def _rms(change_px: Points2, grid: TrackedGrid) -> float:
    """Root mean square of the lengths of vectors (m, 2) of the seen markers."""
    return float(np.sqrt(np.square(change_px[grid.is_seen]).sum(axis=1).mean()))


def _noise_px(grid: TrackedGrid) -> float:
    """Root mean square of the deviations of the positions of the seen markers, as lengths."""
    return float(np.sqrt(np.trace(grid.covariance_px2[grid.is_seen], axis1=1, axis2=2).mean()))
