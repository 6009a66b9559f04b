"""What a frame changes of what is known of the sheet: its response to parameters, and pretension."""

from dataclasses import replace

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.inversion.sheet_parameters import (
    PretensionEstimator,
    parameter_response,
)
from manytouch.estimation.mechanics.inversion.sheet_shape import SheetShape
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.values import Status


def with_response(state: MechanicsState, fit: Fit) -> MechanicsState:
    """The state with the response of the last full step to the parameters of the sheet.

    It is computed in the frame after that step. So a frame takes the time of both only if the frame
    before had a full step too, if there is no response yet, or if it is the first one with a press.
    """
    before, model = state.response, state.model
    if before is not None and before.has_body_force != (fit.shape.body_force is not None):
        before = None
        state = replace(state, response_is_due=True)
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
        shape=SheetShape.at(model, state.shape.coefficient_mm, state.shape.body_force),
        posterior=None,
        posterior_frames=0,
    )
