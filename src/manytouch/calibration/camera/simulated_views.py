"""Simulated views of a printed board: what a camera sees before the sheet is mounted.

The file is a TOML like that of a scene, with a table `[board]` instead of bodies.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64
from pydantic import Field, ValidationError
from scipy.interpolate import RectBivariateSpline

from manytouch.calibration.camera.board import Board, charuco_pattern, parse_board
from manytouch.errors import ManytouchError, SensorError, SourceError
from manytouch.geometry.camera import project, ray
from manytouch.simulation.render.discs import Look, image_from_coverage
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.files.result_folder import ResultFolder
from manytouch.values import Camera, Sensor
from manytouch.values.arrays import Image, read_only
from manytouch.values.sensor_file.read import load_sensor
from manytouch.values.sensor_file.sections import NonNegative, Positive, Section, all_mistakes
from manytouch.values.sensor_file.toml_file import read_toml
from manytouch.values.sensor_file.write import save_sensor

CIRCLE_SHARE = 0.3
"""Radius of a printed circle over the distance of two."""
MOST_VIEWS = 200
TILTS_DEG = (15.0, 25.0, 35.0)
DISTANCES = (1.0, 1.25, 1.5)
"""Distances of the board from the camera, over the distance that is in focus."""
PLACES = ((0.0, 0.0), (-1.0, -1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (0.0, -1.0), (0.0, 1.0), (1.0, 0.0))
"""Where the board is in the view, as far as it stays in it: 0 the centre, 1 the border."""
MARGIN_PX = 4.0
SAMPLES = (-0.25, 0.25)  # along x and y of a pixel
NODE_PX = 8.0  # distance between the nodes of the splines that rays are interpolated with
BLACK, WHITE = 30.0, 215.0  # grey levels
CIRCLE_CELLS = 64  # per square, of the drawing of a board of circles


class _BoardSection(Section):
    pattern: str = "chessboard:9x6"
    square_mm: Positive
    views: Annotated[int, Field(ge=1, le=MOST_VIEWS)] = 20
    distance_mm: Positive | None = None


class _Light(Section):
    vignetting: Annotated[float, Field(ge=0, le=1)] = 0.25
    read_noise: Annotated[float, Field(ge=0, le=255)] = 1.5
    shot_noise: Annotated[float, Field(ge=0, le=255)] = 0.02


class _Lens(Section):
    blur_px: NonNegative = 0.8


class _File(Section):
    schema_version: Annotated[int, Field(alias="schema", ge=1, le=1, examples=[1])]
    name: str = "board"
    sensor: Annotated[str, Field(min_length=1)]
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 0
    board: _BoardSection
    light: _Light = Field(default_factory=_Light)
    lens: _Lens = Field(default_factory=_Lens)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoardScene:
    """A camera that looks at a board.

    Attributes:
        name, seed: of the scene; the seed is of the noise.
        camera: that is to be calibrated.
        board: in every view.
        views: their number.
        distance_mm: of the board where it is nearest.
        look: light and noise.
        blur_px: standard deviation of the point spread.
    """

    name: str
    seed: int
    camera: Camera
    board: Board
    views: int
    distance_mm: float
    look: Look
    blur_px: float


def is_board_scene(path: Path) -> bool:
    """Whether a file is a TOML with a table `[board]`."""
    try:
        return "board" in read_toml(path, "a scene file", SourceError)
    except (SourceError, FileNotFoundError):
        return False


def load_board_scene(path: Path) -> BoardScene:
    """Read a scene file with a `[board]`; paths in it start at its folder.

    Raises:
        SourceError: the file cannot be read, or has unknown keys, wrong types or impossible values.
        SensorError: its sensor file is wrong.
        ManytouchError: the board is not valid.
    """
    try:
        file = _File.model_validate(read_toml(path, "a scene file", SourceError))
    except ValidationError as error:
        raise SourceError(all_mistakes(f"scene file {path}", error, _File)) from None
    sensor = load_sensor(path.parent / file.sensor)
    focus_mm = file.board.distance_mm or float(sensor.camera.translation_mm[2])
    if file.board.distance_mm is None and sensor.layout is None:
        raise SensorError(
            f"the camera of {sensor.name!r} does not look at a sheet: give distance_mm of [board] in "
            f"{path}, the distance that is in focus"
        )
    return BoardScene(
        name=file.name,
        seed=file.seed,
        camera=sensor.camera,
        board=parse_board(file.board.pattern, file.board.square_mm),
        views=file.board.views,
        distance_mm=focus_mm,
        look=Look(ground=BLACK, dot=WHITE, **file.light.model_dump()),
        blur_px=file.lens.blur_px,
    )


def board_poses(scene: BoardScene) -> Iterator[Camera]:
    """The camera with its pose in front of the board, view by view: centre, corners, tilted, near and far.

    Raises:
        ManytouchError: the board does not fit into the image at any of the distances.
    """
    for number in range(scene.views):
        place = np.array(PLACES[number % len(PLACES)])
        tilt = math.radians(TILTS_DEG[number % len(TILTS_DEG)])
        around = 2.4 * number  # a golden angle: no two views are tilted alike
        turn = tilt * np.array([math.cos(around), math.sin(around), 0.0])
        share = DISTANCES[number // len(PLACES) % len(DISTANCES)] if number else 1.0
        yield _posed(scene, place, turn, share)


def render_views(scene: BoardScene) -> Iterator[Image]:
    """(h, w) images of the board, in the poses of `board_poses`.

    Raises:
        ManytouchError: as for `board_poses`.
    """
    rays = [_rays(scene.camera, right, down) for right in SAMPLES for down in SAMPLES]
    drawing = _drawing(scene.board)
    for number, posed in enumerate(board_poses(scene)):
        rotation, _ = cv2.Rodrigues(posed.rotation_vector)
        origin = (-posed.translation_mm @ rotation).astype(np.float32)
        coverage: np.ndarray = np.zeros((scene.camera.height_px, scene.camera.width_px), dtype=np.float32)
        for plane in rays:
            direction = plane @ rotation.astype(np.float32)
            place_mm = origin[:2] - (origin[2] / direction[..., 2:]) * direction[..., :2]
            coverage += drawing.white_at(place_mm) / len(rays)
        if scene.blur_px > 0.0:
            coverage = np.asarray(cv2.GaussianBlur(coverage, (0, 0), scene.blur_px), dtype=np.float32)
        yield image_from_coverage(coverage, look=scene.look, seed=scene.seed + number)


def write_views(scene: BoardScene, folder: Path) -> Iterator[int]:
    """Write frames/000000.png and so on, sensor.toml with the camera, and truth/views.csv with the poses.

    They replace those of an earlier run once the iteration ends.

    Yields:
        The number of images written so far.

    Raises:
        OutputError: the folder cannot be written.
        ManytouchError: as for `board_poses`.
    """
    with ResultFolder(folder, ("frames", "sensor.toml", "truth")) as results:
        partial = results.partial_path
        rows = ["frame,rotation_x,rotation_y,rotation_z,x_mm,y_mm,z_mm"]
        for number, (posed, image) in enumerate(zip(board_poses(scene), render_views(scene), strict=True)):
            with output_errors(folder):
                for name in ("frames", "truth"):
                    (partial / name).mkdir(exist_ok=True)
                encoded = cv2.imencode(".png", np.asarray(image))[1].tobytes()
                (partial / "frames" / f"{number:06d}.png").write_bytes(encoded)
                pose = (*posed.rotation_vector, *posed.translation_mm)
                rows.append(",".join([str(number), *(f"{value:.6g}" for value in pose)]))
            yield number + 1
        with output_errors(folder):
            (partial / "truth" / "views.csv").write_text("\n".join([*rows, ""]), encoding="utf-8")
        save_sensor(Sensor(name=scene.name, camera=scene.camera), partial / "sensor.toml")
        results.commit()


def _posed(
    scene: BoardScene,
    place: np.ndarray,
    turn: np.ndarray,
    share: float,
) -> Camera:
    """The pose as far from the centre of the image as possible, farther away where the board is too large."""
    camera, outline_mm = scene.camera, _outline_mm(scene.board)
    middle_mm = outline_mm.mean(axis=0)
    half = np.array([camera.width_px / camera.fx_px, camera.height_px / camera.fy_px]) / 2
    rotation, _ = cv2.Rodrigues(turn)
    for farther in (1.0, 1.1, 1.2, 1.35, 1.5):
        distance_mm = scene.distance_mm * share * farther
        for aside in np.linspace(1.0, 0.0, 41):
            at_mm = np.append(aside * place * half * distance_mm, distance_mm)
            posed = replace(
                camera,
                rotation_vector=read_only(turn),
                translation_mm=read_only(at_mm - rotation @ middle_mm),
            )
            shown = project(posed, outline_mm)
            last_px = np.array([camera.width_px, camera.height_px]) - 1 - MARGIN_PX
            if np.all((shown >= MARGIN_PX) & (shown <= last_px)):
                return posed
    raise ManytouchError(
        f"the board {scene.board} with {scene.board.square_mm:g} mm does not fit into the view of the camera "
        f"at {scene.distance_mm:g} mm: use smaller squares"
    )


def _outline_mm(board: Board) -> Float64[np.ndarray, "c 3"]:
    """(c, 3) corners of the printed area, one square around the points of a chessboard or of circles."""
    low, high = board.point_mm.min(axis=0), board.point_mm.max(axis=0)
    around = board.square_mm
    x, y = ((low[axis] - around, high[axis] + around) for axis in (0, 1))
    return np.array([[a, b, 0.0] for a in x for b in y])


def _rays(camera: Camera, right: float, down: float) -> Float32[np.ndarray, "h w 3"]:
    """Directions of the pixels, shifted by a part of a pixel."""
    sides = (camera.height_px, camera.width_px)
    node_y, node_x = (np.arange(-NODE_PX, side + 2 * NODE_PX, NODE_PX) for side in sides)
    nodes = np.stack(np.meshgrid(node_x, node_y), axis=-1)
    at = ray(camera, nodes.reshape(-1, 2)).reshape(nodes.shape)
    y, x = np.arange(sides[0]) + down, np.arange(sides[1]) + right
    planes = [RectBivariateSpline(node_y, node_x, at[..., axis])(y, x) for axis in (0, 1)]
    return np.stack([*planes, np.ones(sides)], axis=-1).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Drawing:
    """What is printed, as cells.

    Attributes:
        is_black: (r, c), with a white cell all around.
        cells_per_mm: their number.
        origin_mm: x and y of the corner of the first cell.
    """

    is_black: Bool[np.ndarray, "r c"]
    cells_per_mm: float
    origin_mm: float

    def white_at(self, place_mm: Float32[np.ndarray, "h w 2"]) -> Float32[np.ndarray, "h w"]:
        """1 where the board is white at a place, 0 where it is black."""
        last = np.array(self.is_black.shape[::-1]) - 1
        cell = np.clip(np.floor((place_mm - self.origin_mm) * self.cells_per_mm), 0, last).astype(np.intp)
        return (~self.is_black[cell[..., 1], cell[..., 0]]).astype(np.float32)


def _drawing(board: Board) -> _Drawing:
    side = board.square_mm
    if board.kind == "charuco":
        is_black, cells = charuco_pattern(board)
        first_mm = 0.0
    elif board.kind == "chessboard":
        is_black, cells = np.indices((board.rows + 1, board.columns + 1)).sum(axis=0) % 2 == 0, 1
        first_mm = -side
    else:
        x, y = np.rint(board.point_mm[:, :2] / side).astype(int).T + 1
        cells, first_mm = CIRCLE_CELLS, -side
        is_black = np.zeros(((y.max() + 1) * cells, (x.max() + 1) * cells), dtype=np.bool_)
        reach = np.hypot(*(np.indices((cells, cells)) + 0.5 - cells / 2)) < CIRCLE_SHARE * cells
        for column, row in zip(x * cells - cells // 2, y * cells - cells // 2, strict=True):
            is_black[row : row + cells, column : column + cells] |= reach
    return _Drawing(
        is_black=np.pad(is_black, 1), cells_per_mm=cells / side, origin_mm=first_mm - side / cells
    )
