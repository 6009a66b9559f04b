"""The paper's depth, padding, interpolation and peaks: their laws, and the laws that they violate."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layouts import grid_at, lattice_layout
from manytouch.errors import LayoutError, SensorError
from manytouch.geometry.camera import onto_plane, project
from manytouch.geometry.inverse_distance import inverse_distance_plane
from manytouch.geometry.surface_sampling import sample
from manytouch.paper.detection import PaperDetection
from manytouch.paper.estimation import PaperEstimation
from manytouch.paper.quads import Formula, marker_quads, measure
from manytouch.paper.surface import peaks
from manytouch.paper.tracking import PaperTracking
from manytouch.pipeline import Pipeline
from manytouch.sources.simulated import simulated_source
from manytouch.values import Camera, Interpolation, Layout, Phase, Sensor

FORMULAS = get_args(Formula)
ROWS, COLUMNS, PITCH_MM, DISTANCE_MM = 6, 9, np.array([4.0, 5.0]), 110.0


def sensor(rotation=(0.0, 0.0, 0.0), distortion=(0.0, 0.0, 0.0, 0.0, 0.0), rows=ROWS, columns=COLUMNS):
    return Sensor(
        name="test sheet",
        camera=Camera(
            width_px=640,
            height_px=480,
            fx_px=1200.0,
            fy_px=1180.0,
            cx_px=322.0,
            cy_px=236.0,
            distortion=np.array(distortion),
            rotation_vector=np.array(rotation),
            translation_mm=np.array([0.0, 0.0, DISTANCE_MM]),
        ),
        layout=lattice_layout(rows, columns, PITCH_MM),
    )


def grid(position_px, noise_px=0.05):
    return grid_at(position_px, std_px=noise_px)


def seen(of, displacement_mm):
    """The grid that the camera shows of markers moved by (m, 3)."""
    return grid(project(of.camera, of.layout.rest_mm + displacement_mm))


def read(of, *grids, estimate=None):
    estimate = estimate or PaperEstimation()
    state, results = estimate.start(of), []
    for each in grids:
        state, surface, contacts = estimate.step(state, each)
        results.append((surface, contacts))
    return results[-1]


def depth_mm(of, each, **named):
    return -read(of, each, estimate=PaperEstimation(**named))[0].displacement_mm[:, 2]


def bump(of, at_mm, height_mm, width_mm):
    """Depth and its gradient (m, 2) of a Gaussian press."""
    gap = of.layout.rest_mm[:, :2] - np.asarray(at_mm)
    depth = height_mm * np.exp(-0.5 * (gap**2).sum(axis=1) / width_mm**2)
    return depth, -gap / width_mm**2 * depth[:, None]


@settings(max_examples=20, deadline=None)
@given(
    depth=st.floats(-5.0, 20.0),
    tilt=st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-3.0, 3.0)),
    barrel=st.floats(-0.1, 0.0),
)
def test_a_sheet_moved_towards_the_camera_by_z_reads_exactly_z(depth, tilt, barrel):
    # along the sheet's normal, whatever way the camera looks: that is what aligning is for
    of = sensor(rotation=tilt, distortion=(barrel, 0.0, 0.0, 0.0, 0.0))
    toward_eye = np.array([0.0, 0.0, -1.0])
    eye_mm = of.camera.translation_mm
    found = depth_mm(of, seen(of, np.tile(depth * toward_eye, (ROWS * COLUMNS, 1))))
    assert eye_mm[2] == DISTANCE_MM
    np.testing.assert_allclose(found, depth, atol=1e-4)


def test_rest_is_flat_and_sideways_motion_is_no_depth():
    of = sensor()
    aside_mm = np.tile([1.3, -0.7, 0.0], (ROWS * COLUMNS, 1))
    surface, contacts = read(of, seen(of, aside_mm))
    np.testing.assert_allclose(surface.displacement_mm, aside_mm, atol=1e-9)
    np.testing.assert_allclose(surface.position_mm, of.layout.rest_mm + aside_mm, atol=1e-9)
    assert contacts.contacts == ()


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_signed_perimeter_is_the_true_one_of_axis_parallel_quads_and_linear_in_the_corners(seed):
    random = np.random.default_rng(seed)
    (left, top), (width, height) = random.uniform(-9, 9, 2), random.uniform(0.1, 9, 2)
    lower_left, lower_right = [left, top + height], [left + width, top + height]
    upper_right, upper_left = [left + width, top], [left, top]
    box = np.array([lower_left, lower_right, upper_right, upper_left])
    for formula in ("corrected", "side_lengths"):
        np.testing.assert_allclose(measure(box[None], formula)[0], 2 * (width + height))
    np.testing.assert_allclose(measure(box[None], "printed")[0], 2 * width + height)
    np.testing.assert_allclose(measure(box[None], "area")[0], np.sqrt(width * height))
    one, two = random.normal(size=(2, 7, 4, 2))
    for formula in ("corrected", "printed"):
        of_one, of_two, of_both = (measure(each, formula)[0] for each in (one, two, 2.0 * one - 3.0 * two))
        np.testing.assert_allclose(of_both, 2.0 * of_one - 3.0 * of_two)
    shifted = box + random.normal(size=2)
    np.testing.assert_allclose(measure(shifted[None], "corrected")[0], 2 * (width + height))


@pytest.mark.parametrize("formula", FORMULAS)
def test_each_measure_has_the_derivatives_that_it_states(formula):
    random = np.random.default_rng(4)
    corner = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]]) + random.normal(0, 0.2, (5, 4, 2))
    _, derivative = measure(corner, formula)
    for k, d in np.ndindex(4, 2):
        step = np.zeros((4, 2))
        step[k, d] = 1e-6
        slope = (measure(corner + step, formula)[0] - measure(corner - step, formula)[0]) / 2e-6
        np.testing.assert_allclose(derivative[:, k, d], slope, atol=1e-8)


@pytest.mark.parametrize("formula", FORMULAS)
def test_every_reading_of_the_equations_has_the_depth_of_a_sheet_that_only_comes_nearer(formula):
    of = sensor()
    nearer = seen(of, np.tile([0.0, 0.0, -7.0], (ROWS * COLUMNS, 1)))
    np.testing.assert_allclose(depth_mm(of, nearer, formula=formula), 7.0, atol=1e-9)


def test_the_third_term_as_printed_weighs_widths_twice():
    # a stretch along x by e changes 2 (w + h) by 2 w e, but 2 w + h by 2 w e as well: of a smaller whole
    of = sensor()
    wide = seen(of, np.column_stack([0.001 * of.layout.rest_mm[:, 0], np.zeros((ROWS * COLUMNS, 2))]))
    width, height = 2.0 * PITCH_MM
    inner = np.s_[COLUMNS + 1]
    for formula, whole in (("corrected", 2 * (width + height)), ("printed", 2 * width + height)):
        share = 2 * width / whole
        expected = DISTANCE_MM * (1.0 - 1.0 / (1.0 + 0.001 * share))
        assert depth_mm(of, wide, formula=formula)[inner] == pytest.approx(expected, rel=1e-9)


def test_unit_quads_are_averaged_around_each_marker():
    of = sensor()
    depth, _ = bump(of, (3.0, -4.0), 4.0, 9.0)
    after = seen(of, np.column_stack([0.05 * depth, -0.02 * depth, -depth]))
    lattice = (ROWS, COLUMNS, 2)
    before_mm = onto_plane(of.camera, project(of.camera, of.layout.rest_mm))[:, :2].reshape(lattice)
    after_mm = onto_plane(of.camera, after.position_px)[:, :2].reshape(lattice)
    cells = np.zeros((ROWS - 1, COLUMNS - 1))
    for r, c in np.ndindex(*cells.shape):
        sums = [
            (p[r + 1, c, 1] - p[r, c, 1])
            + (p[r + 1, c + 1, 0] - p[r + 1, c, 0])
            + (p[r + 1, c + 1, 1] - p[r, c + 1, 1])
            + (p[r, c + 1, 0] - p[r, c, 0])
            for p in (before_mm, after_mm)
        ]
        cells[r, c] = DISTANCE_MM * (1.0 - sums[0] / sums[1])
    plain = np.zeros((ROWS, COLUMNS))
    for r, c in np.ndindex(ROWS, COLUMNS):
        plain[r, c] = cells[max(r - 1, 0) : r + 1, max(c - 1, 0) : c + 1].mean()
    found = depth_mm(of, after, formula="unit_quads").reshape(ROWS, COLUMNS)
    np.testing.assert_allclose(found, plain, atol=1e-9)


@pytest.mark.parametrize(("padding", "edge"), [("repeat", 3.0), ("zero", 0.0), ("none", np.nan)])
def test_the_edge_is_padded_as_requested(padding, edge):
    of = sensor()
    nearer = seen(of, np.tile([0.0, 0.0, -3.0], (ROWS * COLUMNS, 1)))
    found = depth_mm(of, nearer, padding=padding).reshape(ROWS, COLUMNS)
    np.testing.assert_allclose(found[1:-1, 1:-1], 3.0)
    np.testing.assert_allclose([*found[0], *found[-1], *found[:, 0], *found[:, -1]], edge)


def test_depth_is_that_of_a_plain_computation_marker_by_marker():
    of = sensor()
    depth, _ = bump(of, (3.0, -4.0), 4.0, 9.0)
    after = seen(of, np.column_stack([0.05 * depth, -0.02 * depth, -depth]))
    x0, y0 = onto_plane(of.camera, project(of.camera, of.layout.rest_mm))[:, :2].T.reshape(2, ROWS, COLUMNS)
    x, y = onto_plane(of.camera, after.position_px)[:, :2].T.reshape(2, ROWS, COLUMNS)
    plain = np.zeros((ROWS, COLUMNS))
    for r in range(1, ROWS - 1):
        for c in range(1, COLUMNS - 1):
            sums = [
                (v[r + 1, c - 1] - v[r - 1, c - 1])
                + (u[r + 1, c + 1] - u[r + 1, c - 1])
                + (v[r + 1, c + 1] - v[r - 1, c + 1])
                + (u[r - 1, c + 1] - u[r - 1, c - 1])
                for u, v in ((x0, y0), (x, y))
            ]
            plain[r, c] = DISTANCE_MM * (1.0 - sums[0] / sums[1])
    plain = np.pad(plain[1:-1, 1:-1], 1, mode="edge")
    np.testing.assert_allclose(depth_mm(of, after).reshape(ROWS, COLUMNS), plain, atol=1e-9)


def test_perimeters_measure_depth_plus_slope_plus_stretch():
    # the law of docs/paper.md, in the limit of small deformation and small quads; sides 2 : 2.5
    of = sensor(rows=26, columns=33)
    depth, gradient = bump(of, (9.0, -14.0), 0.02, 30.0)
    radius = of.layout.rest_mm[:, :2]
    weight = PITCH_MM / PITCH_MM.sum()
    stretch = np.array([2e-4, -1e-4])
    moved = np.column_stack([radius * stretch, -depth])
    law = depth + (radius * gradient) @ weight + DISTANCE_MM * stretch @ weight
    found = depth_mm(of, seen(of, moved)).reshape(26, 33)[1:-1, 1:-1]
    np.testing.assert_allclose(found, law.reshape(26, 33)[1:-1, 1:-1], atol=6e-4)
    assert np.abs(law - depth).max() > 6e-3  # so the depth itself would fail


def test_padding_gives_the_edge_the_depth_of_its_inner_neighbour():
    quads = marker_quads(sensor().layout.row_column)
    number = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS)
    np.testing.assert_array_equal(
        quads.depth_from.reshape(ROWS, COLUMNS), np.pad(number[1:-1, 1:-1], 1, mode="edge")
    )
    assert (quads.corner_marker.reshape(ROWS, COLUMNS, 4)[1:-1, 1:-1] >= 0).all()
    of = sensor()
    depth, _ = bump(of, (0.0, 0.0), 3.0, 8.0)
    assert np.isfinite(depth_mm(of, seen(of, np.column_stack([0 * depth, 0 * depth, -depth])))).all()


def test_an_unseen_marker_leaves_out_only_the_quads_it_belongs_to():
    of = sensor()
    position_px = project(of.camera, of.layout.rest_mm)
    gone = 2 * COLUMNS + 4
    position_px[gone] = np.nan
    surface, _ = read(of, grid(position_px))
    unknown = np.flatnonzero(np.isnan(surface.displacement_mm[:, 2]))
    around = [gone + row * COLUMNS + column for row in (-1, 1) for column in (-1, 1)]
    edge = [source - COLUMNS for source in around[:2]]  # padded from row 1
    np.testing.assert_array_equal(unknown, sorted(around + edge))
    np.testing.assert_array_equal(np.isnan(surface.displacement_mm[:, 0]), np.arange(ROWS * COLUMNS) == gone)
    nothing, contacts = read(of, grid(np.full_like(position_px, np.nan)))
    assert nothing.status == "few_markers"
    assert contacts.contacts == ()


@pytest.mark.parametrize(
    "formula",
    [
        pytest.param(name, marks=[] if name in ("printed", "unit_quads") else [pytest.mark.slow])
        for name in FORMULAS
    ],
)
def test_deviations_are_the_observed_scatter(formula):
    of = sensor(distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
    random = np.random.default_rng(7)
    depth, _ = bump(of, (3.0, -4.0), 6.0, 9.0)
    moved_px = project(of.camera, of.layout.rest_mm + np.column_stack([0 * depth, 0 * depth, -depth]))
    estimate = PaperEstimation(
        interpolation=Interpolation(kind="idw", iterations=5)
    )  # the surface between the markers is not used
    state = estimate.start(of)
    readings = []
    for _ in range(300):
        noisy = grid(moved_px + random.normal(0.0, 0.1, moved_px.shape), noise_px=0.1)
        _, surface, _ = estimate.step(state, noisy)
        readings.append(surface.displacement_mm)
    predicted = np.sqrt(np.diagonal(surface.covariance_mm2, axis1=1, axis2=2))
    np.testing.assert_allclose(np.std(readings, axis=0), predicted, rtol=0.2)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_interpolation_passes_through_the_markers_and_stays_within_their_range(seed):
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-8, 8, 5), np.linspace(-6, 6, 4))
    rest_mm = np.column_stack([x.ravel(), y.ravel()])
    value = random.normal(size=len(rest_mm))
    surface = inverse_distance_plane(rest_mm, 13, 5.0, 2.0)
    plane = surface(value)
    assert plane.shape == (13, 13)
    assert value.min() - 1e-9 <= plane.min() <= plane.max() <= value.max() + 1e-9
    np.testing.assert_allclose(plane[::4, ::3].ravel(), value, atol=1e-9)  # 5 columns, 4 rows: every 3rd, 4th
    np.testing.assert_allclose(surface(np.full(len(rest_mm), 2.5)), 2.5)


def test_interpolation_is_the_plain_double_loop_and_knows_where_it_knows_nothing():
    of = sensor()
    value, _ = bump(of, (2.0, 3.0), 4.0, 5.0)
    value[10] = np.nan
    rest_mm = of.layout.rest_mm[:, :2]
    surface = inverse_distance_plane(rest_mm, 11, 6.0, 3.0)
    plain = np.full((11, 11), np.nan)
    for i, y in enumerate(surface.y_mm):
        for j, x in enumerate(surface.x_mm):
            gap = np.hypot(rest_mm[:, 0] - x, rest_mm[:, 1] - y)
            use = (gap <= 6.0) & np.isfinite(value)
            weight = 1.0 / np.maximum(gap[use], 6e-6) ** 3
            plain[i, j] = (weight * value[use]).sum() / weight.sum()
    np.testing.assert_allclose(surface(value), plain, atol=1e-9)
    lonely = np.full(len(value), np.nan)
    lonely[0] = 1.0
    known = np.isfinite(surface(lonely))
    assert known[0, 0]
    assert 0 < known.sum() < 20


def test_peaks_are_deep_enough_apart_enough_and_deepest_first():
    plane = np.zeros((20, 30))
    plane[5, 5], plane[5, 7], plane[15, 20], plane[0, 29], plane[10, 10] = 2.0, 3.0, 5.0, 1.5, 0.4
    plane[18, 3:5] = 1.2  # a flat top
    plane[2, 2] = np.nan
    row, column = peaks(plane, 1.0, np.ones((7, 7), np.uint8))
    assert list(zip(row.tolist(), column.tolist(), strict=True)) == [(15, 20), (5, 7), (0, 29), (18, 3)]
    row, _ = peaks(np.full((20, 30), np.nan), 1.0, np.ones((7, 7), np.uint8))
    assert len(row) == 0


def test_layouts_without_rows_or_sensors_without_markers_raise():
    of = sensor()
    estimate = PaperEstimation()
    with pytest.raises(SensorError, match="has no \\[markers\\]"):
        estimate.start(Sensor(name="bare", camera=of.camera))
    with pytest.raises(LayoutError, match="2 x 9 markers"):
        estimate.start(sensor(rows=2))
    with pytest.raises(LayoutError, match="not a rectangle"):
        estimate.start(
            Sensor(
                name="ring",
                camera=of.camera,
                layout=Layout(
                    rest_mm=of.layout.rest_mm,
                    row_column=None,
                    pitch_mm=PITCH_MM,
                    radius_mm=of.layout.radius_mm,
                    polarity="light",
                    is_missing=of.layout.is_missing,
                ),
            )
        )


def test_a_press_on_the_axis_is_one_contact_that_starts_moves_and_ends():
    of = sensor(rows=9, columns=13)
    depth, _ = bump(of, (0.0, 0.0), 3.0, 6.0)
    flat, pressed = np.zeros((9 * 13, 3)), np.column_stack([0 * depth, 0 * depth, -depth])
    estimate = PaperEstimation(contact_depth_pitch=0.2)
    state, reported = estimate.start(of), []
    for displacement_mm in (flat, pressed, pressed, flat, flat, pressed):
        state, _, contacts = estimate.step(state, seen(of, displacement_mm))
        reported.append([(contact.id, contact.phase) for contact in contacts.contacts])
    assert reported == [[], [(0, Phase.START)], [(0, Phase.MOVE)], [(0, Phase.END)], [], [(1, Phase.START)]]


def test_a_contact_has_known_fields_only():
    of = sensor(rows=9, columns=13)
    depth, _ = bump(of, (0.0, 0.0), 3.0, 12.0)
    moved = np.column_stack([np.full_like(depth, 0.5), 0 * depth, -depth])
    _, contacts = read(of, seen(of, moved), estimate=PaperEstimation(contact_depth_pitch=0.2))
    (contact,) = contacts.touching
    assert np.abs(contact.centre_mm).max() < 0.5
    assert contact.depth_mm == pytest.approx(3.0, rel=0.3)
    there_px = project(of.camera, np.array([[0.5, 0.0, -3.0]]))[0]
    np.testing.assert_allclose(contact.centre_px, there_px, atol=3.0)
    assert np.isnan([*contact.force_N, contact.torque_Nmm, contact.area_mm2]).all()
    assert np.isnan(contact.covariance).all()  # which-method.md: no standard deviations


@pytest.mark.parametrize("kind", ["idw", "spline"])
def test_contacts_are_points_of_the_surface_that_is_drawn(kind):
    of = sensor(rows=9, columns=13)
    depth, _ = bump(of, (3.0, -4.0), 3.0, 6.0)
    moved = np.column_stack([0 * depth, 0 * depth, -depth])
    estimate = PaperEstimation(contact_depth_pitch=0.2, interpolation=Interpolation(kind=kind, iterations=40))
    surface, contacts = read(of, seen(of, moved), estimate=estimate)
    assert surface.interpolation.kind == kind
    (contact,) = contacts.touching
    around = contact.centre_mm + 0.1 * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    here, *others = sample(surface, *around.T).depth_mm
    assert contact.depth_mm == pytest.approx(here, abs=1e-9)
    assert max(others) <= here + (1e-9 if kind == "idw" else 0.02)


def test_whole_chain_on_rendered_pictures_gives_one_contact_for_one_press():
    simulator = simulated_source("one", seed=1).simulator
    pipeline = Pipeline(detect=PaperDetection(), track=PaperTracking(), estimate=PaperEstimation())
    frames = [simulator.frame(index) for index in (0, 60, 75, 90)]
    readings = list(pipeline.run(frames, simulator.sensor))
    assert [reading.status for reading in readings] == ["ok"] * 4
    assert all(reading.grid.is_seen.all() for reading in readings)
    assert readings[0].contacts.contacts == ()
    (truth,) = simulator.truth(90).contacts.touching
    (contact,) = readings[-1].contacts.touching
    assert contact.phase is Phase.MOVE
    assert np.linalg.norm(contact.centre_mm - truth.centre_mm) < 2 * 4.0
    # towards the axis, as the slope's term of docs/paper.md draws it
    assert np.linalg.norm(contact.centre_mm) < np.linalg.norm(truth.centre_mm)
    true_px = simulator.truth(90).grid.position_px
    assert np.linalg.norm(readings[-1].grid.position_px - true_px, axis=1).max() < 0.5
