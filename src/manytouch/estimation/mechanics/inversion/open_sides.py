"""Sides at which an assumed sheet goes on beyond the outermost markers, as an image of a part of it shows.

An assumed sheet is clamped about one pitch beyond its outermost markers. Where it goes on, these markers
move more than such a sheet allows, which only forces along the clamp explain. A press that moves them is
fitted with sheets that go on at one more side. As long as one of these costs clearly less, its side is open.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from manytouch.estimation.mechanics.inversion.searched_press import SearchedPress, SheetTrial, SheetTrials
from manytouch.values import Layout, Sensor, Sheet
from manytouch.values.arrays import Mask, Points2, read_only
from manytouch.values.sensor_file.assumed_sheet import (
    OPEN_MARGIN_PITCHES,
    Sides,
    are_open,
    assumed_sheet,
    margin_pitches,
)

Side = tuple[int, int]
"""Axis (0 for x, 1 for y), and 0 for its side with the lower or 1 for that with the higher coordinates."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SidesOfPress:
    """A press that is searched for open sides.

    Attributes:
        press: the markers, without the motion of the whole image if the sheet explains them better so.
        sensor: with the sheet that explains them best so far.
        log_cost, misfit: of the fit with this sheet (`SheetTrial`); None before it.
        sides: that may be open.
        trials: with each of them open, in this order, as far as they are fitted.
        has_opened: whether any side was opened.
        least_gain: `OpenSides.least_gain`, or `least_gain_if_moved` without that motion.
    """

    press: SearchedPress
    sensor: Sensor
    log_cost: float | None = None
    misfit: float | None = None
    sides: tuple[Side, ...]
    trials: tuple[SheetTrial, ...] = ()
    has_opened: bool = False
    least_gain: float = 0.0

    @property
    def is_done(self) -> bool:
        """Whether nothing is left to be fitted."""
        return not self.sides


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OpenSidesEstimate:
    """What is known of the sides of an assumed sheet.

    Attributes:
        tried_pitch: (2, 2) RMS motion of the outermost markers of each side in the last press in which it was
            tried, in pitches; 0 before.
        searched: the press that is searched now.
    """

    tried_pitch: Sides
    searched: SidesOfPress | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OpenSides:
    """Parameters of the search for open sides.

    Attributes:
        outermost_pitch: markers within this distance of the outermost ones of a side count as such.
        min_markers: sides with fewer of them are not tried.
        moved_share: a side is tried if its outermost markers move by this share of the RMS motion of all.
        growth: it is tried again if they move more than the last time by this factor.
        least_gain, least_gain_if_moved: decrease of the logarithm of the cost that opens a side; the second
            one where the image has moved, which is not known exactly. In simulated views that cut three
            to fifteen columns or rows off it is 0.2 to 4.9 where a press is near them, and the cost of whole
            sheets increases by up to 0.9. The second one was chosen on ten whole sheets and seven parts of
            sheets before a camera that moves by 0.05 to 0.3 px.
        most_misfit: largest RMS residual over the RMS motion of the markers with the best sheet; a press that
            no sheet describes, such as one of a pad, opens nothing.
        enough_elements: no further sheet is tried in the same frame when those of its trials have this many
            elements, which bounds its time.
    """

    outermost_pitch: float = 0.5
    min_markers: int = 3
    moved_share: float = 0.25
    growth: float = 1.8
    least_gain: float = 0.15
    least_gain_if_moved: float = 0.3
    most_misfit: float = 0.07
    enough_elements: int = 600

    def start(self) -> OpenSidesEstimate:
        """What is known before the first frame."""
        return OpenSidesEstimate(tried_pitch=read_only(np.zeros((2, 2))))

    def moved_pitch(self, layout: Layout, moved_px: Points2, is_seen: Mask, pitch_px: float) -> Sides:
        """(2, 2) RMS motion of the outermost markers of each side, in pitches; 0 where few are seen."""
        moved, outermost = np.zeros((2, 2)), self.outermost(layout) & is_seen
        for side in np.ndindex(2, 2):
            if outermost[side].sum() >= self.min_markers:
                moved[side] = np.sqrt(np.square(moved_px[outermost[side]]).sum(axis=1).mean())
        return moved / pitch_px

    def outermost(self, layout: Layout) -> Bool[np.ndarray, "2 2 m"]:
        """Whether each marker is one of the outermost ones of each side."""
        place = layout.rest_mm[:, :2] / layout.pitch_mm
        ends = np.array([place.min(axis=0), place.max(axis=0)])
        return np.asarray(np.abs(place.T[:, None] - ends.T[:, :, None]) < self.outermost_pitch)

    def tried_sides(
        self, before: OpenSidesEstimate, sheet: Sheet, layout: Layout, moved: Sides, moved_pitch: float
    ) -> tuple[Side, ...]:
        """Sides of a sheet that a press shows, whose outermost markers move by `moved`, and all by
        `moved_pitch`; none if no side moves more than when it was tried before."""
        is_closed = ~are_open(layout, sheet.size_mm, sheet.centre_mm)
        is_shown = is_closed & (moved > self.moved_share * moved_pitch)
        if not (is_shown & (moved > self.growth * before.tried_pitch)).any():
            return ()
        return tuple((int(axis), int(side)) for axis, side in np.argwhere(is_shown))

    def with_press(
        self,
        before: OpenSidesEstimate,
        sensor: Sensor,
        press: SearchedPress,
        sides: tuple[Side, ...],
        moved: Sides,
    ) -> OpenSidesEstimate:
        """The estimate with a press whose trials follow; `sensor` has the sheet of the model."""
        tried = before.tried_pitch.copy()
        for side in sides:
            tried[side] = max(tried[side], moved[side])
        searched = SidesOfPress(press=press, sensor=sensor, sides=sides)
        return OpenSidesEstimate(tried_pitch=read_only(tried), searched=searched)

    def opened_sheet(self, searched: SidesOfPress) -> Sheet | None:
        """The sheet with the sides open that a press has opened, after its trials; None if there is none."""
        is_sheet = searched.misfit is not None and searched.misfit <= self.most_misfit
        return searched.sensor.sheet if searched.has_opened and is_sheet else None

    def with_trials(self, before: OpenSidesEstimate, trial_of: SheetTrials) -> OpenSidesEstimate:
        """The estimate with the trials of one frame."""
        now, elements = before.searched, 0
        while now is not None and not now.is_done and elements < self.enough_elements:
            if len(now.trials) == len(now.sides):
                now = self._with_best(now)
                continue
            if now.log_cost is None:
                presses = now.press, now.press.without_view_motion()
                found = [trial_of(now.sensor, press) for press in presses]
                best = int(np.argmin([trial.log_cost for trial in found]))
                chosen = found[best]
                gain = (self.least_gain, self.least_gain_if_moved)[best]
                now = replace(
                    now, press=presses[best], log_cost=chosen.log_cost, misfit=chosen.misfit, least_gain=gain
                )
                elements += 2 * chosen.elements
                continue
            trial = trial_of(with_open_side(now.sensor, now.sides[len(now.trials)]), now.press)
            now, elements = replace(now, trials=(*now.trials, trial)), elements + trial.elements
        return replace(before, searched=now)

    def _with_best(self, now: SidesOfPress) -> SidesOfPress:
        """The press after one more side is opened, or when none is."""
        best = int(np.argmin([trial.log_cost for trial in now.trials]))
        found = now.trials[best]
        is_better = now.log_cost is not None and found.log_cost <= now.log_cost - now.least_gain
        if not is_better:
            return replace(now, sides=(), trials=())
        return replace(
            now,
            sensor=with_open_side(now.sensor, now.sides[best]),
            log_cost=found.log_cost,
            misfit=found.misfit,
            sides=now.sides[:best] + now.sides[best + 1 :],
            trials=(),
            has_opened=True,
        )


def with_open_side(sensor: Sensor, side: Side) -> Sensor:
    """The sensor with a sheet that goes on at one more side."""
    layout, sheet = sensor.layout, sensor.sheet
    assert layout is not None
    assert sheet is not None
    margin = margin_pitches(layout, sheet.size_mm, sheet.centre_mm)
    margin[side] = OPEN_MARGIN_PITCHES
    wider = assumed_sheet(layout, margin)
    return replace(sensor, sheet=replace(sheet, size_mm=wider.size_mm, centre_mm=wider.centre_mm))
