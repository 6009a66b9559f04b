"""The guesses that a frame is matched from."""

import numba

from manytouch.tracking.matching import match_frame
from manytouch.values.arrays import read_only
from unit.tracking.matching.conftest import PITCH, make_scene


def test_all_guesses_have_the_type_of_the_first_so_that_kernels_are_compiled_once() -> None:
    scene = make_scene(0)
    guess_px = read_only(scene.graph.arrays.rest_px[: scene.graph.marker_count] + 0.7 * PITCH)
    others = list(match_frame.other_guesses(scene.graph, scene.dots.centre_px, guess_px))
    assert len(others) > 2
    assert {numba.typeof(other) for other in others} == {numba.typeof(guess_px)}
