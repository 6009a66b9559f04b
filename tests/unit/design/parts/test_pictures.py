"""The picture of the parts."""

import numpy as np
import pytest

from manytouch.design.parts import pictures
from manytouch.design.parts.meshing import make_mesh
from manytouch.design.parts.pictures import RISE_DEG, TURN_DEG, render_meshes
from manytouch.design.parts.solids import Solid, block


def test_near_parts_hide_far_ones(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(pictures, "SAMPLES_PER_PX", 2.5)
    low = make_mesh(Solid(joined=(block((20.0, 20.0), (0.0, 2.0)),)))
    high = make_mesh(Solid(joined=(block((8.0, 8.0), (2.0, 12.0)),)))
    seen = render_meshes([low.corners_mm, high.corners_mm], ["#ff0000", "#0000ff"]).astype(float)
    under = render_meshes([high.corners_mm, low.corners_mm], ["#0000ff", "#ff0000"]).astype(float)
    assert np.mean(np.abs(seen - under).max(axis=2) > 100) < 0.005  # their order does not matter
    is_paper = (seen == 255).all(axis=2)
    red, blue = (seen[..., channel] > 1.3 * seen[..., 2 - channel] for channel in (0, 2))
    assert is_paper[0, 0]
    area = {name: float((chosen & ~is_paper).sum()) for name, chosen in (("red", red), ("blue", blue))}
    turn, rise = np.deg2rad([TURN_DEG, RISE_DEG])
    px_per_mm = (seen.shape[1] - 3) / (20.0 * (np.cos(turn) + np.sin(turn)))
    top = 64.0 * np.sin(rise)
    sides = 8.0 * 10.0 * np.cos(rise) * (np.cos(turn) + np.sin(turn))
    assert area["blue"] == pytest.approx((top + sides) * px_per_mm**2, rel=0.03)
    whole = 400.0 * np.sin(rise) + 20.0 * 2.0 * np.cos(rise) * (np.cos(turn) + np.sin(turn))
    assert 0.5 * whole * px_per_mm**2 < area["red"] < (whole - 64.0 * np.sin(rise)) * px_per_mm**2
