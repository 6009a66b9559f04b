"""Noise of marker images that their detection does not know of."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float64

from manytouch.estimation.excess_noise import ExcessNoise, ExcessNoiseState
from manytouch.geometry.neighbours import nearest_neighbours
from manytouch.values import TrackedGrid

COLUMNS, ROWS = 14, 10
STD_PX = 0.01
PLACE = np.stack(np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)), axis=-1).reshape(-1, 2) * 30.0
COUNT = len(PLACE)
ALL = np.ones(COUNT, dtype=np.bool_)
NEIGHBOURS = nearest_neighbours(PLACE)

Images = Float64[np.ndarray, "m 2"]


def grid_at(position_px: Images) -> TrackedGrid:
    return TrackedGrid(
        position_px=position_px,
        covariance_px2=np.tile(STD_PX**2 * np.eye(2), (COUNT, 1, 1)),
        is_seen=ALL,
        frames_unseen=np.zeros(COUNT, dtype=np.int64),
    )


def observed(noise: ExcessNoise, frames: list[Images]) -> ExcessNoiseState:
    state = noise.start(COUNT)
    for position_px in frames:
        state = noise.observe(state, grid_at(position_px))
    return state


def test_pictures_of_their_own_with_noise_are_not_compressed() -> None:
    random, noise = np.random.default_rng(1), ExcessNoise()
    frames = [PLACE + random.normal(0.0, STD_PX, PLACE.shape) for _ in range(60)]
    state = observed(noise, frames)
    assert not state.is_compressed
    assert 0.0 < state.held_share < 0.02
    assert state.variance_px2 == 0.0


def test_markers_that_stay_exactly_where_they_were_show_that_a_video_is_compressed() -> None:
    random, noise = np.random.default_rng(1), ExcessNoise()
    frames = [PLACE + random.normal(0.0, STD_PX, PLACE.shape)]
    for _ in range(30):
        is_new = random.random(COUNT) > 0.3
        frames.append(np.where(is_new[:, None], PLACE + random.normal(0.0, STD_PX, PLACE.shape), frames[-1]))
    state = observed(noise, frames)
    assert state.is_compressed
    assert state.variance_px2 == noise.compressed_std_px**2
    rough = replace(state, variance_px2=0.01)
    for k in range(40):
        rough = noise.observe(rough, grid_at(frames[0] + 0.2 * k * (PLACE > 200.0)))
    assert rough.is_compressed
    assert rough.variance_px2 == 0.01


def test_the_same_picture_again_does_not_show_that_a_video_is_compressed() -> None:
    random, noise = np.random.default_rng(2), ExcessNoise()
    own = [PLACE + random.normal(0.0, STD_PX, PLACE.shape) for _ in range(20)]
    twice = [each for each in own for _ in range(3)]
    assert not observed(noise, twice).is_compressed
    held = [np.where(PLACE[:, :1] > 200.0, each, own[0]) for each in own]
    assert observed(noise, [*twice, *held]).is_compressed


def test_markers_that_nothing_moves_in_pictures_without_noise_do_not_show_that_a_video_is_compressed() -> (
    None
):
    noise, pressed = ExcessNoise(), PLACE.copy()
    frames = [PLACE] * (noise.noiseless_frames + 1)
    for _ in range(20):
        pressed = pressed.copy()
        pressed[:30] += 0.1
        frames.append(pressed)
    assert not observed(noise, frames).is_compressed
    assert observed(noise, frames[2:]).is_compressed


@pytest.mark.parametrize("std_px", [0.03, 0.1])
def test_residuals_that_differ_among_neighbours_by_more_than_expected_show_the_excess(std_px: float) -> None:
    random, noise, state = np.random.default_rng(3), ExcessNoise(), ExcessNoise().start(COUNT)
    for _ in range(5):
        residual_px = random.normal(0.0, np.hypot(std_px, STD_PX), PLACE.shape)
        assumed_px2 = np.full(COUNT, STD_PX**2 + state.variance_px2)
        state = noise.update(state, residual_px, assumed_px2, ALL, NEIGHBOURS)
    assert state.variance_px2**0.5 == pytest.approx(std_px, rel=0.15)
    calm = noise.update(state, np.zeros(PLACE.shape), assumed_px2, ALL, NEIGHBOURS)
    assert calm.variance_px2 == pytest.approx((1.0 - noise.share) * state.variance_px2, rel=0.1)
    least = replace(state, is_compressed=True, variance_px2=noise.compressed_std_px**2)
    for _ in range(3):
        least = noise.update(least, np.zeros(PLACE.shape), assumed_px2, ALL, NEIGHBOURS)
    assert least.variance_px2 == pytest.approx(noise.compressed_std_px**2)


def test_residuals_that_near_markers_have_in_common_or_that_few_have_show_none() -> None:
    random, noise, state = np.random.default_rng(4), ExcessNoise(), ExcessNoise().start(COUNT)
    own_px = random.normal(0.0, 0.8 * STD_PX, PLACE.shape)
    smooth_px = 0.1 * np.sin(PLACE / 200.0)
    few_px = np.zeros(PLACE.shape)
    few_px[:6] = random.normal(0.0, 1.0, (6, 2))
    assumed_px2 = np.full(COUNT, STD_PX**2)
    for more_px in (0.0, smooth_px, few_px):
        found = noise.update(state, own_px + more_px, assumed_px2, ALL, NEIGHBOURS)
        assert found.variance_px2 == 0.0
    unused = ALL.copy()
    unused[::3] = False
    wild_px = np.where(unused[:, None], own_px, np.nan_to_num(1e3 * own_px))
    assert noise.update(state, wild_px, assumed_px2, unused, NEIGHBOURS).variance_px2 == 0.0
