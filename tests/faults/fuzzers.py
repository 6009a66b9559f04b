"""The kinds of hostile inputs: files of every kind that is read, and messages of a browser."""

import contextlib
import json
import re
import struct
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np

import boards
from clips import picture, press_of, pressed_video, write_video
from faults.mutations import damaged_bytes, damaged_text
from faults.runner import Fuzzer, WrongResultError, peak_bytes, reset_peak
from manytouch.calibration.camera.board import find_board, parse_board
from manytouch.calibration.camera.board_views import ViewCollection
from manytouch.calibration.sheet.press_parser import PressContext, parse_press
from manytouch.calibration.sheet.press_table import read_press_table
from manytouch.errors import ManytouchError
from manytouch.geometry.camera import project
from manytouch.session import pipeline_for, prepare
from manytouch.session.methods.compile_stage import poor_images
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.scene.file import BUILT_IN, load_scene
from manytouch.simulation.solve_scene import solid_problem
from manytouch.sinks.viewer.client_messages import parse_client_message
from manytouch.sources import open_source
from manytouch.values import Frame, Reading
from manytouch.values.sensor_file.read import load_sensor
from manytouch.values.sensor_file.write import save_sensor

MAX_BOMB_MB = 200.0
PRESSES = """input,time_s,x_mm,y_mm,radius_mm,normal_force_N
a.mp4,3.0,14,-8,2.5,0.49
# a comment
"b, c.mp4",,0.5,-0.25,,
"""
TYPED = ("18,-12 50 g 3.4 s radius 2 mm", "18 -12 0.49N 3.2-3.8s", " -.5 ; +7.25  at 3 s with 490 mN")
BOARDS = ("chessboard:9x6", "charuco:8x6:DICT_5X5_100", "circles:9x6", "circles-asymmetric:4x11")
MESSAGES = (
    {"type": "tare"},
    {"type": "method", "method": "mechanics"},
    {"type": "tune", "parameter": "detect.least_share", "value": 0.5},
    {"type": "press", "finger": 3, "x_mm": 1.5, "y_mm": -2, "depth_mm": 2},
    {"type": "release", "finger": 3},
    {"type": "seek", "frame": 120},
    {"type": "play", "speed": 0.5},
    {"type": "measure", "point_mm": [[1, 2], [3.5, -4]]},
    {"type": "show", "layer": "strain", "image": False},
    {"type": "ack", "number": 7},
)


def warm_up() -> None:
    """Compile and load what valid inputs need, so that only the input counts for time and memory."""
    for prepared in (valid_readings, encoded_pictures, video_files, board_picture, huge_video):
        prepared()


@cache
def sensor_text() -> str:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        save_sensor(demo_sensor(640), Path(folder) / "sensor.toml")
        return (Path(folder) / "sensor.toml").read_text()


@cache
def scene_texts() -> tuple[str, ...]:
    return tuple((BUILT_IN / f"{name}.toml").read_text() for name in ("one", "fingers", "rest"))


@cache
def encoded_pictures() -> tuple[tuple[str, bytes], ...]:
    suffixes = (".png", ".jpg", ".bmp", ".tif", ".webp")
    return tuple((suffix, cv2.imencode(suffix, picture())[1].tobytes()) for suffix in suffixes)


@cache
def video_files() -> tuple[tuple[str, bytes], ...]:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        return tuple(
            (suffix, pressed_video(Path(folder) / f"a{suffix}", frames=25).read_bytes())
            for suffix in (".mp4", ".avi")
        )


@cache
def board_picture() -> np.ndarray:
    pose = next(boards.poses(1))
    return boards.picture(boards.true_camera(), boards.BOARD, pose)


@cache
def learned() -> object:
    """A job on valid pictures; its sensor and pipeline read damaged ones."""
    import tempfile

    folder = Path(tempfile.mkdtemp())
    for index in range(15):
        cv2.imwrite(str(folder / f"{index:02d}.png"), picture(seed=index))
    return prepare(folder)


def valid_readings() -> list[Reading]:
    job = learned()
    images = [*(picture(press_of(20 + k), seed=k) for k in range(20)), *poor_images(picture())]
    frames = [frame_of(image, index) for index, image in enumerate(images)]
    return list(job.pipeline.run(frames, job.sensor))


def frame_of(image: np.ndarray | None, index: int) -> Frame:
    """A frame of an image, which is made read-only as a source does it."""
    if image is not None:
        image.setflags(write=False)
    return Frame(index=index, timestamp_ns=index * 40_000_000, camera="faults", image=image)


def check_reading(reading: Reading) -> None:
    """A reading with the status ok has a finite position and depth for each marker that is seen."""
    if reading.status != "ok":
        return
    grid, surface = reading.grid, reading.surface
    if not np.isfinite(grid.position_px[grid.is_seen]).all():
        raise WrongResultError("a marker is seen, but its position is not a number")
    if not np.isfinite(surface.displacement_mm[grid.is_seen, 2]).all():
        raise WrongResultError("a marker is seen, but its depth is not a number")
    for contact in reading.contacts.touching:
        if not np.isfinite([*contact.centre_mm, contact.depth_mm]).all():
            raise WrongResultError("a contact is not a number")


def run_sensor(seed: int, folder: Path) -> None:
    random = np.random.default_rng(seed)
    path = folder / "sensor.toml"
    path.write_bytes(damaged_text(sensor_text(), random).encode("utf-8", errors="surrogatepass"))
    sensor = load_sensor(path)
    if sensor.layout is None:
        return
    place_px = project(sensor.camera, sensor.layout.rest_mm)
    if place_px.shape != (len(sensor.layout.rest_mm), 2):
        raise WrongResultError("there is not one position per marker")
    save_sensor(sensor, folder / "again.toml")
    load_sensor(folder / "again.toml")
    if len(place_px) > 5000 or max(sensor.camera.width_px, sensor.camera.height_px) > 4000:
        return
    image = np.full((sensor.camera.height_px, sensor.camera.width_px), 128, np.uint8)
    for reading in pipeline_for("perimeter").run([frame_of(image, 0)], sensor):
        check_reading(reading)


def run_scene(seed: int, folder: Path) -> None:
    random = np.random.default_rng(seed)
    path = folder / "scene.toml"
    texts = scene_texts()
    text = damaged_text(texts[random.integers(len(texts))], random)
    path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
    scene = load_scene(path)
    if scene.mesh.element_mm > 1.0 and scene.mesh.layers < 3:
        solid_problem(scene)


def run_press_table(seed: int, folder: Path) -> None:
    random = np.random.default_rng(seed)
    path = folder / "presses.csv"
    path.write_bytes(damaged_text(PRESSES, random).encode("utf-8", errors="surrogatepass"))
    sheet = demo_sensor().sheet
    assert sheet is not None
    context = PressContext(input="a.mp4", begin_s=0.0, end_s=12.0, sheet=sheet)
    with contextlib.suppress(ManytouchError):
        parse_press(damaged_text(TYPED[random.integers(len(TYPED))], random), 1, context)
    for row in read_press_table(path):
        if not np.isfinite([row.x_mm, row.y_mm, row.radius_mm]).all():
            raise WrongResultError("a press is not a number")


def run_image(seed: int, folder: Path) -> None:
    random = np.random.default_rng(seed)
    pictures = encoded_pictures()
    suffix, content = pictures[random.integers(len(pictures))]
    (folder / f"a{suffix}").write_bytes(damaged_bytes(content, random))
    source = open_source(folder / f"a{suffix}")
    frames = list(source)
    if len(frames) != 1:
        raise WrongResultError(f"{len(frames)} frames of one image")
    job = learned()
    first = frame_of(picture(), 0)
    fits = frames[0].image is not None and frames[0].image.shape[:2] == first.image.shape[:2]
    frames = [first, frame_of(frames[0].image if fits else None, 1)]
    readings = list(job.pipeline.run(frames, job.sensor))
    if [reading.frame.index for reading in readings] != [0, 1]:
        raise WrongResultError("there is not one reading per frame")
    for reading in readings:
        check_reading(reading)


def run_video(seed: int, folder: Path) -> None:
    random = np.random.default_rng(seed)
    videos = video_files()
    suffix, content = videos[random.integers(len(videos))]
    (folder / f"a{suffix}").write_bytes(damaged_bytes(content, random))
    source = open_source(folder / f"a{suffix}")
    frames = []
    for frame in source:
        frames.append((frame.index, frame.timestamp_ns))
        if frame.image is not None and frame.image.shape[:2] != (source.height_px, source.width_px):
            raise WrongResultError("an image differs in size from the first")
        if len(frames) == 3000:
            break
    if [index for index, _ in frames] != list(range(len(frames))):
        raise WrongResultError("frames are missing")
    if np.any(np.diff([time for _, time in frames]) <= 0):
        raise WrongResultError("the times do not increase")


def run_board(seed: int, folder: Path) -> None:
    random = np.random.default_rng(seed)
    text = BOARDS[random.integers(len(BOARDS))]
    image, board = board_picture(), boards.BOARD
    if random.random() < 0.5:
        text = damaged_text(text, random)
        board = parse_board(text, float(random.choice([25.0, 0.0, np.nan, 1e300, -1.0, 1e-300])))
    encoded = cv2.imencode(".jpg", image)[1].tobytes()
    (folder / "view.jpg").write_bytes(damaged_bytes(encoded, random))
    views = ViewCollection(board=board)
    for frame in open_source(folder / "view.jpg"):
        views.add(frame, "view")
        if frame.image is not None and board.columns * board.rows < 500:
            find_board(frame.image if frame.image.ndim == 2 else frame.image[..., 0].copy(), board)
    views.missing()


def run_message(seed: int, folder: Path) -> None:
    random = np.random.default_rng(seed)
    text = damaged_text(json.dumps(MESSAGES[random.integers(len(MESSAGES))]), random)
    message = parse_client_message(text)
    if message is not None and hasattr(message, "command"):
        message.command()
    if message is not None and hasattr(message, "points") and not np.isfinite(message.points()).all():
        raise WrongResultError("a point is not a number")


def nested_png(width: int, height: int) -> bytes:
    """A PNG whose header states a size, with few bytes of content."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        checksum = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(bytes(9999))) + chunk(b"IEND", b"")


def huge_photo() -> bytes:
    return cv2.imencode(".jpg", np.zeros((9000, 9000), np.uint8))[1].tobytes()


@cache
def huge_video() -> bytes:
    """Two frames of 9000 x 8000 px."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.avi"
        write_video(path, [np.zeros((8000, 9000, 3), np.uint8)] * 2)
        return path.read_bytes()


@cache
def bombs() -> dict[str, Callable[[], bytes]]:
    """Names of small files that would take gigabytes or minutes without limits, and what makes them."""
    sensor, scene = sensor_text(), scene_texts()[0]
    texts = {
        "keys": sensor + "[" + ".".join(["a"] * 50_000) + "]",
        "dotted": sensor + ".".join(["a"] * 50_000) + " = 1",
        "brackets": "x = " + "[" * 50_000,
        "tables": sensor + "x = " + "{a=" * 50_000,
        "headers": "".join(f"[a{number}]\n" for number in range(300_000)),
        "rows": sensor.replace("rows = 20", "rows = 100000").replace("columns = 30", "columns = 100000"),
        "cx": re.sub("cx_px = .*", "cx_px = 1e29", sensor),
        "width": re.sub("width_px = .*", "width_px = 2000000000", sensor),
        "digits": "schema = " + "9" * 1_000_000,
        "missing": re.sub("missing = .*", "missing = [" + "[0,0]," * 600_000 + "]", sensor),
        "mistakes": sensor + "[provenance.x]\n" + "".join(f"[b{number}]\n" for number in range(5000)),
    }
    scenes = {
        "frames": scene.replace("seconds = 6.0", "seconds = 1e8"),
        "elements": scene + "[solid]\nelement_mm = 1e-7\n",
        "steps": scene + "[solid]\nstep_mm = 1e-9\n",
        "dust": scene + "[faults]\ndust = 1000000000\n",
        "bodies": re.sub(r"(?s)\[\[bodies.*", "bodies = [" + "{}," * 500_000 + "]", scene),
    }
    return {
        **{f"{name}.sensor.toml": text.encode for name, text in texts.items()},
        **{f"{name}.scene.toml": text.encode for name, text in scenes.items()},
        "huge.png": lambda: nested_png(30_000, 30_000),
        "wide.png": lambda: nested_png(1_000_000, 60),
        "huge.jpg": huge_photo,
        "huge.avi": huge_video,
        "rows.csv": (PRESSES + "a.mp4,1,1,1,1,1\n" * 100_000).encode,
        "columns.csv": ("input,x_mm,y_mm" + ",a" * 4_000_000).encode,
        "field.csv": (PRESSES + "a" * 5_000_000 + ",1,1,1,1,1\n").encode,
    }


def run_bomb(seed: int, folder: Path) -> None:
    name, content = list(bombs().items())[seed % len(bombs())]
    path = folder / name
    path.write_bytes(content())
    reset_peak()
    before = peak_bytes()
    try:
        if name.endswith(".sensor.toml"):
            load_sensor(path)
        elif name.endswith(".scene.toml"):
            solid_problem(load_scene(path))
        elif name.endswith(".csv"):
            read_press_table(path)
        else:
            open_source(path)
    except ManytouchError as error:
        grown_MB = (peak_bytes() - before) / 1e6
        if grown_MB > MAX_BOMB_MB:
            raise WrongResultError(f"{name}: refused after {grown_MB:.0f} MB: {str(error)[:100]}") from None
        raise
    raise WrongResultError(f"{name} was accepted")


FUZZERS = (
    Fuzzer(name="sensor file", run=run_sensor),
    Fuzzer(name="scene", run=run_scene),
    Fuzzer(name="press table", run=run_press_table),
    Fuzzer(name="image", run=run_image),
    Fuzzer(name="video", run=run_video),
    Fuzzer(name="board", run=run_board),
    Fuzzer(name="message of a browser", run=run_message),
    Fuzzer(name="bomb", run=run_bomb),
)
