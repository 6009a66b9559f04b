"""The paper's detection: what each step must keep and what it must remove."""

import cv2
import numpy as np
import pytest

from layouts import lattice_layout
from manytouch.errors import ManytouchError, SensorError
from manytouch.geometry.camera import project
from manytouch.paper.detection import PaperDetection, contour_midpoints, open_binary
from manytouch.simulation.render.discs import DARK_DOTS, LIGHT_DOTS, Look, render_discs
from manytouch.values import Camera, Frame, Roi, Sensor

ROWS, COLUMNS, PITCH_MM, RADIUS_MM = 5, 8, 4.0, 0.9


def camera(*, width_px=420, height_px=300, distortion=None, rotation=(0.0, 0.0, 0.0), model="pinhole"):
    return Camera(
        model=model,
        width_px=width_px,
        height_px=height_px,
        fx_px=1000.0,
        fy_px=1020.0,
        cx_px=210.3,
        cy_px=148.6,
        distortion=np.zeros(5) if distortion is None else np.array(distortion),
        rotation_vector=np.array(rotation),
        translation_mm=np.array([0.0, 0.0, 90.0]),
    )


def sensor(polarity="light", **named):
    layout = lattice_layout(ROWS, COLUMNS, PITCH_MM, radius_mm=RADIUS_MM, polarity=polarity)
    return Sensor(name="test sheet", camera=camera(**named), layout=layout)


def picture(of, look=LIGHT_DOTS, radius_px=9.0, seed=None, bits=8):
    centre_px = project(of.camera, of.layout.rest_mm)
    shape_px = np.tile(np.eye(2) * radius_px, (len(centre_px), 1, 1))
    size = {"width_px": of.camera.width_px, "height_px": of.camera.height_px}
    return centre_px, render_discs(centre_px, shape_px, look=look, seed=seed, bits=bits, **size)


def frame(image):
    return Frame(index=0, timestamp_ns=0, camera="test", image=image)


def found(detect, of, image):
    return detect.step(detect.start(of), frame(image), None)[1]


def nearest_px(found_px, true_px):
    return np.linalg.norm(found_px[:, None] - true_px, axis=-1).min(axis=0)


def in_reading_order(point):
    return point[np.lexsort((np.round(point[:, 0]), np.round(point[:, 1])))]


def test_same_markers_as_a_plain_opencv_chain():
    of = sensor()
    _, image = picture(of, Look(read_noise=3.0), seed=4)
    _, binary = cv2.threshold(image, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    binary = cv2.morphologyEx(binary, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    contours, _ = cv2.findContours(binary, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    moments = [cv2.moments(contour) for contour in contours]
    plain = np.array([[m["m10"] / m["m00"], m["m01"] / m["m00"]] for m in moments if m["m00"] > 40])
    dots = found(PaperDetection(outline_pitch=50.0), of, image)
    assert len(dots.centre_px) == ROWS * COLUMNS
    np.testing.assert_allclose(in_reading_order(dots.centre_px), in_reading_order(plain), atol=1e-6)


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize(("polarity", "look"), [("light", LIGHT_DOTS), ("dark", DARK_DOTS)])
def test_light_and_dark_grey_and_colour_8_12_and_16_bit(polarity, look, bits, colour):
    of = sensor(polarity)
    true_px, image = picture(of, look, bits=8 if bits == 8 else 16)
    image = image >> 4 if bits == 12 else image
    image = np.repeat(image[:, :, None], 3, axis=2) if colour else image
    dots = found(PaperDetection(), of, image)
    assert dots.status == "ok"
    assert len(dots.centre_px) == len(true_px)
    assert nearest_px(dots.centre_px, true_px).max() < 0.2
    assert (dots.contrast > 100).all()
    np.testing.assert_allclose(dots.area_px2, np.pi * 9.0**2, rtol=0.06)


@pytest.mark.parametrize(
    "named",
    [
        {"distortion": [-0.35, 0.2, 0.002, -0.001, 0.0]},
        {"rotation": (0.0, 0.0, 0.2)},
        {"rotation": (0.12, -0.08, 0.05), "distortion": [-0.2, 0.0, 0.0, 0.0, 0.0]},
        {"model": "fisheye", "distortion": [-0.05, 0.01, 0.0, 0.0]},
    ],
)
def test_undistorting_and_aligning_comes_back_to_the_camera_image(named):
    of = sensor(**named)
    true_px, image = picture(of)
    dots = found(PaperDetection(), of, image)
    assert len(dots.centre_px) == len(true_px)
    assert nearest_px(dots.centre_px, true_px).max() < 0.25


def test_aligned_view_shows_rows_level_and_evenly_spaced():
    of = sensor(rotation=(0.2, 0.1, 0.3), distortion=[-0.3, 0.1, 0.0, 0.0, 0.0])
    state = PaperDetection().start(of).view
    aligned_px = np.stack(np.meshgrid(*(30.0 + 9.0 * np.arange(n) for n in (6, 4))), axis=-1).reshape(-1, 2)
    there_px = state.image_px(aligned_px)
    at = np.rint(aligned_px).astype(int)
    mapped_px = np.column_stack([axis[at[:, 1], at[:, 0]] for axis in state.maps])
    np.testing.assert_allclose(there_px, mapped_px, atol=2e-3)


def test_covariance_is_the_observed_scatter():
    of = sensor(width_px=421, height_px=301)
    detect = PaperDetection(minimum_area_px2=20.0)
    state = detect.start(of)
    random = np.random.default_rng(3)
    rest_px = project(of.camera, of.layout.rest_mm)
    for radius_px in (4.0, 9.0):
        shape_px = np.tile(np.eye(2) * radius_px, (len(rest_px), 1, 1))
        miss, variance = [], []
        for _ in range(12):
            true_px = rest_px + random.uniform(-0.5, 0.5, rest_px.shape)
            image = render_discs(true_px, shape_px, width_px=421, height_px=301, blur_px=0.7)
            _, dots = detect.step(state, frame(image), None)
            gap = dots.centre_px[:, None] - true_px
            miss.append(gap[np.arange(len(gap)), np.linalg.norm(gap, axis=-1).argmin(axis=1)])
            variance.append(dots.covariance_px2[:, 0, 0])
        observed = np.sqrt(np.mean(np.concatenate(miss) ** 2))
        predicted = np.sqrt(np.mean(np.concatenate(variance)))
        assert 0.7 < observed / predicted < 1.4


def test_padding_keeps_what_the_edge_cuts_and_opening_removes_specks():
    binary = np.zeros((40, 60), np.uint8)
    binary[0:5, 10:20] = 255  # at the upper edge
    binary[0:2, 30:36] = 255  # its last two rows: alone they would not hold the kernel
    binary[20:30, 55:60] = 255  # at the right edge
    binary[36:40, 0:4] = 255  # in a corner
    expected = binary.copy()
    binary[12, 30] = binary[0, 40] = binary[39, 59] = 255
    binary[15:17, 5:7] = 255
    np.testing.assert_array_equal(open_binary(binary, 3), expected)


def test_without_padding_opening_erodes_what_touches_the_border():
    binary = np.zeros((20, 20), np.uint8)
    binary[:3, 5:9] = binary[10:14, 10:14] = 255
    np.testing.assert_array_equal(open_binary(binary, 5, "repeat")[:3, 5:9], 0)  # narrower than the kernel
    np.testing.assert_array_equal(open_binary(binary, 3, "repeat"), binary)
    unpadded = open_binary(binary[1:], 3, "none")  # two rows are left, one of which has no neighbour above
    assert unpadded.shape == (19, 20)
    assert unpadded[:3].max() == 0
    np.testing.assert_array_equal(unpadded[9:13, 10:14], 255)


def test_contours_beyond_the_largest_area_are_no_markers():
    of = sensor()
    centre_px, image = picture(of)
    image = image.copy()
    cv2.circle(image, np.rint(centre_px[3:5].mean(axis=0)).astype(int).tolist(), 26, 255, -1)
    merged = found(PaperDetection(), of, image)
    limited = found(PaperDetection(maximum_area_px2=400.0), of, image)
    assert merged.area_px2.max() > 1500.0
    assert limited.area_px2.max() < 400.0
    assert len(limited.centre_px) == len(merged.centre_px) - 1


def test_opening_keeps_the_area_of_discs():
    image = render_discs(
        np.array([[20.3, 21.8], [52.1, 19.4]]),
        np.array([9.0, 12.5])[:, None, None] * np.eye(2),
        width_px=75,
        height_px=45,
    )
    binary = cv2.threshold(image, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[1]
    lost = np.count_nonzero(binary) - np.count_nonzero(open_binary(binary, 3))
    assert 0 <= lost <= 0.01 * np.count_nonzero(binary)
    np.testing.assert_array_equal(open_binary(binary, 1), binary)


def test_area_filter_and_threshold_are_the_users():
    of = sensor()
    _, image = picture(of)
    image = image.copy()
    cv2.circle(image, (210, 40), 3, 205, -1)
    assert len(found(PaperDetection(outline_pitch=50.0), of, image).centre_px) == ROWS * COLUMNS
    everything = PaperDetection(outline_pitch=50.0, minimum_area_px2=10.0)
    assert len(found(everything, of, image).centre_px) == ROWS * COLUMNS + 1
    assert len(found(PaperDetection(threshold=230), of, image).centre_px) == 0
    wide = found(PaperDetection(threshold=60), of, image).area_px2.mean()
    assert wide > found(PaperDetection(threshold=180), of, image).area_px2.mean() + 20.0


def test_threshold_is_a_grey_level_of_the_image_for_dark_markers_too():
    of = sensor("dark")
    _, image = picture(of, DARK_DOTS)
    wide = found(PaperDetection(threshold=180), of, image).area_px2.mean()
    assert wide > found(PaperDetection(threshold=70), of, image).area_px2.mean() + 20.0
    assert len(found(PaperDetection(threshold=30), of, image).centre_px) == 0


def test_margin_is_tried_until_all_markers_show_and_then_kept():
    of = sensor()
    centre_px, image = picture(of)
    faint = np.where(np.arange(ROWS * COLUMNS) % 5 == 0, 0.3, 1.0)
    shape_px = np.tile(np.eye(2) * 9.0, (len(centre_px), 1, 1))
    faint_image = render_discs(
        centre_px, shape_px, width_px=420, height_px=300, contrast=faint, look=Look(read_noise=2.0), seed=1
    )
    assert len(found(PaperDetection(margin=0), of, faint_image).centre_px) < ROWS * COLUMNS
    detect = PaperDetection()
    blank, state = np.full_like(image, 45), detect.start(of)
    state, _nothing = detect.step(state, frame(blank), None)
    assert state.margin is None
    for shown in (faint_image, np.clip(faint_image.astype(int) + 40, 0, 255).astype(np.uint8)):
        state, dots = detect.step(state, frame(shown), None)
        assert nearest_px(dots.centre_px, centre_px).max() < 0.5
        assert len(dots.centre_px) == ROWS * COLUMNS
        assert state.margin < 0
    state = detect.start(of)
    for _ in range(20):
        state, _nothing = detect.step(state, frame(blank), None)
    assert (state.margin, state.trials) == (None, 0)


@pytest.mark.parametrize(
    "named", [{}, {"distortion": [-0.1, 0.0, 0.0, 0.0, 0.0]}, {"rotation": (0.0, 0.0, 0.4)}]
)
def test_region_of_interest_leaves_out_what_lies_outside(named):
    of = sensor(**named)
    true_px, image = picture(of)
    x, y, width, height = 120, 90, 230, 170
    dots = found(PaperDetection(roi_px=Roi(x, y, width, height)), of, image)
    inside = ((true_px > [x + 9, y + 9]) & (true_px < [x + width - 10, y + height - 10])).all(axis=1)
    assert inside.any()
    assert not inside.all()
    assert nearest_px(dots.centre_px, true_px[inside]).max() < 0.2
    assert (dots.centre_px > [x - 1, y - 1]).all()
    assert (dots.centre_px < [x + width, y + height]).all()


def test_midpoints_follow_a_shift_and_do_not_mind_the_order():
    contours = [
        np.array([[[2, 3]], [[2, 9]], [[8, 9]], [[8, 3]]]),
        np.array([[[20, 20]]]),
        np.array([[[5, 30]], [[9, 30]]]),
    ]
    midpoint, area = contour_midpoints(contours)
    np.testing.assert_allclose(midpoint, [[5, 6], [20, 20], [7, 30]])
    assert area[0] == 36 + 2 + 1
    moved, _ = contour_midpoints([contour + np.array([1000, 700]) for contour in contours[::-1]])
    np.testing.assert_allclose(moved[::-1], midpoint + np.array([1000, 700]))


def test_no_dots_no_image_and_wrong_size_are_statuses():
    of = sensor()
    detect = PaperDetection(threshold=128)
    assert found(detect, of, np.zeros((300, 420), np.uint8)).centre_px.shape == (0, 2)
    assert found(detect, of, None).status == "decode_error"
    assert found(detect, of, np.zeros((420, 300), np.uint8)).status == "wrong_size"


def test_wrong_parameters_and_sensors_are_refused_in_a_sentence():
    of = sensor()
    with pytest.raises(ManytouchError, match="kernel_px is 4"):
        PaperDetection(kernel_px=4).start(of)
    with pytest.raises(SensorError, match="has no \\[markers\\]"):
        PaperDetection().start(Sensor(name="bare", camera=of.camera))
    with pytest.raises(SensorError, match="outside the area of interest"):
        PaperDetection(roi_px=Roi(0, 0, 5, 5)).start(of)


@pytest.mark.parametrize("threshold", [-1, 256])
def test_a_threshold_that_is_no_grey_level_is_refused(threshold):
    with pytest.raises(ManytouchError, match="a grey level from 0 to 255"):
        PaperDetection(threshold=threshold).start(sensor())
