"""What a frame changes of what is known of the sheet: its response to parameters, pretension and outline."""

from collections.abc import Callable
from dataclasses import replace

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.inversion.open_sides import OpenSides
from manytouch.estimation.mechanics.inversion.searched_press import SearchedPress, SheetTrials
from manytouch.estimation.mechanics.inversion.sheet_parameters import (
    PretensionEstimator,
    parameter_response,
)
from manytouch.estimation.mechanics.inversion.sheet_shape import SheetShape
from manytouch.estimation.mechanics.inversion.thickness import ThicknessEstimator
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.values import Status, TrackedGrid


def with_response(state: MechanicsState, fit: Fit) -> MechanicsState:
    """The state with the response of the last full step to the parameters of the sheet.

    It is computed in the frame after that step. So a frame takes the time of both only if the frame
    before had a full step too, if there is no response yet, or if it is the first one with a press.
    """
    before, model = state.response, state.model
    is_new = bool(fit.steps) or (before is not None and before.is_stale(model, fit))
    is_next = before is not None and before.may_wait(model, fit) and not state.response_is_due
    if fit.status is not Status.OK or is_next or not (is_new or state.response_is_due):
        return replace(state, response_is_due=state.response_is_due or is_next)
    response = parameter_response(model, state.variants, state.pretension, fit)
    return replace(state, response=response, response_is_due=False)


def with_pretension(
    state: MechanicsState, estimator: PretensionEstimator, fit: Fit, clusters: Clusters
) -> MechanicsState:
    """The state with an unknown pretension as the last frame shows it."""
    response = state.response
    if not state.pretension.is_estimated or response is None:
        return state
    slope = response.misfit_slope(state.model, fit, clusters.is_pressed)
    now = estimator.update(state.pretension, state.model, *slope)
    if not estimator.is_new_model_due(state.model, now):
        return replace(state, pretension=now)
    model = state.model.with_pretension(now.mean_mm)
    return replace(
        state,
        pretension=now,
        model=model,
        variants=tuple(each.with_pretension(now.mean_mm) for each in state.variants),
        shape=SheetShape.at(model, state.shape.coefficient_mm),
        posterior=None,
        posterior_frames=0,
    )


def with_press(
    state: MechanicsState,
    grid: TrackedGrid,
    open_sides: OpenSides,
    thickness: ThicknessEstimator,
    *,
    motion_px: tuple[float, float],
    press_of: Callable[[float], SearchedPress],
) -> MechanicsState:
    """The state with a press of an assumed sheet to be searched, if the frame has one and none is searched.

    Args:
        state: after the frame.
        grid: of the frame.
        open_sides, thickness: what is searched.
        motion_px: RMS motion of the markers, and that of their noise.
        press_of: returns the press from the RMS motion of the markers in pitches.
    """
    if state.open_sides.searched is not None or state.thickness.press is not None:
        return state
    moved, noise = (each / state.pitch_px for each in motion_px)
    if state.tracks.touching_frames.max(initial=0) < thickness.frames or not thickness.is_clear(moved, noise):
        return state
    layout, sheet = state.model.layout, state.thickness.sheet
    moved_px = grid.position_px - state.reference_px
    at_sides = open_sides.moved_pitch(layout, moved_px, grid.is_seen, state.pitch_px)
    sides = open_sides.tried_sides(state.open_sides, sheet, layout, at_sides, moved)
    if sides:
        sensor = replace(state.thickness.sensor, sheet=sheet)
        searched = open_sides.with_press(state.open_sides, sensor, press_of(moved), sides, at_sides)
        return replace(state, open_sides=searched)
    if not thickness.is_searched(state.thickness, moved):
        return state
    press = press_of(moved).without_view_motion() if state.is_at_clamp.any() else press_of(moved)
    return replace(state, thickness=thickness.with_press(state.thickness, press))


def with_trials(
    state: MechanicsState, open_sides: OpenSides, thickness: ThicknessEstimator, trial_of: SheetTrials
) -> MechanicsState:
    """The state with the trials of one frame, of the press that is searched."""
    if state.open_sides.searched is None:
        return replace(state, thickness=thickness.with_trials(state.thickness, trial_of))
    sides = open_sides.with_trials(state.open_sides, trial_of)
    searched, now = sides.searched, state.thickness
    if searched is None or not searched.is_done:
        return replace(state, open_sides=sides)
    sheet = open_sides.opened_sheet(searched)
    if sheet is not None:
        now = thickness.with_open_sides(now, sheet, state.model.layout)
    return replace(state, open_sides=replace(sides, searched=None), thickness=now)


def with_sheet_of(state: MechanicsState, fresh: MechanicsState) -> MechanicsState:
    """The state with the model of another one that begins at rest; dots and contacts stay as they are."""
    return replace(
        fresh,
        initial_reference_px=state.initial_reference_px,
        reference_px=state.reference_px,
        excess_px2=state.excess_px2,
        previous=replace(
            state.previous,
            one_mm2=0.0 * state.previous.one_mm2,
            nodal_mm2=state.previous.nodal_mm2[:0],
        ),
        slip=state.slip,
        tracks=state.tracks,
        undescribed=state.undescribed,
        thickness=state.thickness,
        open_sides=state.open_sides,
    )
