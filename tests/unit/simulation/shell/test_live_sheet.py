"""The sheet that is solved live: known answers, laws, and the 3-D states that are shipped."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.fem.contact.indenters import RoundPunch, Sphere
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.scene.deformation import Deformation, undeformed
from manytouch.simulation.scene.file import BUILT_IN, SceneFile, load_scene
from manytouch.simulation.scene.motion import poses
from manytouch.simulation.scene.pressure_region import region_area, second_moments
from manytouch.simulation.shell.energy import ContactBodies, PosedIndenter, prestretch
from manytouch.simulation.shell.kernels import power
from manytouch.simulation.shell.live_sheet import LiveSheet, pressed_points
from manytouch.simulation.shell.minimisation import EnergyMinimiser
from manytouch.simulation.solve_scene import shipped_states, solid_problem
from manytouch.values import Sheet

FOUND = demo_sensor().sheet
assert FOUND is not None
SHEET: Sheet = FOUND
BALL = Sphere(radius_mm=6.0)
MOST = 300
PITCH_MM = 4.0
"""Of the demo."""


def ball(x_mm: float, y_mm: float, depth_mm: float, thickness_mm: float = 3.0) -> PosedIndenter:
    """A ball, its lowest point so deep below the touched face."""
    position_mm = np.array([x_mm, y_mm, thickness_mm - depth_mm])
    return PosedIndenter(indenter=BALL, position_mm=position_mm, rotation_vector=np.zeros(3))


def settled(sheet: LiveSheet, *bodies: PosedIndenter) -> Deformation:
    """In equilibrium, the thickness too."""
    for _ in range(6):
        has_converged = sheet.settle(bodies, MOST)
    assert has_converged
    return sheet.deformation()


def pressed(*bodies: PosedIndenter, sheet: Sheet = SHEET, spacing_mm: float = 2.0) -> Deformation:
    """Approached in steps of 1 mm or less."""
    live = LiveSheet(sheet, spacing_mm)
    for lift_mm in np.arange(9.0, -0.5, -1.0):
        lifted = [
            replace(body, position_mm=body.position_mm + np.array([0.0, 0.0, lift_mm])) for body in bodies
        ]
        live.settle(lifted, 40)
    return settled(live, *bodies)


def depth_mm(found: Deformation, *place_mm: tuple[float, float]) -> np.ndarray:
    return -found.displacement_mm(np.array(place_mm))[:, 2]


def test_the_slope_of_the_energy_is_its_derivative() -> None:
    live = LiveSheet(replace(SHEET, size_mm=np.array([48.0, 32.0])))
    chance = np.random.default_rng(0)
    value, way = (np.zeros_like(live.value) for _ in range(2))
    value[:, 1:-1, 1:-1] = 0.1 * chance.normal(size=value[:, 1:-1, 1:-1].shape)
    way[:, 1:-1, 1:-1] = chance.normal(size=value[:, 1:-1, 1:-1].shape)
    bodies = ContactBodies([ball(3.0, -5.0, 2.0)], live.energy)
    stretch = chance.uniform(0.8, 1.1, live.stretch.shape)
    _, slope = live.energy(value, stretch, bodies)
    assert bodies.loads.resultant[0, 2] < 0.0
    step = 1e-5
    ahead, behind = (live.energy(value + sign * step * way, stretch, bodies)[0] for sign in (1, -1))
    assert np.vdot(slope, way) == pytest.approx((ahead - behind) / (2 * step), rel=1e-6)
    assert not slope[:, 0].any()
    assert not slope[:, :, -1].any()


def test_powers_are_powers() -> None:
    for base in (0.4, 0.7, 1.0, 1.3, 3.0):
        assert power(base, -1.818) == pytest.approx(base**-1.818, rel=1e-6)


@pytest.mark.parametrize("tension_N_per_mm", [0.0, 0.4, 2.0])
def test_a_flat_sheet_is_in_equilibrium_and_pulls_with_its_pretension(tension_N_per_mm: float) -> None:
    """Stretching the whole sheet a little costs the tension and then E t / (1 - nu), about."""
    live = LiveSheet(replace(SHEET, pretension_N_per_mm=tension_N_per_mm))
    nobody = ContactBodies((), live.energy)
    energy, slope = live.energy(np.zeros_like(live.value), live.stretch, nobody)
    assert abs(energy) < 1e-9
    assert np.abs(slope).max() < 1e-9
    strain = 1e-4
    value = np.zeros_like(live.value)
    value[0], value[1] = strain * live.energy.x_mm[:, None], strain * live.energy.y_mm[None, :]
    both = [live.energy(sign * value, live.stretch, nobody)[0] for sign in (1.0, -1.0)]
    per_area = (both[0] - both[1]) / (2 * strain * 120.0 * 80.0)
    assert per_area == pytest.approx(2 * tension_N_per_mm, abs=1e-4)
    if tension_N_per_mm == 0.0:
        stiff = (both[0] + both[1]) / (strain**2 * 120.0 * 80.0)
        assert stiff == pytest.approx(2 * 3.1 * 3.0 / (1 - 0.45), rel=1e-3)


@pytest.mark.parametrize(
    ("size_mm", "expected"), [((120.0, 120.0), 0.00126), ((180.0, 120.0), 0.00220)], ids=["1:1", "1.5:1"]
)
def test_clamped_plates_under_even_load(size_mm: tuple[float, float], expected: float) -> None:
    """w D / (q a^4) of thin plates, Timoshenko; a pressure of dead weight on the middle surface."""
    thin = replace(SHEET, size_mm=np.array(size_mm), thickness_mm=2.0, pretension_N_per_mm=0.0)
    live = LiveSheet(thin, 3.0)
    nobody = ContactBodies((), live.energy)
    area_mm2 = float(np.prod(live.energy.spacing_mm))
    load_MPa = 1e-7

    def energy_of(value: np.ndarray) -> tuple[float, np.ndarray]:
        energy, slope = live.energy(value, live.stretch, nobody)
        slope[2, 1:-1, 1:-1] -= load_MPa * area_mm2
        return energy - load_MPa * area_mm2 * float(value[2].sum()), slope

    value = np.zeros_like(live.value)
    for _ in range(5):
        value = EnergyMinimiser(live.energy.preconditioner()).minimise(energy_of, value, 200).value
    bending_Nmm = 3.1 * 8.0 / (12 * (1 - 0.45**2))
    found = float(value[2].max()) * bending_Nmm / (load_MPa * size_mm[1] ** 4)
    assert found == pytest.approx(expected, rel=0.02)


def test_a_deep_press_stretches_the_sheet_and_takes_more_force_than_a_linear_plate() -> None:
    slack = replace(SHEET, pretension_N_per_mm=0.0)
    forces = [
        pressed(ball(0.0, 0.0, depth), sheet=slack).contacts[0].normal_force_N / depth
        for depth in (0.5, 2.0, 6.0)
    ]
    assert forces[0] < 1.1 * forces[1] < forces[2] / 1.5


def test_forces_are_balanced_by_the_sheet() -> None:
    """What the bodies push is what the clamped outline holds, in every direction."""
    live = LiveSheet(SHEET)
    bodies = [ball(-20.0, 5.0, 3.0), ball(30.0, -20.0, 4.0)]
    live.settle([ball(-20.0, 5.0, 1.5), ball(30.0, -20.0, 2.0)], MOST)
    found = settled(live, *bodies)
    pushed_N = np.sum([contact.force_N for contact in found.contacts], axis=0)
    _, force = live.energy.elastic(live.value, live.stretch)
    outline = np.ones(live.stretch.shape, dtype=bool)
    outline[1:-1, 1:-1] = False
    pull_N = -force[:3, outline].sum(axis=1)  # of the sheet on its outline
    assert pull_N == pytest.approx(pushed_N, abs=0.05)
    assert pushed_N[2] < -8.0
    assert abs(pushed_N[1]) > 0.1  # the ball near the rim is pushed back into the middle


def test_symmetry() -> None:
    one, other = pressed(ball(12.0, -9.0, 4.0)), pressed(ball(-12.0, 9.0, 4.0))
    np.testing.assert_allclose(one.face_mm, other.face_mm[::-1, ::-1] * [-1, -1, 1], atol=0.01)
    assert one.contacts[0].normal_force_N == pytest.approx(other.contacts[0].normal_force_N, rel=2e-3)


def test_a_finer_grid_gives_the_same() -> None:
    coarse, fine = (pressed(ball(10.0, -5.0, 5.0), spacing_mm=spacing_mm) for spacing_mm in (2.0, 1.0))
    there = (10.0, -5.0), (4.0, -5.0), (-20.0, 10.0)
    assert depth_mm(coarse, *there) == pytest.approx(depth_mm(fine, *there), rel=0.03)
    assert coarse.contacts[0].normal_force_N == pytest.approx(fine.contacts[0].normal_force_N, rel=0.03)


def test_release_returns_to_flat_and_a_lifted_body_does_not_touch() -> None:
    live = LiveSheet(SHEET)
    for lift_mm in (4.0, 2.0, 0.0):
        live.settle([ball(0.0, 0.0, 6.0 - lift_mm)])
    assert settled(live, ball(0.0, 0.0, 6.0)).contacts[0].normal_force_N > 5.0
    found = settled(live, ball(0.0, 0.0, -1.0))
    assert not found.contacts[0].is_touching
    assert np.abs(found.face_mm).max() < 1e-3


def test_many_fingers_that_come_suddenly_do_not_run_away() -> None:
    """Five at once, 2.5 mm deeper in each frame; a few frames later the sheet is where it belongs."""
    places = [(-40.0, 10.0), (-20.0, -15.0), (0.0, 15.0), (20.0, -15.0), (40.0, 5.0)]
    live = LiveSheet(SHEET)
    for frame in range(12):
        live.settle([ball(x, y, min(2.5 * (frame + 1), 8.0)) for x, y in places], 18)
        assert np.abs(live.deformation().face_mm).max() < 10.5
    there = live.deformation()
    calm = settled(live, *(ball(x, y, 8.0) for x, y in places))
    assert np.abs(there.face_mm - calm.face_mm).max() < 0.1
    for early, late in zip(there.contacts, calm.contacts, strict=True):
        assert early.normal_force_N == pytest.approx(late.normal_force_N, rel=0.02)


def test_it_can_begin_where_another_sheet_is() -> None:
    found = pressed(ball(10.0, -5.0, 5.0))
    live = LiveSheet(SHEET)
    live.start_from(found)
    assert np.abs(live.deformation().face_mm - found.face_mm).max() < 0.35  # fibres need not be normal
    assert np.abs(settled(live, ball(10.0, -5.0, 5.0)).face_mm - found.face_mm).max() < 0.01
    live.start_from(undeformed(found))
    assert np.abs(live.deformation().face_mm).max() == 0.0


def test_a_flat_punch_on_a_tilted_sheet_presses_on_an_edge() -> None:
    punch = replace(ball(0.0, 25.0, 3.0), indenter=RoundPunch(radius_mm=4.0))
    (contact,) = pressed(punch).contacts
    assert contact.centre_mm[0] == pytest.approx(0.0, abs=0.02)
    assert contact.centre_mm[1] > 25.5
    assert abs(contact.torque_Nmm) < 0.01


def test_regions_are_those_of_the_pressure() -> None:
    """A ball has that of its pressure, and half axes; a level flat face its footprint, a tilted one not."""
    flat, tilt = RoundPunch(radius_mm=4.0), np.array([0.0, 0.1, 0.0])
    bodies = [
        ball(0.0, 0.0, 2.0),
        replace(ball(30.0, 0.0, 2.0), indenter=flat),
        replace(ball(-30.0, 0.0, 2.0), indenter=flat, rotation_vector=tilt),
    ]
    live = LiveSheet(SHEET)
    settled(live, *bodies)
    one, level, tilted = live.deformation(PITCH_MM).contacts
    place_mm, normal_N = pressed_points(live.energy, live.bodies.loads, 0)
    assert normal_N.sum() == pytest.approx(one.normal_force_N)
    assert one.region_mm2 == region_area(place_mm, normal_N, PITCH_MM) > 2.0 * one.area_mm2
    assert one.ellipse[0] == pytest.approx(2.0 * np.sqrt(max(second_moments(place_mm, normal_N)[:2])))
    assert level.region_mm2 == pytest.approx(16.0 * np.pi)
    assert tilted.region_mm2 != pytest.approx(16.0 * np.pi, rel=0.01)
    assert np.isnan(live.deformation().contacts[0].region_mm2)


def solid(name: str) -> tuple[SceneFile, np.ndarray, tuple[Deformation, ...]]:
    scene = load_scene(BUILT_IN / f"{name}.toml", width_px=1280)
    problem = solid_problem(scene)
    states = shipped_states(name, problem.keys)
    assert states is not None
    return scene, problem.time_s, states


@pytest.mark.parametrize(
    ("name", "every", "least"),
    [
        ("fingers", 8, 6),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in (("one", 1, 12), ("fingers", 4, 12))),
    ],
)
def test_it_agrees_with_the_shipped_3d_states(name: str, every: int, least: int) -> None:
    """The same bodies at the same places: shape within 4 % of the peak, forces from 1 N on within 6 %."""
    scene, time_s, states = solid(name)
    layout = demo_sensor().layout
    assert layout is not None
    place_mm = np.ascontiguousarray(layout.rest_mm[:, :2])
    live, compared, forces = LiveSheet(SHEET), 0, []
    for number, state in list(enumerate(states))[::every]:
        bodies = [
            PosedIndenter(indenter=body.indenter, position_mm=position_mm, rotation_vector=turn)
            for body, position_mm, turn in poses(scene.bodies, float(time_s[number]), thickness_mm=3.0)
        ]
        live.settle(bodies, MOST)
        live.settle(bodies, MOST)
        found = live.deformation(PITCH_MM)
        off_mm = found.displacement_mm(place_mm) - state.displacement_mm(place_mm)
        peak_mm = -float(state.displacement_mm(place_mm)[:, 2].min())
        if peak_mm > 1.0:
            assert np.abs(off_mm[:, 2]).max() < 0.04 * peak_mm
            assert np.sqrt(np.mean(off_mm[:, 2] ** 2)) < 0.01 * peak_mm
            assert np.abs(off_mm[:, :2]).max() < 0.05
            compared += 1
        for here, there in zip(found.contacts, state.contacts, strict=True):
            if there.normal_force_N > 1.0:
                assert here.normal_force_N == pytest.approx(there.normal_force_N, rel=0.06)
                assert here.depth_mm == pytest.approx(there.depth_mm, rel=0.05)
                assert np.linalg.norm(here.centre_mm - there.centre_mm) < 0.6
                assert here.region_mm2 == pytest.approx(there.region_mm2, rel=0.08)
                assert here.ellipse[0] == pytest.approx(there.ellipse[0], abs=0.5)
                forces.append(here.normal_force_N / there.normal_force_N)
    assert compared >= least
    assert abs(np.median(forces) - 1.0) < 0.015


def test_its_pretension_is_that_of_the_solid() -> None:
    """Both materials are Hooke's for small strains and pull alike at the pretension."""
    stretch = NeoHooke(young_MPa=3.1, poisson=0.45).prestretch(0.4, 3.0)
    assert prestretch(SHEET) == pytest.approx(stretch[0], rel=1e-3)


def test_a_sheet_of_unknown_material_is_refused() -> None:
    with pytest.raises(ValueError, match="young_MPa"):
        LiveSheet(replace(SHEET, young_MPa=None))
