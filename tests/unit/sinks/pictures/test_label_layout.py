"""Labels stay inside the image and do not overlap."""

from hypothesis import given
from hypothesis import strategies as st

from manytouch.sinks.pictures.label_layout import Rectangle, place_label

WIDTH, HEIGHT, SIZE = 960, 720, (150.0, 30.0)
CIRCLES = st.tuples(st.floats(0, WIDTH), st.floats(0, HEIGHT), st.floats(2, 60))


@given(circles=st.lists(CIRCLES, min_size=1, max_size=10))
def test_labels_stay_inside_and_apart(circles: list[tuple[float, float, float]]) -> None:
    placed: list[Rectangle] = []
    for circle in circles:
        label = place_label(circle, SIZE, (WIDTH, HEIGHT), placed)
        assert 0 <= label.left <= WIDTH - label.width
        assert 0 <= label.top <= HEIGHT - label.height
        assert not any(label.overlaps(other) for other in placed)
        placed.append(label)


def test_a_single_label_is_above_its_circle_or_below_at_the_upper_edge() -> None:
    above = place_label((300.0, 400.0, 20.0), SIZE, (WIDTH, HEIGHT), ())
    assert above.left + above.width / 2 == 300.0
    assert above.top + above.height < 380.0
    below = place_label((300.0, 10.0, 20.0), SIZE, (WIDTH, HEIGHT), ())
    assert below.top > 30.0


def test_rectangles_that_touch_do_not_overlap() -> None:
    assert not Rectangle(0, 0, 10, 10).overlaps(Rectangle(10, 0, 5, 5))
    assert Rectangle(0, 0, 10, 10).overlaps(Rectangle(9, 9, 5, 5))
