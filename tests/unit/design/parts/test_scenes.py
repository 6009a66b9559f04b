"""The scenes that simulate a design."""

from pathlib import Path

import numpy as np

from manytouch.calibration.camera.simulated_views import board_poses, load_board_scene
from manytouch.design.parts.boards import fitting_board
from manytouch.design.write import write_sensor
from manytouch.simulation.scene.file import load_scene
from manytouch.simulation.scene.motion import held_presses


def test_the_scenes_of_a_design_are_valid_and_press_inside_its_area(found, tmp_path: Path) -> None:
    write_sensor(found, tmp_path)
    board = load_board_scene(tmp_path / "scenes" / "board.toml")
    assert board.board == fitting_board("chessboard:9x6", found.sensor.camera)
    assert len(list(board_poses(board))) == 20
    at_rest = load_scene(tmp_path / "scenes" / "rest.toml")
    assert not at_rest.bodies
    half_mm = np.array(found.sensor.sheet.size_mm) / 2
    for name, count in (("presses", 5), ("touches", 2)):
        scene = load_scene(tmp_path / "scenes" / f"{name}.toml")
        assert scene.fps == 30.0, "images are read at 30 frames per second"
        (body,) = scene.bodies
        assert body.trajectory.place_mm[:, 2].max() < found.requirements.deepest_mm
        presses = held_presses(scene.bodies)
        assert len(presses) == count
        assert all(abs(one.x_mm) < half_mm[0] and abs(one.y_mm) < half_mm[1] for one in presses)
        assert presses[-1].time_s < scene.duration_s
