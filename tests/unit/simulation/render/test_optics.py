"""What camera and print add to a picture: each is seen."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from manytouch.geometry.camera import project
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.render.discs import Look
from manytouch.simulation.render.optics import Faults, ImagingSettings, draw_faults
from manytouch.simulation.scene.motion import Body, Trajectory, poses, press_trajectory
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.shell.energy import PosedIndenter
from manytouch.simulation.shell.live_sheet import LiveSheet
from manytouch.simulation.simulator import Simulator
from manytouch.values import Layout, Sheet

SENSOR = demo_sensor(640)
PLAIN = Look(ground=0.0, dot=200.0)
SLIDE = press_trajectory(0.0, 2.0, from_mm=(-20.0, 0.0), to_mm=(20.0, 0.0), depth_mm=4.0, ramp_s=0.25)
TAP = press_trajectory(0.4, 0.9, from_mm=(35.0, 20.0), depth_mm=5.0, ramp_s=0.2)
INDEX = 15


@cache
def scene(way: Trajectory, duration_s: float) -> SolidScene:
    """A ball on its way."""
    _, sheet = layout_and_sheet()
    body, live, states = Body(indenter=Sphere(radius_mm=6.0), trajectory=way), LiveSheet(sheet), []
    time_s = np.linspace(0.0, duration_s, 21)
    for at_s in time_s.tolist():
        live.settle(
            [
                PosedIndenter(indenter=body.indenter, position_mm=position_mm, rotation_vector=turn)
                for body, position_mm, turn in poses((body,), at_s, thickness_mm=sheet.thickness_mm)
            ],
            max_evaluations=40,
        )
        states.append(live.deformation())
    return SolidScene(name="ball", time_s=time_s, states=tuple(states), duration_s=duration_s)


def layout_and_sheet() -> tuple[Layout, Sheet]:
    assert SENSOR.layout is not None
    assert SENSOR.sheet is not None
    return SENSOR.layout, SENSOR.sheet


def simulator(
    optics: ImagingSettings | None = None, faults: Faults | None = None, look: Look = PLAIN
) -> Simulator:
    return Simulator(
        sensor=SENSOR, scene=scene(SLIDE, 2.0), look=look, optics=optics or ImagingSettings(), faults=faults
    )


def picture(
    optics: ImagingSettings | None = None, faults: Faults | None = None, look: Look = PLAIN
) -> np.ndarray:
    return np.asarray(simulator(optics, faults, look).frame(INDEX).image, dtype=np.float64)


def dot(image: np.ndarray, marker: int, reach_px: int = 8) -> np.ndarray:
    """The window of a marker."""
    x, y = np.rint(simulator().truth(INDEX).grid.position_px[marker]).astype(int)
    return image[y - reach_px : y + reach_px + 1, x - reach_px : x + reach_px + 1]


def spread(window: np.ndarray) -> np.ndarray:
    """Second moments along x and y."""
    rows, columns = np.indices(window.shape)
    total = window.sum()
    return np.array(
        [
            (window * (places - (window * places).sum() / total) ** 2).sum() / total
            for places in (columns, rows)
        ]
    )


def test_what_is_out_of_focus_is_blurred_by_its_circle_of_confusion() -> None:
    optics = ImagingSettings(aperture_mm=4.0, focus_mm=110.0)
    blur_px = optics.blurs_px(SENSOR.camera, np.array([[0.0, 0.0, 0.0], [10.0, 0.0, -6.3]]))
    f_px = SENSOR.camera.fx_px
    assert blur_px == pytest.approx([np.hypot(0.8, f_px * (1 / 110 - 1 / 116.3)), 0.8])
    sharp, soft = picture(), picture(optics)
    marker = 19 * 30 + 2  # far from the press
    grown = spread(dot(soft, marker)) - spread(dot(sharp, marker))
    assert grown == pytest.approx([blur_px[0] ** 2 - 0.8**2] * 2, abs=0.04)


def test_only_what_moves_is_smeared_and_its_middle_stays() -> None:
    sharp = replace(simulator(), scene=scene(TAP, 1.0))
    smeared = replace(sharp, optics=ImagingSettings(exposure_s=0.06))
    still, moving = (np.asarray(one.frame(INDEX).image, dtype=np.float64) for one in (sharp, smeared))
    before_px, here_px, after_px = (sharp.truth(INDEX + k).grid.position_px for k in (-1, 0, 1))
    ahead = int(np.argmax(np.linalg.norm(after_px - before_px, axis=1)))

    def window(image: np.ndarray, marker: int) -> np.ndarray:
        x, y = np.rint(here_px[marker]).astype(int)
        return image[y - 8 : y + 9, x - 8 : x + 9]

    way_px = after_px[ahead] - before_px[ahead]
    axis = int(np.argmax(np.abs(way_px)))
    grown = spread(window(moving, ahead))[axis] - spread(window(still, ahead))[axis]
    exposed_px = 0.06 / (2 / 30) * way_px[axis]
    assert grown == pytest.approx(exposed_px**2 / 12, rel=0.15)
    assert np.abs(window(moving - still, 19 * 30)).max() <= 1.0
    rows, columns = np.indices((17, 17))
    seen = window(moving, ahead)
    middle = np.array([(columns * seen).sum(), (rows * seen).sum()]) / seen.sum() - 8
    assert middle + np.rint(here_px[ahead]) == pytest.approx(here_px[ahead], abs=0.05)


def test_light_flickers_in_time() -> None:
    look = Look(ground=100.0, dot=100.0)
    flickering = simulator(ImagingSettings(flicker=0.2, flicker_Hz=7.5), look=look)
    levels = [float(np.asarray(flickering.frame(index).image).mean()) for index in range(5)]
    assert levels == pytest.approx([100.0, 120.0, 100.0, 80.0, 100.0], abs=0.6)


def test_jpeg_loses_a_little_and_its_bytes_are_kept() -> None:
    frame = simulator(ImagingSettings(jpeg_quality=60)).frame(INDEX)
    lost = np.abs(np.asarray(frame.image, dtype=np.float64) - picture())
    assert 0.1 < lost.mean() < 4.0
    assert frame.encoded is not None
    decoded = cv2.imdecode(np.frombuffer(frame.encoded, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(decoded, frame.image)
    assert simulator().frame(INDEX).encoded is None


def test_missing_and_half_printed_dots_are_missing_and_half() -> None:
    layout, sheet = layout_and_sheet()
    faults = draw_faults(layout, sheet, missing=5, half_printed=4, seed=3)
    missing, half = np.flatnonzero(~faults.is_printed), np.flatnonzero(np.isfinite(faults.cut[:, 2]))
    assert (len(missing), len(half)) == (5, 4)
    assert not set(missing) & set(half)
    whole, faulty = picture(), picture(faults=faults)
    for marker in missing:
        assert dot(faulty, marker, 4).max() == 0.0
    for marker in half:
        share = dot(faulty, marker, 5).sum() / dot(whole, marker, 5).sum()
        assert 0.2 < share < 0.8
    truth = simulator(faults=faults).truth(INDEX)
    np.testing.assert_array_equal(truth.grid.is_seen, faults.is_printed)
    np.testing.assert_array_equal(
        truth.grid.position_px[half], simulator().truth(INDEX).grid.position_px[half]
    )
    again = draw_faults(layout, sheet, missing=5, half_printed=4, seed=3)
    np.testing.assert_array_equal(again.is_printed, faults.is_printed)
    assert not np.array_equal(draw_faults(layout, sheet, missing=5, seed=4).is_printed, faults.is_printed)


def test_faults_take_as_many_of_the_dots_that_the_layout_has_as_stated() -> None:
    layout, sheet = layout_and_sheet()
    absent = np.arange(len(layout.rest_mm)) >= 20
    faults = draw_faults(replace(layout, is_missing=absent), sheet, missing=12, half_printed=8)
    assert faults.is_printed.sum() == 8
    np.testing.assert_array_equal(np.isfinite(faults.cut[:, 2]), faults.is_printed)


def test_dust_lies_on_the_sheet_and_moves_with_it() -> None:
    layout, sheet = layout_and_sheet()
    speck = replace(
        draw_faults(layout, sheet, dust=1),
        dust_mm=np.array([[2.0, 2.0]]),
        dust_radius_mm=np.array([0.4]),
        is_printed=np.zeros(600, dtype=bool),
    )
    rest_px = project(SENSOR.camera, np.array([[2.0, 2.0, 0.0]]))[0]
    dusty = simulator(faults=speck)
    places = []
    for index in (0, 30):
        image = np.asarray(dusty.frame(index).image, dtype=np.float64)
        rows, columns = np.indices(image.shape)
        assert image.max() > 100.0
        places.append(np.array([(columns * image).sum(), (rows * image).sum()]) / image.sum())
    assert places[0] == pytest.approx(rest_px, abs=0.05)
    assert np.linalg.norm(places[1] - places[0]) > 0.3


def test_bodies_take_light_where_they_press() -> None:
    layout, sheet = layout_and_sheet()
    look = Look(ground=100.0, dot=100.0)
    shaded = simulator(faults=draw_faults(layout, sheet, shadow=0.4), look=look)
    image = np.asarray(shaded.frame(INDEX).image, dtype=np.float64)
    x, y = np.rint(shaded.truth(INDEX).contacts.contacts[0].centre_px).astype(int)
    assert image[y, x] == pytest.approx(60.0, abs=1.0)
    assert image[5, 5] == 100.0
    darkest = np.unravel_index(np.argmin(gaussian_filter(image, 2.0)), image.shape)
    assert np.hypot(darkest[0] - y, darkest[1] - x) < 2.0


def test_dark_dots_are_dark() -> None:
    image = picture(look=Look(ground=190.0, dot=50.0))
    assert dot(image, 100)[8, 8] == pytest.approx(50.0, abs=3.0)
    assert image[2, 2] == 190.0
