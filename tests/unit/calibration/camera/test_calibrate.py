"""A camera from views of a board: the right one, its deviations, its views, and what it refuses."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from boards import BOARD, HEIGHT_PX, WIDTH_PX, board_detections, picture, poses, seen, true_camera
from manytouch.calibration.camera.board import BoardDetection, find_board, parse_board, refine_corners
from manytouch.calibration.camera.board_views import ViewCollection, part_of, pose_features
from manytouch.calibration.camera.calibrate import calibrate_camera
from manytouch.calibration.camera.intrinsics import NAMES, fit_intrinsics
from manytouch.calibration.camera.report import camera_info_yaml, describe, write_report
from manytouch.cli import main
from manytouch.errors import ManytouchError
from manytouch.geometry.camera import camera_matrix
from manytouch.values import Frame
from manytouch.values.sensor_file.read import load_sensor

DATA = Path(__file__).parents[5] / "shared" / "data" / "opencv_calib"


def parameters(camera) -> np.ndarray:
    return np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, *camera.distortion])


def frames(images) -> list[tuple[str, Frame]]:
    return [
        (f"view {number}", Frame(index=number, timestamp_ns=number, camera="test", image=image))
        for number, image in enumerate(images)
    ]


@pytest.fixture(scope="module")
def pictures() -> list[np.ndarray]:
    return [picture(true_camera(), BOARD, pose, seed=number) for number, pose in enumerate(poses(14))]


@pytest.mark.parametrize("model", ["pinhole", "fisheye"])
def test_predicted_deviations_match_the_errors_of_the_parameters(model):
    camera = true_camera(model)
    errors = []
    for seed in range(24):
        found = fit_intrinsics(
            BOARD,
            board_detections(camera, 14, 0.2, seed),
            width_px=WIDTH_PX,
            height_px=HEIGHT_PX,
            model=model,
        )
        std = np.array([found.std[name] for name in NAMES[model]])
        free = std > 0
        errors.append(((parameters(found.camera) - parameters(camera))[free] / std[free])[:7])
        assert found.rms_px == pytest.approx(0.2 * np.sqrt(2), rel=0.15)
    ratio = np.sqrt(np.mean(np.square(errors)))
    assert 0.8 < ratio < 1.25


def test_an_insignificant_third_coefficient_is_fixed_at_zero():
    without = fit_intrinsics(
        BOARD, board_detections(true_camera(), 12, 0.3), width_px=WIDTH_PX, height_px=HEIGHT_PX
    )
    assert without.camera.distortion[4] == 0.0
    assert without.std["k3"] == 0.0
    bent = replace(true_camera(), distortion=np.array([-0.3, 0.2, 0.0, 0.0, -0.9]))
    with_it = fit_intrinsics(BOARD, board_detections(bent, 14, 0.02), width_px=WIDTH_PX, height_px=HEIGHT_PX)
    assert with_it.camera.distortion[4] == pytest.approx(-0.9, abs=4 * with_it.std["k3"])


def test_the_new_matrix_shows_only_what_the_camera_sees():
    found = fit_intrinsics(
        BOARD, board_detections(true_camera(), 12, 0.1), width_px=WIDTH_PX, height_px=HEIGHT_PX
    )
    corners = np.array([[[0.0, 0.0]], [[WIDTH_PX - 1.0, 0.0]], [[0.0, HEIGHT_PX - 1.0]]])
    rays = cv2.undistortPoints(corners, found.new_matrix, None)
    ray = np.column_stack([rays.reshape(-1, 2), np.ones(3)])
    back, _ = cv2.projectPoints(
        ray, np.zeros(3), np.zeros(3), camera_matrix(found.camera), found.camera.distortion
    )
    assert np.all((back.reshape(-1, 2) > -1.5) & (back.reshape(-1, 2) < [WIDTH_PX + 0.5, HEIGHT_PX + 0.5]))


@pytest.mark.parametrize(
    "text",
    [
        *("chessboard:8x5", "charuco:8x6", "circles-asymmetric:4x7"),
        pytest.param("circles:8x5", marks=pytest.mark.slow),
    ],
)
def test_a_board_is_found_where_it_is(text):
    board, camera = parse_board(text, 20.0), true_camera()
    pose = next(iter(poses(1, seed=3, board=board)))
    image = picture(camera, board, pose)
    found = find_board(image, board)
    assert found is not None
    sharp = refine_corners(image, found, 5) if board.has_corners else found
    there = seen(camera, board, pose)[sharp.number]
    if board.kind == "circles":  # it looks the same upside down
        there = min(there, there[::-1], key=lambda place: np.abs(place - sharp.place_px).max())
    wrong = np.linalg.norm(sharp.place_px - there, axis=1)
    assert np.median(wrong) < (0.08 if board.has_corners else 0.25)


def test_calibration_from_pictures_finds_the_camera(pictures):
    found = calibrate_camera(frames(pictures), BOARD)
    camera = found.intrinsics.camera
    assert len(found.views) >= 12
    assert found.intrinsics.rms_px < 0.12
    assert camera.fx_px == pytest.approx(430.0, abs=1.0)
    assert [camera.cx_px, camera.cy_px] == pytest.approx([246.0, 171.0], abs=1.0)


def test_bad_views_are_refused_with_the_reason(pictures):
    blurred = cv2.GaussianBlur(pictures[3], (0, 0), 9.0)
    empty = np.full_like(pictures[0], 120)
    warnings = pictures[5][: HEIGHT_PX - 20]
    moved = cv2.resize(pictures[12], None, fx=0.9, fy=1.0)
    moved = cv2.copyMakeBorder(moved, 0, 0, 0, WIDTH_PX - moved.shape[1], cv2.BORDER_REPLICATE)
    given = [*pictures[:10], blurred, empty, warnings, pictures[2], moved]
    found = calibrate_camera(frames(given), BOARD)
    reasons = dict(found.refused)
    assert reasons["view 11"] == "does not show a complete chessboard:8x5"
    assert (
        reasons["view 12"]
        == f"has {WIDTH_PX} x {HEIGHT_PX - 20} px, the images before it {WIDTH_PX} x {HEIGHT_PX}"
    )
    assert reasons["view 13"] == "shows the same pose as view 2"
    assert "blurred" in reasons["view 10"] or "does not show" in reasons["view 10"]
    assert "does not fit the others" in reasons["view 14"]
    assert found.intrinsics.camera.fx_px == pytest.approx(430.0, abs=1.5)
    assert len(found.views) + len(found.refused) == len(given)


def test_a_sharper_view_takes_the_place_of_a_blurrier_one(pictures):
    collection = ViewCollection(board=BOARD)
    soft = cv2.GaussianBlur(pictures[0], (0, 0), 1.6)
    for name, frame in frames([soft, pictures[0]]):
        assert collection.add(frame, name) is None
    assert [view.name for view in collection.views] == ["view 1"]
    assert collection.refused == [("view 0", "shows the same pose as view 1, which is sharper")]


def test_missing_views_are_listed_until_they_are_taken(pictures):
    collection = ViewCollection(board=BOARD)
    collection.add(frames(pictures)[0][1], "first")
    missing = " | ".join(collection.missing())
    assert "11 more views" in missing
    assert "bottom right" in missing
    assert "nearer, or farther" in missing
    for name, frame in frames([picture(true_camera(), BOARD, pose) for pose in poses(18, seed=5)]):
        collection.add(frame, name)
    assert collection.missing() == ()


@pytest.mark.parametrize("turn_deg", [(0.0, 30.0), (25.0, 0.0), (-20.0, 15.0)])
def test_pose_features_are_place_size_and_tilt(turn_deg):
    board, size = parse_board("chessboard:8x5", 20.0), (600, 400)
    turn = np.deg2rad([*turn_deg, 0.0])
    matrix = np.array([[600.0, 0.0, 300.0], [0.0, 600.0, 200.0], [0.0, 0.0, 1.0]])
    place, _ = cv2.projectPoints(
        board.point_mm - [70.0, 40.0, 0.0], turn, np.array([30.0, -20.0, 400.0]), matrix, None
    )
    detection = BoardDetection(number=np.arange(40), place_px=place.reshape(-1, 2))
    x, y, extent, about_y, about_x = pose_features(board, detection, size)
    assert [x, y] == pytest.approx([0.5 + 45.0 / 600.0, 0.5 - 30.0 / 400.0], abs=0.02)
    assert extent == pytest.approx(np.linalg.norm(np.ptp(place.reshape(-1, 2), axis=0)) / np.hypot(600, 400))
    normal = cv2.Rodrigues(turn)[0][:, 2]
    assert [about_y, about_x] == pytest.approx(
        [np.arctan2(normal[0], normal[2]), np.arctan2(normal[1], normal[2])], abs=0.01
    )
    assert abs(about_y if turn_deg[1] else about_x) > 0.2


def test_views_that_are_all_as_near_are_not_enough(pictures):
    def offered(nearer: float) -> ViewCollection:
        collection = ViewCollection(board=BOARD)
        middle = np.append(BOARD.point_mm[:, :2].mean(axis=0), 0.0)
        for number, (name, frame) in enumerate(frames(pictures[:4])):
            way = 1.6 * number
            turn = 0.5 * np.array([np.cos(way), np.sin(way), 0.0])
            distance = 300.0 / (nearer if number == 3 else 1.0)
            shift = np.array([0.0, 0.0, distance]) - cv2.Rodrigues(turn)[0] @ middle
            image = picture(true_camera(), BOARD, (turn, shift), seed=number)
            assert collection.add(replace(frame, image=image), name) is None
        return collection

    assert "the board nearer, or farther away" in offered(1.0).missing()
    assert "the board nearer, or farther away" not in offered(1.8).missing()


def test_parts_of_the_picture_are_named_from_the_top_left():
    place = np.array([[0.0, 0.0], [299.0, 0.0], [150.0, 100.0], [10.0, 199.0]])
    assert part_of(place, (300, 200)).tolist() == [0, 2, 4, 6]


def test_the_report_holds_words_numbers_ros_and_a_picture(pictures, tmp_path: Path):
    found = calibrate_camera(frames(pictures), BOARD)
    assert any("focal length 4" in line for line in describe(found))
    write_report(found, tmp_path / "report", "left")
    numbers = json.loads((tmp_path / "report" / "calibration.json").read_text())
    assert numbers["rms_px"] == pytest.approx(found.intrinsics.rms_px)
    assert len(numbers["views"]) == len(found.views)
    drawn = cv2.imread(str(tmp_path / "report" / "coverage.png"))
    assert drawn.std() > 10
    text = camera_info_yaml(found.intrinsics.camera, found.intrinsics.new_matrix, "left")
    assert (tmp_path / "report" / "camera_info.yaml").read_text() == text
    data = next(line for line in text.splitlines() if line.startswith("  data:"))
    matrix = np.array(json.loads(data.removeprefix("  data: "))).reshape(3, 3)
    assert matrix == pytest.approx(camera_matrix(found.intrinsics.camera))


@pytest.mark.parametrize(
    ("board", "square", "sentence"),
    [
        ("chess:8x5", 20.0, "is not a board: give KIND:COLUMNSxROWS"),
        ("chessboard:8", 20.0, "is not a board"),
        ("chessboard:2x5", 20.0, "is too small"),
        ("chessboard:8x5", -1.0, "not valid: it must have 0.001 to 100000 mm; measure one"),
        ("charuco:8x6", 1e-300, "not valid"),
        ("charuco:8x6", 1e300, "not valid"),
        ("chessboard:8x5", float("nan"), "not valid"),
        ("charuco:8x6:DICT_9X9", 20.0, "is not a dictionary"),
        ("charuco:40x40", 20.0, "name a larger dictionary"),
    ],
)
def test_an_impossible_board_is_refused(board, square, sentence):
    with pytest.raises(ManytouchError, match=sentence):
        parse_board(board, square)


@pytest.mark.parametrize("text", ["x" * 5000, "chessboard:" + "9" * 5000 + "x6", "charuco:8x6:" + "D" * 5000])
def test_a_long_text_is_shortened_in_the_message(text):
    with pytest.raises(ManytouchError, match=r"\.\.\.'") as raised:
        parse_board(text, 20.0)
    assert len(str(raised.value)) < 300


def test_a_wrong_board_size_is_named(pictures):
    with pytest.raises(ManytouchError, match="they show a chessboard:8x5: give --board chessboard:8x5"):
        calibrate_camera(frames(pictures[:4]), parse_board("chessboard:9x6", 20.0))


def test_a_single_view_is_refused_with_what_is_missing(pictures):
    with pytest.raises(
        ManytouchError, match=r"only 1 good view of the chessboard:8x5, at least 4 are needed"
    ):
        calibrate_camera(frames(pictures[:1]), BOARD)


def test_blurred_images_are_refused_with_a_remedy(pictures):
    blurred = [cv2.GaussianBlur(image, (0, 0), 5.0) for image in pictures[:5]]
    with pytest.raises(ManytouchError, match=r"4 of 5 images are blurred: focus the lens.*only 0 good views"):
        calibrate_camera(frames(blurred), BOARD)


def test_views_that_all_look_alike_are_too_few(pictures):
    with pytest.raises(ManytouchError, match="refused: view 1 shows the same pose as view 0"):
        calibrate_camera(frames([pictures[0]] * 6), BOARD)


def test_the_verb_writes_a_sensor_file_that_can_be_read(pictures, tmp_path: Path, capsys):
    folder = tmp_path / "views"
    folder.mkdir()
    for number, image in enumerate(pictures):
        cv2.imwrite(str(folder / f"{number}.png"), image)
    (tmp_path / "torn.png").write_bytes(b"no picture")
    words = ["--board", "chessboard:8x5", "--square-mm", "20", "--out", str(tmp_path / "camera.toml")]
    assert main(["calibrate", "camera", str(folder), str(tmp_path / "torn.png"), *words]) == 0
    sensor = load_sensor(tmp_path / "camera.toml")
    assert sensor.camera.fx_px == pytest.approx(430.0, abs=1.0)
    assert 0.0 < sensor.camera.fx_std_px < 1.0
    assert sensor.camera.distortion_std.shape == sensor.camera.distortion.shape
    assert sensor.camera.distortion_std[0] > 0.0
    assert sensor.layout is None
    assert "rejected: torn.png cannot be decoded" in capsys.readouterr().out
    assert main(["calibrate", "camera", str(tmp_path / "nothing"), *words]) == 1
    assert "There is no" in capsys.readouterr().err


def test_the_verb_takes_a_video_and_looks_five_times_per_second(pictures, tmp_path: Path, capsys):
    film = cv2.VideoWriter(
        str(tmp_path / "board.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 10.0, (WIDTH_PX, HEIGHT_PX)
    )
    for image in pictures:
        for _ in range(2):  # every view lasts for 0.2 s
            film.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    film.release()
    out = tmp_path / "camera.toml"
    words = ["--board", "chessboard:8x5", "--square-mm", "20", "--out", str(out)]
    assert main(["calibrate", "camera", str(tmp_path / "board.mp4"), *words]) == 0
    camera = load_sensor(out).camera
    assert (camera.fx_px, camera.cx_px) == (pytest.approx(430.0, abs=4.0), pytest.approx(246.0, abs=4.0))
    assert f"{len(pictures)} views of a chessboard" in capsys.readouterr().out


@pytest.mark.skipif(not DATA.is_dir(), reason="the recordings in ../shared/data are not here")
def test_real_chessboards_give_the_published_camera(tmp_path: Path):
    out = tmp_path / "camera.toml"
    words = ["--board", "chessboard:9x6", "--square-mm", "25", "--out", str(out), "--report", str(tmp_path)]
    assert main(["calibrate", "camera", str(DATA), *words]) == 0
    camera = load_sensor(out).camera
    published = cv2.FileStorage(str(DATA / "left_intrinsics.yml"), cv2.FileStorage_READ)
    wanted = published.getNode("camera_matrix").mat()
    assert camera_matrix(camera) == pytest.approx(wanted, abs=4.0)
    numbers = json.loads((tmp_path / "calibration.json").read_text())
    assert len(numbers["views"]) >= 11
    assert numbers["rms_px"] <= 0.25
