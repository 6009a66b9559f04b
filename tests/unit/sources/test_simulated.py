"""The simulated sensor as a source."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.geometry.camera import project
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.sheet import sheet_solver, solve_sheet
from manytouch.simulation.render.discs import Look
from manytouch.simulation.render.dot_ellipses import polygon_ellipses
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.file import BUILT_IN, load_scene
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.solve_scene import LIBRARY, shipped_states, solid_problem
from manytouch.sources import open_source
from manytouch.sources.simulated import SimulatedSource, simulated_source

SCENE = """
schema = 1
name = "mine"
seconds = 1.0
fps = 10.0
sensor = "demo"
width_px = 320
[solid]
element_mm = 10.0
[[bodies]]
shape = { kind = "sphere", radius_mm = 12.0 }
motions = [{ kind = "press", at_mm = [5.0, 5.0], depth_mm = 0.6, start_s = 0.2, end_s = 0.8, ramp_s = 0.2 }]
"""


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


@pytest.mark.usefixtures("each_is_computed_again")
def test_each_iteration_gives_the_same_bits() -> None:
    source = simulated_source("one", fps=1.0, width_px=320)
    pictures = [[frame.image for frame in source] for _ in range(2)]
    assert len(pictures[0]) == source.frame_count == 6
    assert all(np.array_equal(a, b) for a, b in zip(*pictures, strict=True))
    assert [frame.timestamp_ns for frame in source][:3] == [0, 1_000_000_000, 2_000_000_000]


def test_truth_goes_with_the_frames() -> None:
    source = simulated_source("one", fps=2.0, width_px=320)
    counts = [len(source.truth(index).contacts.touching) for index in range(source.frame_count)]
    assert counts == [0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 0, 0]
    assert source.truth(6).frame_index == 6
    assert -source.truth(6).surface.displacement_mm[:, 2].min() > 2


def test_seconds_and_rates_are_free() -> None:
    assert open_source("sim:rest", fps=12.5).frame_count == 62
    longer = simulated_source().lasting(12.0)
    assert longer.frame_count == 360
    assert longer.truth(345).contacts.touching[0].id == simulated_source().simulator.scene.touch_count
    assert longer.name == "sim-fingers"


def test_seeds_differ_in_their_noise_alone() -> None:
    one, other = simulated_source("one", seed=1), simulated_source("one", seed=2)
    assert one.truth(90).contacts.touching[0].centre_mm == pytest.approx(
        other.truth(90).contacts.touching[0].centre_mm
    )
    assert not np.array_equal(one.simulator.frame(90).image, other.simulator.frame(90).image)


@pytest.mark.parametrize("name", ["fingers", "one", "pad", "skin"])
def test_what_is_shipped_answers_the_scenes_question(name: str) -> None:
    scene = load_scene(BUILT_IN / f"{name}.toml")
    states = shipped_states(name, solid_problem(scene).keys)
    assert states is not None, "run python benchmarks/ship_scenes.py"
    assert {state.status for state in states} == {"ok"}
    touching = [contact for state in states for contact in state.contacts if contact.is_touching]
    assert touching
    assert all(contact.region_mm2 > contact.area_mm2 for contact in touching)
    assert (LIBRARY / f"{name}.npz").stat().st_size < 1_500_000


def test_a_shipped_state_is_what_the_solver_finds() -> None:
    """A keyframe in the middle of the press, reached at once on coarser elements."""
    scene = load_scene(BUILT_IN / "one.toml")
    wanted = solid_problem(scene)
    number = len(wanted.keys) // 2
    states = shipped_states("one", wanted.keys)
    assert states is not None
    assert wanted.loading is not None
    touch = wanted.loading.touches[0]
    place = slice(number, number + 1)
    once = replace(touch, position_mm=touch.position_mm[place], rotation_vector=touch.rotation_vector[place])
    loading = Loading(touches=(once,))
    (state,) = solve_sheet(sheet_solver(replace(wanted.model, element_mm=5.0)), loading)
    shipped, found = states[number], condense(state, loading)
    assert found.contacts[0].normal_force_N == pytest.approx(shipped.contacts[0].normal_force_N, rel=0.05)
    place_mm = np.array([[14.0, -8.0], [0.0, 0.0], [-30.0, 10.0], [40.0, -25.0]])
    np.testing.assert_allclose(found.displacement_mm(place_mm), shipped.displacement_mm(place_mm), atol=0.06)


def test_a_scene_of_ones_own_is_solved_and_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MANYTOUCH_STATES", str(tmp_path / "states"))
    path = tmp_path / "mine.toml"
    path.write_text(SCENE)
    source = open_source(f"sim:{path}")
    assert isinstance(source, SimulatedSource)
    assert (source.name, source.width_px, source.fps, source.frame_count) == ("sim-mine", 320, 10.0, 10)
    contact = source.truth(5).contacts.touching[0]
    assert 0.3 < contact.depth_mm < 0.6
    pitch_mm = float(load_scene(path).layout.pitch_mm[0])
    point_mm2 = -2.0 * np.log(0.05) * np.pi * (0.5 * pitch_mm) ** 2  # of the region of a point force
    assert point_mm2 < contact.area_mm2 < 2.0 * point_mm2
    assert 0.0 < contact.half_minor_mm <= contact.half_major_mm < pitch_mm
    assert len(list((tmp_path / "states").iterdir())) == len(solid_problem(load_scene(path)).keys)


def test_an_unknown_scene_lists_those_there_are() -> None:
    with pytest.raises(SourceError, match="fingers, one, pad, rest"):
        simulated_source("two")


def test_pictures_of_the_bent_sheet_show_the_dots_where_the_truth_has_them() -> None:
    """Centroids in even light without noise, dots around the deepest press among them."""
    source = simulated_source("one")
    plain = replace(source.simulator, look=Look(ground=0.0, dot=255.0))
    image = np.asarray(plain.frame(90).image, dtype=np.float64)
    truth = plain.truth(90)
    assert -truth.surface.displacement_mm[:, 2].min() > 5.0
    for marker in [*range(0, 600, 23), *np.argsort(truth.surface.displacement_mm[:, 2])[:8]]:
        x, y = np.rint(truth.grid.position_px[marker]).astype(int)
        window = image[y - 15 : y + 16, x - 15 : x + 16]
        rows, columns = np.indices(window.shape)
        found = np.array([(columns * window).sum(), (rows * window).sum()]) / window.sum() + [x - 15, y - 15]
        assert found == pytest.approx(truth.grid.position_px[marker], abs=0.01)


def test_an_outline_has_corners_enough_for_the_solved_sheet() -> None:
    source = simulated_source("one")
    layout, camera = source.sensor.layout, source.sensor.camera
    assert layout is not None
    scene = source.simulator.scene
    assert isinstance(scene, SolidScene)
    truth = source.truth(90)
    angle = 2 * np.pi * np.arange(360) / 360
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(360)])
    for marker in np.argsort(truth.surface.displacement_mm[:, 2])[:30]:
        outline_mm = layout.rest_mm[marker] + layout.radius_mm[marker] * circle
        outline_mm += scene.motion_of(outline_mm[:, :2])(3.0)
        centre_px, _ = polygon_ellipses(project(camera, outline_mm)[None])
        assert centre_px[0] == pytest.approx(truth.grid.position_px[marker], abs=0.003)


def test_less_than_a_frame_is_refused() -> None:
    with pytest.raises(SourceError, match=r"0\.001 s of the sensor contain no frame: give 0\.033 s"):
        simulated_source().lasting(0.001)
