"""The example scenes: right, and what they show is there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manytouch.simulation.scene.file import load_scene
from manytouch.simulation.solve_scene import simulator, solid_problem, solve_scene

SCENES = sorted((Path(__file__).parents[2] / "examples" / "scenes").glob("*.toml"))


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_an_example_scene_presses_the_sheet(path: Path, tmp_path: Path) -> None:
    scene = load_scene(path)
    assert scene.name == path.stem.replace("_", " ")
    assert 10 < len(solid_problem(scene).keys) < 80
    quick = replace(scene, mechanics="shell")
    rough = simulator(quick, tuple(solve_scene(quick, tmp_path)))
    counts = [len(rough.truth(index).contacts.touching) for index in range(0, rough.frame_count, 5)]
    assert max(counts) == (1 if scene.name == "bad light" else 2)
    image = np.asarray(rough.frame(rough.frame_count // 2).image)
    assert image.shape == (720, 1280)
    assert image.std() > 10.0


def test_there_are_examples() -> None:
    assert len(SCENES) == 3
