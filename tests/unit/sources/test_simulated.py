"""The simulated sensor as a source."""

import numpy as np
import pytest

from manytouch.sources import open_source
from manytouch.sources.simulated import SimulatedSource, simulated_source


def test_the_default_scene_and_its_facts() -> None:
    source = open_source("sim:")
    assert isinstance(source, SimulatedSource)
    assert (source.name, source.fps, source.frame_count) == ("sim-fingers", 30.0, 300)
    first = next(iter(source))
    assert first.image.shape == (source.height_px, source.width_px)
    assert (source.sensor.camera.width_px, source.sensor.camera.height_px) == (
        source.width_px,
        source.height_px,
    )
    assert first.camera == source.name
    assert not first.image.flags.writeable


def test_each_iteration_gives_the_same_bits() -> None:
    source = simulated_source("one", fps=2.0)
    pictures = [[frame.image for frame in source] for _ in range(2)]
    assert len(pictures[0]) == source.frame_count == 12
    assert all(np.array_equal(a, b) for a, b in zip(*pictures, strict=True))
    assert [frame.timestamp_ns for frame in source][:3] == [0, 500_000_000, 1_000_000_000]


def test_truth_goes_with_the_frames() -> None:
    source = simulated_source("one", fps=2.0)
    counts = [len(source.truth(index).contacts.touching) for index in range(source.frame_count)]
    assert counts == [0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 0, 0]
    assert source.truth(6).frame_index == 6
    assert -source.truth(6).surface.displacement_mm[:, 2].min() > 2


def test_seconds_and_rates_are_free() -> None:
    assert open_source("sim:rest", fps=12.5).frame_count == 62
    longer = simulated_source().lasting(12.0)
    assert longer.frame_count == 360
    assert longer.truth(345).contacts.touching[0].id == len(simulated_source().simulator.scene.presses)
    assert longer.name == "sim-fingers"


def test_seeds_differ() -> None:
    one, other = simulated_source(seed=1), simulated_source(seed=2)
    assert one.truth(90).contacts.touching[0].centre_mm != pytest.approx(
        other.truth(90).contacts.touching[0].centre_mm
    )
