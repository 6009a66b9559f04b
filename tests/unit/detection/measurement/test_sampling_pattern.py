"""Sampling patterns are where they should be, and similar radii share one."""

import numpy as np

from manytouch.detection.measurement.sampling_pattern import (
    CORE,
    LANES,
    RING,
    STEP,
    ring_radii,
    sampling_patterns,
    window_radius,
)
from manytouch.detection.measurement.simd_strip_sums import STRIP


def test_samples_and_mask_cover_ring_core_and_window() -> None:
    radius_px = np.array([8.0, 2.0, 7.95])
    patterns = sampling_patterns(radius_px)
    assert patterns.row[0] == patterns.row[2] != patterns.row[1]
    for radius, row in zip(radius_px, patterns.row, strict=True):
        offset, number = patterns.offset[row], patterns.number[row]
        ring = np.hypot(*offset[:, RING * LANES : RING * LANES + number[RING]])
        assert (ring > radius + 0.5).all()
        assert np.abs(offset[:, RING * LANES : RING * LANES + number[RING]].sum(axis=1)).max() == 0
        inner, outer = ring_radii(radius)
        assert ((ring > 0.95 * inner - 1.3) & (ring < 1.05 * outer + 1.3)).all()
        core = np.hypot(*offset[:, CORE * LANES : CORE * LANES + number[CORE]])
        assert (core < max(0.75 * radius, 1.9)).all()
        for part, values in ((RING, ring), (CORE, core)):
            places = offset[:, part * LANES : part * LANES + number[part]]
            assert len(np.unique(places, axis=1).T) == len(values)
        half, strips = patterns.half[row], patterns.strips[row]
        rows = patterns.mask[row][: strips * (2 * half + 1)].reshape(strips, 2 * half + 1).T
        bits = np.hstack([rows[:, [s]] >> np.arange(STRIP) & 1 for s in range(strips)])[:, : 2 * half + 1]
        u, v = np.meshgrid(np.arange(-half, half + 1), np.arange(-half, half + 1))
        shared_radius = STEP ** np.rint(np.log(radius) / np.log(STEP))
        np.testing.assert_array_equal(bits, np.hypot(u, v) <= window_radius(shared_radius) + 0.3)
        assert bits.sum() == sum(int(bits).bit_count() for bits in patterns.mask[row])
        assert patterns.reach[row] >= max(np.abs(offset).max(), half)


def test_patterns_of_some_radii_are_those_of_all() -> None:
    patterns = sampling_patterns(np.array([3.0, 9.0, 5.0]))
    np.testing.assert_array_equal(patterns.at(np.array([2, 0])).row, patterns.row[[2, 0]])
