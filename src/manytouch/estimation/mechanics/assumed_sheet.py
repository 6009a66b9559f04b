"""Frames of a sheet that was assumed: whether it describes them, and what is known where it does not.

The outline, the thickness and the pretension of an assumed sheet differ from the true ones, so that its
marker images differ by a share of the motion of the markers; a pad bonded to a window, or a sheet that is
drawn in from beyond the view, differs by much more. Such frames have the surface and the contacts of
`perimeter`, without forces.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from manytouch.estimation.contact_finder import ContactFinder
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.perimeter.marker_surface import MarkerGeometry, MarkerSurface
from manytouch.estimation.uncalibrated.swelling_load import uncalibrated_contact_finder
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
    """

    geometry: MarkerGeometry
    finder_state: Any
    surface: Surface | None = None
    touching: tuple[Contact, ...] = ()
    is_touched: bool = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AssumedSheetRules:
    """Parameters of the frames of an assumed sheet.

    Attributes:
        marker_surface: depth of the markers without a model of the sheet.
        contact_finder: finds contacts without one.
        model_share: standard deviation of a marker image by the wrong parameters of the sheet, over the RMS
            motion of the markers in this frame.
        most_misfit: largest RMS residual of a sheet that is described, over the RMS motion of the markers.
        misfit_pitch: residuals below this are no misfit, in pitches.
    """

    marker_surface: MarkerSurface = field(default_factory=MarkerSurface)
    contact_finder: ContactFinder = field(default_factory=uncalibrated_contact_finder)
    model_share: float = 0.005
    most_misfit: float = 0.07
    misfit_pitch: float = 0.003

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

    def model_std_px(self, grid: TrackedGrid, reference_px: Points2, model_std_px: float) -> float:
        """Standard deviation of a marker image that the assumed sheet does not explain in a frame."""
        return float(np.hypot(model_std_px, self.model_share * _rms(grid.position_px - reference_px, grid)))

    def describes(self, fit: Fit, grid: TrackedGrid, reference_px: Points2, pitch_px: float) -> bool:
        """Does the assumed sheet describe the frame?"""
        if fit.status is not Status.OK:
            return False
        moved_px = _rms(grid.position_px - reference_px, grid)
        return _rms(fit.residual_px, grid) <= max(self.most_misfit * moved_px, self.misfit_pitch * pitch_px)


def _rms(change_px: Points2, grid: TrackedGrid) -> float:
    """Root mean square of the lengths of vectors (m, 2) of the seen markers."""
    return float(np.sqrt(np.square(change_px[grid.is_seen]).sum(axis=1).mean()))
