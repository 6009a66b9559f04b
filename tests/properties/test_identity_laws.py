"""Identities under any smooth motion, dropout and order of the dots, and in any view of the same sheet."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from flat_sensor import detections_of, flat_sensor, rectangle_px, rows_and_columns
from manytouch.detection import DotSearch
from manytouch.tracking import MarkerTracker
from manytouch.values import Frame

WIDTH, HEIGHT, PITCH = 760, 560, 40.0
ROWS, COLUMNS = 9, 13


LATTICE = rows_and_columns(ROWS, COLUMNS)


def sensor_of(rest_px, width_px=WIDTH, height_px=HEIGHT, *, row_column=LATTICE, scale=1.0, polarity="light"):
    return flat_sensor(
        rest_px,
        width_px=width_px,
        height_px=height_px,
        pitch_px=scale * PITCH,
        radius_px=scale * 8.0,
        row_column=row_column,
        polarity=polarity,
    )


def dots_of(centre_px):
    return detections_of(centre_px, std_px=0.01)


def rest_of():
    return rectangle_px(ROWS, COLUMNS, (PITCH, PITCH), (140.0, 120.0))


def tracked(sensor, frames_px):
    """Grids of a sequence of dots (n, 2)."""
    tracker = MarkerTracker()
    state = tracker.start(sensor)
    grids = []
    for dots in frames_px:
        state, grid = tracker.step(state, dots_of(dots))
        grids.append(grid)
    return grids


def frames(seed, step, dropout, number=4):
    """True places, visibility and dots (with false ones) of a few frames."""
    rng = np.random.default_rng(seed)
    rest = rest_of()
    centre = rest.mean(axis=0) + rng.uniform(-0.3, 0.3, 2) * np.ptp(rest, axis=0)
    bell = np.exp(-0.5 * ((rest - centre) ** 2).sum(axis=1, keepdims=True) / (3.5 * PITCH) ** 2)
    angle = rng.uniform(0, 2 * np.pi)
    for k in range(number):
        true = rest + step * PITCH * (k % 2) * bell * np.array([np.cos(angle), np.sin(angle)])
        visible = rng.random(len(rest)) >= dropout
        false = rng.uniform(rest.min(axis=0), rest.max(axis=0), (3, 2))
        away = np.linalg.norm(false[:, None] - true, axis=2).min(axis=1)
        dots = np.concatenate([true[visible], false[away > 0.3 * PITCH]])
        yield true, visible, dots + rng.normal(0.0, 0.01, dots.shape)


seeds, steps = st.integers(0, 2**32 - 1), st.sampled_from([0.1, 0.5, 1.0, 1.5])


@settings(max_examples=40, deadline=None)
@given(seed=seeds, step=steps, dropout=st.sampled_from([0.0, 0.05, 0.3]))
@example(seed=9668047, step=0.5, dropout=0.3)  # two false dots one pitch apart, next to missing ones
def test_seen_is_at_its_own_place_and_no_dot_has_two_markers(seed, step, dropout):
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest_of()))
    for true, _, dots in frames(seed, step, dropout):
        state, grid = tracker.step(state, dots_of(dots))
        seen = grid.position_px[grid.is_seen]
        assert len(np.unique(seen, axis=0)) == len(seen)
        assert np.isnan(grid.position_px[~grid.is_seen]).all()
        assert (np.linalg.norm(seen - true[grid.is_seen], axis=1) < 0.45 * PITCH).all()


@settings(max_examples=25, deadline=None)
@given(seed=seeds, step=steps)
def test_the_order_of_dots_changes_nothing(seed, step):
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest_of()))
    order = np.random.default_rng(seed)
    for _, _, dots in frames(seed, step, 0.05):
        _, other = tracker.step(state, dots_of(order.permutation(dots)))
        state, grid = tracker.step(state, dots_of(dots))
        np.testing.assert_array_equal(grid.position_px, other.position_px)


@settings(max_examples=25, deadline=None)
@given(seed=seeds, step=steps, x=st.integers(-60, 60), y=st.integers(-60, 60))
def test_a_translation_of_the_view_translates_the_positions(seed, step, x, y):
    move = np.array([x, y], dtype=np.float64)
    size = (WIDTH + 400, HEIGHT + 400)
    sequence = [dots + 200.0 for _, _, dots in frames(seed, step, 0.05)]
    first = tracked(sensor_of(rest_of() + 200.0, *size), sequence)
    second = tracked(sensor_of(rest_of() + 200.0 + move, *size), [dots + move for dots in sequence])
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.is_seen, other.is_seen)
        np.testing.assert_allclose(one.position_px + move, other.position_px, atol=1e-9)


TURNS = {
    "quarter turn": np.array([[0.0, -1.0], [1.0, 0.0]]),
    "half turn": np.array([[-1.0, 0.0], [0.0, -1.0]]),
    "mirrored": np.array([[-1.0, 0.0], [0.0, 1.0]]),
    "turned by 0.4 rad": np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]]),
}
SIDE = 1100  # of a square image that contains the sheet in every view


@settings(max_examples=40, deadline=None)
@given(
    seed=seeds,
    step=steps,
    turn=st.sampled_from(sorted(TURNS)),
    scale=st.sampled_from([0.75, 1.0, 1.25]),
    shift_px=st.tuples(st.integers(-60, 60), st.integers(-60, 60)),
)
def test_identities_do_not_depend_on_rotation_mirror_scale_and_position_of_the_view(
    seed, step, turn, scale, shift_px
):
    middle = np.full(2, 0.5 * SIDE)
    rest = rest_of() - rest_of().mean(axis=0)
    sequence = [dots - rest_of().mean(axis=0) for _, _, dots in frames(seed, step, 0.05)]

    def view(point):
        return scale * point @ TURNS[turn].T + middle + np.array(shift_px)

    first = tracked(sensor_of(rest + middle, SIDE, SIDE), [dots + middle for dots in sequence])
    second = tracked(
        sensor_of(view(rest), SIDE, SIDE, scale=scale),
        [view(dots) for dots in sequence],
    )
    for one, other in zip(first, second, strict=True):
        # Decisions at the edge of a gate may differ by rounding and by the noise, which is not scaled.
        assert (one.is_seen != other.is_seen).mean() <= 0.02
        both = one.is_seen & other.is_seen
        np.testing.assert_allclose(view(one.position_px[both] - middle), other.position_px[both], atol=1e-6)


@settings(max_examples=15, deadline=None)
@given(seed=seeds, step=steps)
def test_the_order_of_markers_in_the_layout_changes_nothing(seed, step):
    order = np.random.default_rng(seed).permutation(ROWS * COLUMNS)
    sequence = [dots for _, _, dots in frames(seed, step, 0.05)]
    first = tracked(sensor_of(rest_of()), sequence)
    second = tracked(sensor_of(rest_of()[order], row_column=LATTICE[order]), sequence)
    for one, other in zip(first, second, strict=True):
        both = one.is_seen[order] & other.is_seen
        assert (one.is_seen[order] != other.is_seen).mean() <= 0.02
        np.testing.assert_array_equal(one.position_px[order][both], other.position_px[both])


@settings(max_examples=8, deadline=None)
@given(seed=seeds)
def test_identities_do_not_depend_on_polarity(seed):
    rest, radius = rest_of(), 8.0
    sequence = [true for true, _, _ in frames(seed, 0.5, 0.0, number=3)]
    grids = {}
    for polarity in ("light", "dark"):
        sensor = sensor_of(rest, polarity=polarity)
        search, tracker = DotSearch(), MarkerTracker()
        search_state, state = search.start(sensor), tracker.start(sensor)
        grids[polarity] = []
        for index, true in enumerate(sequence):
            image = disc_image(true, radius, np.random.default_rng(index))
            image = image if polarity == "light" else 255 - image
            frame = Frame(index=index, timestamp_ns=index, camera="test", image=image)
            search_state, detections = search.step(search_state, frame, None)
            state, grid = tracker.step(state, detections)
            grids[polarity].append(grid)
            error = np.linalg.norm(grid.position_px - true, axis=1)
            assert grid.is_seen.all()
            assert error.max() < 0.2
    for light, dark in zip(*grids.values(), strict=True):
        np.testing.assert_array_equal(light.is_seen, dark.is_seen)
        np.testing.assert_allclose(light.position_px, dark.position_px, atol=0.02)


def disc_image(centre_px, radius_px, chance):
    """(h, w) uint8 light discs with smooth edges on dark ground, with noise of one grey level."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    image = np.full((HEIGHT, WIDTH), 60.0, dtype=np.float32)
    reach = int(radius_px) + 4
    for cx, cy in centre_px:
        rows = slice(max(0, int(cy) - reach), int(cy) + reach + 1)
        columns = slice(max(0, int(cx) - reach), int(cx) + reach + 1)
        distance = np.hypot(x[rows, columns] - cx, y[rows, columns] - cy)
        image[rows, columns] += 130.0 / (1.0 + np.exp((distance - radius_px) / 0.5))
    return np.round(image + chance.normal(0.0, 1.0, image.shape)).clip(0, 255).astype(np.uint8)
