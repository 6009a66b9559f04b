"""Which clusters start a contact, and which are none."""

from dataclasses import replace

import numpy as np
import pytest

from contacts import contact_with
from manytouch.estimation.mechanics.clusters.force_clusters import ForceClusters
from manytouch.estimation.mechanics.contact_rules import ContactRules
from manytouch.estimation.mechanics.inversion.gauss_newton import GaussNewton
from manytouch.estimation.mechanics.inversion.sheet_model import NominalSheet
from manytouch.estimation.mechanics.inversion.sheet_parameters import ParameterResponse
from manytouch.estimation.mechanics.inversion.sheet_shape import BodyForce, SheetShape
from manytouch.values import Contact
from pressed_sheet import contacts_of, pressed, slack_sensor

USUAL_STD_PX = 0.03


@pytest.mark.parametrize(("thicknesses", "starts"), [(1.7, False), (2.6, True), (5.0, True)])
def test_a_contact_beside_the_clamp_waits_for_the_response(thicknesses: float, starts: bool) -> None:
    model, rules = NominalSheet()(slack_sensor(), USUAL_STD_PX), ContactRules()
    place_mm, half_mm = model.nodes.place_mm, 0.5 * np.array(model.patch.size_mm)
    wanted_mm = np.array([half_mm[0] - thicknesses * model.thickness_mm, 0.0])
    node = int(np.linalg.norm(place_mm - wanted_mm, axis=1).argmin())
    force_mm2 = np.zeros((len(place_mm), 3))
    force_mm2[node, 2] = -100.0 * model.nodes.least_force_mm2
    clusters = ForceClusters()(model.nodes, force_mm2)
    is_new, fit = np.ones(len(clusters), dtype=np.bool_), fit_at_rest(model)
    assert rules.may_start(model, clusters, fit, is_new, is_response_due=False).tolist() == [True]
    assert rules.may_start(model, clusters, fit, is_new, is_response_due=True).tolist() == [starts]


@pytest.mark.parametrize(("stds", "starts"), [(1.5, True), (2.5, False)])
def test_the_shear_of_a_new_contact_counts_as_far_as_noise_does_not_explain_it(
    stds: float, starts: bool
) -> None:
    model, rules = NominalSheet()(slack_sensor(), USUAL_STD_PX), ContactRules()
    fit, clusters, _ = two_forces(model)
    clusters = clusters.select(np.array([0]))
    share = (clusters.label == 0)[None].astype(np.float64)
    std_mm2 = np.hypot(*(fit.posterior.force_std(share, axis)[0] for axis in range(2)))
    assert std_mm2 > 0.0
    force_mm2 = clusters.force_mm2.copy()
    force_mm2[0, 1] = -rules.max_friction * clusters.normal_mm2[0] - stds * std_mm2
    clusters = replace(clusters, force_mm2=force_mm2)
    is_new = np.ones(1, dtype=np.bool_)
    assert rules.may_start(model, clusters, fit, is_new, is_response_due=False).tolist() == [starts]


NOTHING_BEFORE = np.zeros((0, 2))


def fit_at_rest(model):
    shape, markers = SheetShape.at_rest(model), len(model.layout.rest_mm)
    information = np.tile(100.0 * np.eye(2), (markers, 1, 1))
    return GaussNewton()(model, shape, np.zeros((markers, 2)), information)


def two_forces(model):
    """A strong force and a weak one on the sheet: the fit, their clusters and their nodes."""
    place_mm = model.nodes.place_mm
    nodes = [int(np.linalg.norm(place_mm - at, axis=1).argmin()) for at in ((-12.0, 0.0), (12.0, 0.0))]
    fit = fit_at_rest(model)
    force_mm2 = np.zeros((len(place_mm), 3))
    force_mm2[nodes, 2] = -1.0, -0.1
    clusters = ForceClusters()(model.nodes, force_mm2)
    clusters = replace(clusters, covariance=np.tile(1e-8 * np.eye(6), (2, 1, 1)))
    return replace(fit, shape=replace(fit.shape, force_mm2=force_mm2)), clusters, nodes


def response_of(fit, changed, share):
    """Wrong parameters change the forces of some nodes by a share of themselves."""
    force_mm2 = fit.shape.force_mm2
    change_mm2 = np.zeros((1, *force_mm2.shape))
    change_mm2[0, changed, 2] = share * force_mm2[changed, 2]
    return ParameterResponse(
        change_mm=np.zeros_like(change_mm2),
        force_change_mm2=change_mm2,
        by_outline_mm2=np.zeros(len(force_mm2)),
        by_acceleration_mm2=np.zeros((0, len(force_mm2))),
        normal_mm2=-force_mm2[:, 2],
        total_mm2=1.1,
        balance_slope=np.zeros_like(force_mm2),
        image_slope_px=np.zeros_like(fit.residual_px),
    )


@pytest.mark.parametrize(("share", "remains"), [(0.4, 2), (0.7, 1)])
def test_what_wrong_parameters_explain_is_no_contact_unless_they_change_all_forces(
    share: float, remains: int
) -> None:
    """First the weak force changes by a share of itself, then both do so."""
    model, rules = NominalSheet()(slack_sensor(), USUAL_STD_PX), ContactRules()
    fit, clusters, (strong, weak) = two_forces(model)
    for changed, expected in (([weak], remains), ([strong, weak], 2)):
        found, _ = rules.certain(model, clusters, fit, response_of(fit, changed, share), NOTHING_BEFORE)
        assert len(found) == expected


@pytest.mark.parametrize(("share", "remains"), [(0.2, 2), (0.3, 1)])
def test_what_a_wrong_outline_explains_is_no_contact_unless_it_changes_all_forces(
    share: float, remains: int
) -> None:
    """First the weak force changes by a share of itself, then both do so."""
    model, rules = NominalSheet()(slack_sensor(), USUAL_STD_PX), ContactRules()
    fit, clusters, (strong, weak) = two_forces(model)
    for changed, expected in (([weak], remains), ([strong, weak], 2)):
        by_outline_mm2 = response_of(fit, changed, share).force_change_mm2[0, :, 2]
        response = replace(response_of(fit, [], 0.0), by_outline_mm2=by_outline_mm2)
        found, _ = rules.certain(model, clusters, fit, response, NOTHING_BEFORE)
        assert len(found) == expected


@pytest.mark.parametrize(
    ("is_assumed", "before_mm", "remains"), [(True, 1.0, 2), (True, 7.0, 1), (False, 1.0, 1)]
)
def test_on_an_assumed_sheet_a_contact_lasts_whatever_the_parameters_explain(
    is_assumed: bool, before_mm: float, remains: int
) -> None:
    """A contact of the frame before is this far from the weak force."""
    model, rules = (
        replace(NominalSheet()(slack_sensor(), USUAL_STD_PX), is_assumed=is_assumed),
        ContactRules(),
    )
    fit, clusters, (_, weak) = two_forces(model)
    touching_mm = model.nodes.place_mm[[weak]] + [0.0, before_mm]
    found, _ = rules.certain(model, clusters, fit, response_of(fit, [weak], 0.7), touching_mm)
    assert len(found) == remains


@pytest.mark.parametrize(("std_g", "remains"), [(0.3, 2), (0.5, 1), (5.0, 0)])
def test_what_an_error_of_the_body_force_explains_is_no_contact(std_g: float, remains: int) -> None:
    """One g along z changes both forces by 0.09; they are 1 and 0.1."""
    model, rules = NominalSheet()(slack_sensor(), USUAL_STD_PX), ContactRules()
    fit, clusters, nodes = two_forces(model)
    body_force = BodyForce(
        acceleration_g=np.zeros(3),
        covariance_g2=std_g**2 * np.eye(3),
        force_mm2=np.zeros_like(fit.shape.force_mm2),
    )
    by_acceleration_mm2 = np.zeros((3, len(fit.shape.force_mm2)))
    by_acceleration_mm2[2, nodes] = 0.09
    response = replace(response_of(fit, [], 0.0), by_acceleration_mm2=by_acceleration_mm2)
    fit = replace(fit, shape=replace(fit.shape, body_force=body_force))
    found, _ = rules.certain(model, clusters, fit, response, NOTHING_BEFORE)
    assert len(found) == remains


def test_a_contact_near_the_clamp_is_followed_while_it_is_released() -> None:
    middle_mm, beside_mm = (0.0, 0.0), (29.0, 8.0)
    three, nine = (np.array([middle_mm] * parts + [beside_mm]) for parts in (3, 9))
    rest = [pressed(three, 0.0, seed) for seed in range(3)]
    held = [pressed(three, 0.2, 10 + seed) for seed in range(6)]
    strong, weak = contacts_of([*rest, *held, pressed(nine, 1.0 / 6.0, 30)]).touching
    assert strong.centre_mm == pytest.approx(middle_mm, abs=0.5)
    assert weak.centre_mm == pytest.approx(beside_mm, abs=0.8)
    assert weak.normal_force_over_E_mm2 == pytest.approx(1.0 / 60.0, rel=0.15)


@pytest.mark.parametrize(
    ("last", "half_major_mm", "lasts"),
    [
        (20.0, np.nan, True),
        (2000.0, np.nan, False),
        (0.5, 1.0, True),
        (np.nan, np.nan, True),
        (20.0, 12.0, True),
    ],
)
def test_a_contact_that_is_not_found_lasts_while_a_share_of_its_force_is_left(
    last: float, half_major_mm: float, lasts: bool
) -> None:
    """`last` is its force in an earlier frame; 3 least forces are left at its centre, 300 at 8 mm from it."""
    model = NominalSheet()(slack_sensor(), USUAL_STD_PX)
    node = int(np.linalg.norm(model.nodes.place_mm, axis=1).argmin())
    least_mm2 = model.nodes.least_force_mm2
    force_mm2 = np.zeros((len(model.nodes.place_mm), 3))
    force_mm2[node, 2] = -3.0 * least_mm2
    other = int(np.linalg.norm(model.nodes.place_mm - [8.0, 0.0], axis=1).argmin())
    force_mm2[other, 2] = -300.0 * least_mm2
    before = contact_at(model.nodes.place_mm[node], last * least_mm2, half_major_mm)
    assert ContactRules().may_last(model, force_mm2, before, 1.0) is lasts
    assert not ContactRules().may_last(model, force_mm2, before, 4.0)
    assert not ContactRules().may_last(model, np.zeros_like(force_mm2), before, 1.0)


def contact_at(centre_mm: np.ndarray, force_mm2: float, half_major_mm: float) -> Contact:
    return contact_with(
        id=0,
        centre_mm=centre_mm,
        area_mm2=10.0,
        normal_force_over_E_mm2=force_mm2,
        half_major_mm=half_major_mm,
    )
