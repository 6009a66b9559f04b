"""Simulated views of a board."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from boards import true_camera
from manytouch.calibration.camera.board import find_board, parse_board
from manytouch.calibration.camera.board_views import ViewCollection
from manytouch.calibration.camera.simulated_views import (
    BLACK,
    WHITE,
    BoardScene,
    board_poses,
    load_board_scene,
    render_views,
)
from manytouch.cli import main
from manytouch.errors import ManytouchError
from manytouch.geometry.camera import project
from manytouch.simulation.render.discs import Look
from manytouch.values import Frame, Sensor
from manytouch.values.sensor_file.read import load_sensor
from manytouch.values.sensor_file.write import save_sensor

FILE = """schema = 1
sensor = "sensor.toml"
[board]
square_mm = 7.0
distance_mm = 90.0
"""


def board_scene(pattern: str = "chessboard:9x6", model: str = "pinhole", views: int = 9) -> BoardScene:
    camera = replace(true_camera(model), translation_mm=np.array([0.0, 0.0, 90.0]))
    return BoardScene(
        name="board",
        seed=0,
        camera=camera,
        board=parse_board(pattern, 6.0),
        views=views,
        distance_mm=90.0,
        look=Look(ground=BLACK, dot=WHITE, read_noise=1.0),
        blur_px=0.7,
    )


@pytest.mark.parametrize(
    ("pattern", "model", "limit_px"),
    [
        ("chessboard:9x6", "pinhole", 0.15),
        ("chessboard:9x6", "fisheye", 0.15),
        ("charuco:8x6", "pinhole", 0.25),
        ("circles-asymmetric:4x11", "pinhole", 0.3),  # the centre of an ellipse is not that of the circle
    ],
)
def test_the_points_of_a_board_are_where_the_camera_projects_them(
    pattern: str, model: str, limit_px: float
) -> None:
    scene = board_scene(pattern, model, views=3)
    for posed, image in zip(board_poses(scene), render_views(scene), strict=True):
        found = find_board(image, scene.board)
        assert found is not None
        true_px = project(posed, scene.board.point_mm)
        turned = true_px[::-1]  # a chessboard of 9 x 6 corners is the same after half a turn
        off = [np.abs(place[found.number] - found.place_px) for place in (true_px, turned)]
        assert min(np.median(one) for one in off) < limit_px


def test_views_leave_nothing_missing() -> None:
    scene = board_scene(views=20)
    views = ViewCollection(board=scene.board)
    for number, image in enumerate(render_views(scene)):
        views.add(Frame(index=number, timestamp_ns=number, camera="", image=image), str(number))
    assert views.missing() == ()
    assert not views.refused


def test_a_board_that_does_not_fit_is_refused() -> None:
    scene = replace(board_scene(), board=parse_board("chessboard:9x6", 40.0))
    with pytest.raises(ManytouchError, match="use smaller squares"):
        list(board_poses(scene))


def test_simulate_writes_views_with_their_poses(tmp_path: Path) -> None:
    save_sensor(Sensor(name="lens", camera=board_scene().camera), tmp_path / "sensor.toml")
    (tmp_path / "board.toml").write_text(f"{FILE}views = 2\n", encoding="utf-8")
    assert main(["simulate", str(tmp_path / "board.toml"), "--out", str(tmp_path / "out")]) == 0
    assert [path.name for path in sorted((tmp_path / "out" / "frames").iterdir())] == [
        "000000.png",
        "000001.png",
    ]
    assert load_sensor(tmp_path / "out" / "sensor.toml").camera.fx_px == board_scene().camera.fx_px
    rows = (tmp_path / "out" / "truth" / "views.csv").read_text().splitlines()
    assert len(rows) == 3
    scene = load_board_scene(tmp_path / "board.toml")
    image = cv2.imread(str(tmp_path / "out" / "frames" / "000001.png"), cv2.IMREAD_GRAYSCALE)
    assert find_board(image, scene.board) is not None


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (f"{FILE}view = 2\n", "unknown key board.view"),
        (FILE.replace("7.0", "-1.0"), "board.square_mm"),
        (f'{FILE}pattern = "chess"\n', "is not a board"),
        (f"{FILE}views = 1000\n", "less than or equal to 200"),
        (FILE.replace("distance_mm = 90.0", ""), "give distance_mm"),
    ],
)
def test_mistakes_in_the_file_are_named(tmp_path: Path, text: str, found: str) -> None:
    save_sensor(Sensor(name="lens", camera=board_scene().camera), tmp_path / "sensor.toml")
    (tmp_path / "board.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ManytouchError, match=found):
        load_board_scene(tmp_path / "board.toml")
