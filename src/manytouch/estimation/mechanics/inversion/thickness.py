"""The thickness and the outline of an assumed sheet, estimated from what presses it.

The markers of one frame are fitted from rest with sheets of other thicknesses, in this and the next frames,
so that no frame takes the time of all of them. The cost is that of `gauss_newton`, with the prior of the
forces: too thin a sheet is so flexible that forces everywhere explain any residuals, and residuals alone do
not show it. The thicknesses are in equal ratios around the present one, until the cost rises on both sides of
the least; a parabola of its logarithm gives the minimum. A wider and thinner sheet moves the markers about
alike: a second line of sheets, wider and thinner ones, gives the outline.
"""

from dataclasses import dataclass, replace

import numpy as np

from manytouch.estimation.mechanics.inversion.searched_press import SearchedPress, SheetTrials
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.values import Layout, Sensor, Sheet
from manytouch.values.sensor_file.assumed_sheet import (
    OPEN_MARGIN_PITCHES,
    are_open,
    assumed_sheet,
    margin_pitches,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ThicknessTrial:
    """A fit with another sheet.

    Attributes:
        step: place on the line of trials, in steps from its origin.
        log_cost: natural logarithm of the cost of the fit.
        misfit: RMS residual over the RMS motion of the markers.
    """

    step: float
    log_cost: float
    misfit: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ThicknessEstimate:
    """What is known of the thickness and of the outline of an assumed sheet.

    Attributes:
        sensor: of the markers.
        assumed: the sheet before its thickness was estimated.
        is_opened: whether a side of it was opened since the model was made.
        sheet: that of the model.
        log, log_std: natural logarithm of the thickness in mm, and its standard deviation for this outline.
        wider, wider_std: by how much each side at which the sheet ends is further outwards than assumed, in
            pitches.
        moved_pitch: `SearchedPress.moved_pitch` of the last press that was searched.
        searches: number of presses that were searched.
        press: that is searched now.
        trials: on the present line of sheets, by step.
        origin: logarithm and `wider` where the line begins.
        line_std: deviation of the logarithm that the line of thicknesses gave; None while it is searched.
    """

    sensor: Sensor
    assumed: Sheet
    is_opened: bool = False
    sheet: Sheet
    log: float
    log_std: float
    wider: float = 0.0
    wider_std: float
    moved_pitch: float = 0.0
    searches: int = 0
    press: SearchedPress | None = None
    trials: tuple[ThicknessTrial, ...] = ()
    origin: tuple[float, float] = (0.0, 0.0)
    line_std: float | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ThicknessEstimator:
    """Parameters of the estimate of the thickness and the outline of an assumed sheet.

    Attributes:
        frames: a press is clear when a contact has lasted for this many frames.
        moved_pitch: least RMS motion of the markers under a clear press, in pitches.
        moved_stds: the same in deviations of their positions.
        growth: a later press is searched if its motion is larger by this factor.
        most_searches: number of presses that are searched.
        ratio: of a thickness to the next one that is tried.
        wider_step: from an outline to the next one that is tried, each side, in pitches.
        thinner: decrease of the logarithm of the thickness for an outline that is wider by a pitch, with
            which the markers hardly move.
        most_trials: number of sheets of a line.
        enough_elements: no further sheet is tried in the same frame when those of its trials have this many
            elements, which bounds its time.
        least_pitch, most_pitch: range of the thickness, in pitches.
        least_wider, most_wider: range of the outline.
        most_misfit: largest `ThicknessTrial.misfit` of a press that is one of a sheet.
        cost_share: relative increase of the cost that counts as one standard deviation.
        least_line_std: least standard deviation of the logarithm by one press, for its weight.
        forgotten_std: added to that of the presses before, since a stronger press shows the thickness better.
        least_std, least_wider_std: least standard deviations, of the logarithm and of the outline.
        new_model_change: the model is replaced when the logarithm has changed by this.
    """

    frames: int = 2
    moved_pitch: float = 0.006
    moved_stds: float = 10.0
    growth: float = 1.8
    most_searches: int = 4
    ratio: float = 1.4
    wider_step: float = 0.4
    thinner: float = 0.55
    most_trials: int = 6
    enough_elements: int = 600
    least_pitch: float = 0.18
    most_pitch: float = 3.0
    least_wider: float = -0.85
    most_wider: float = 2.0
    most_misfit: float = 0.07
    cost_share: float = 0.1
    least_line_std: float = 0.1
    forgotten_std: float = 0.3
    least_std: float = 0.15
    least_wider_std: float = 0.25
    new_model_change: float = 0.04

    def start(self, sensor: Sensor, sheet: Sheet, pitch_mm: float) -> ThicknessEstimate:
        """What is known before the first frame."""
        return ThicknessEstimate(
            sensor=sensor,
            assumed=sheet,
            sheet=sheet,
            log=float(np.log(sheet.thickness_mm)),
            log_std=(sheet.thickness_std_mm or 0.0) / sheet.thickness_mm,
            wider_std=(sheet.outline_std_mm or 0.0) / pitch_mm,
        )

    def is_clear(self, moved_pitch: float, noise_pitch: float) -> bool:
        """Whether the RMS motion of the markers is far more than their noise."""
        return moved_pitch >= max(self.moved_pitch, self.moved_stds * noise_pitch)

    def is_searched(self, before: ThicknessEstimate, moved_pitch: float) -> bool:
        """Whether a clear press is searched, after the ones before.

        None is if the sheet goes on at all sides: its outline is not known, and far presses and thick sheets
        move the markers alike.
        """
        is_next = before.searches < self.most_searches and moved_pitch >= self.growth * before.moved_pitch
        return is_next and _ends_somewhere(before)

    def with_open_sides(self, before: ThicknessEstimate, sheet: Sheet, layout: Layout) -> ThicknessEstimate:
        """The estimate begun again with the sides open that are open in `sheet`.

        What a sheet that ended there has shown of the thickness is not used.
        """
        is_open = are_open(layout, sheet.size_mm, sheet.centre_mm)
        assumed = before.assumed
        margin = margin_pitches(layout, assumed.size_mm, assumed.centre_mm)
        margin[is_open] = OPEN_MARGIN_PITCHES
        pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
        return replace(self.start(before.sensor, assumed_sheet(layout, margin), pitch_mm), is_opened=True)

    def with_press(self, before: ThicknessEstimate, press: SearchedPress) -> ThicknessEstimate:
        """The estimate with a press whose trials follow."""
        return replace(before, press=press, origin=(before.log, before.wider), trials=(), line_std=None)

    def with_trials(self, before: ThicknessEstimate, trial_of: SheetTrials) -> ThicknessEstimate:
        """The estimate with the trials of one frame; after the last one, it contains the press."""
        now, elements, model = before, 0, trial_of.present
        while (press := now.press) is not None and elements < self.enough_elements:
            step = self._next_step(now, model.pitch_mm)
            if step is None:
                now = self._with_line(now, press)
                continue
            sheet = _sheet(now, *self._place(now, step), model.layout)
            found = trial_of(replace(now.sensor, sheet=sheet), press)
            trial = ThicknessTrial(step=step, log_cost=found.log_cost, misfit=found.misfit)
            trials = sorted((*now.trials, trial), key=lambda each: each.step)
            now, elements = replace(now, trials=tuple(trials)), elements + found.elements
        return now

    def new_sheet(self, now: ThicknessEstimate, model: InversionModel) -> Sheet | None:
        """The sheet of a new model; None if the estimate hardly differs from the present one."""
        if now.is_opened:
            return now.assumed
        if now.press is not None or now.searches == 0:
            return None
        sheet = _sheet(now, now.log, now.wider, model.layout)
        std = float(np.hypot(now.log_std, self.thinner * now.wider_std))
        off = abs(now.log - float(np.log(now.sheet.thickness_mm)))
        off += self.thinner * float(np.abs((sheet.size_mm - now.sheet.size_mm) / model.pitch_mm).max())
        before_mm = now.sheet.thickness_std_mm or 0.0
        if off <= self.new_model_change and std > 0.8 * before_mm / now.sheet.thickness_mm:
            return None
        return replace(
            sheet,
            thickness_std_mm=std * sheet.thickness_mm,
            outline_std_mm=now.wider_std * model.pitch_mm,
        )

    def _place(self, now: ThicknessEstimate, step: float) -> tuple[float, float]:
        """Logarithm of the thickness in mm, and `wider`, at a place on the present line."""
        log, wider = now.origin
        if now.line_std is None:
            return log + step * float(np.log(self.ratio)), wider
        return log - self.thinner * self.wider_step * step, wider + self.wider_step * step

    def _next_step(self, now: ThicknessEstimate, pitch_mm: float) -> float | None:
        """The step that is tried next; None after the last one."""
        trials = now.trials
        if not trials:
            return 0.0
        if len(trials) >= self.most_trials:
            return None
        best = int(np.argmin([trial.log_cost for trial in trials]))
        ends = (best == len(trials) - 1, trials[-1].step + 1), (best == 0, trials[0].step - 1)
        for is_end, step in ends:
            log, wider = self._place(now, step)
            is_thick = self.least_pitch * pitch_mm <= np.exp(log) <= self.most_pitch * pitch_mm
            if is_end and is_thick and self.least_wider <= wider <= self.most_wider:
                return step
        return None

    def _with_line(self, before: ThicknessEstimate, press: SearchedPress) -> ThicknessEstimate:
        """The estimate after the last trial of a line."""
        done = replace(
            before, press=None, trials=(), searches=before.searches + 1, moved_pitch=press.moved_pitch
        )
        trials = before.trials
        best = int(np.argmin([trial.log_cost for trial in trials]))
        if trials[best].misfit > self.most_misfit or len(trials) < 3:
            return done
        middle = min(max(best, 1), len(trials) - 2)
        low, least, high = (trial.log_cost for trial in trials[middle - 1 : middle + 2])
        curvature = max(low - 2.0 * least + high, 1e-3)
        step = trials[middle].step + float(np.clip(0.5 * (low - high) / curvature, -1.0, 1.0))
        std, (log, wider) = float(np.sqrt(self.cost_share / curvature)), self._place(before, step)
        if before.line_std is None:
            std = float(np.hypot(self.least_line_std, std * np.log(self.ratio)))
            return replace(before, trials=(), origin=(log, wider), line_std=std)
        std = float(np.hypot(self.least_wider_std, std * self.wider_step))
        wider, wider_std = _mean((before.wider, before.wider_std), (wider, std))
        log += self.thinner * (before.origin[1] + self.wider_step * step - wider)
        forgotten = self.forgotten_std if before.searches > 0 else 0.0
        prior_std = float(np.hypot(before.log_std, forgotten))
        prior = before.log - self.thinner * (wider - before.wider), prior_std
        log, log_std = _mean(prior, (log, before.line_std))
        return replace(
            done,
            log=log,
            log_std=max(log_std, self.least_std),
            wider=wider,
            wider_std=max(wider_std, self.least_wider_std),
        )


def _mean(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Mean and standard deviation of two independent estimates."""
    first, second = one[1] ** -2, other[1] ** -2
    return (first * one[0] + second * other[0]) / (first + second), (first + second) ** -0.5


def _sheet(now: ThicknessEstimate, log: float, wider: float, layout: Layout) -> Sheet:
    """A sheet with another thickness and another outline, where the assumed one ends."""
    assumed = now.assumed
    margin = margin_pitches(layout, assumed.size_mm, assumed.centre_mm)
    margin[~are_open(layout, assumed.size_mm, assumed.centre_mm)] += wider
    outline = assumed_sheet(layout, margin)
    return replace(
        assumed, size_mm=outline.size_mm, centre_mm=outline.centre_mm, thickness_mm=float(np.exp(log))
    )


def _ends_somewhere(now: ThicknessEstimate) -> bool:
    """Whether the markers show a side at which the sheet ends."""
    layout, assumed = now.sensor.layout, now.assumed
    assert layout is not None
    return not are_open(layout, assumed.size_mm, assumed.centre_mm).all()
