"""Sequences of a dotted sheet with known truth: where each dot is, and which marker it is.

A `Sequence` is a few numbers. `course_of` gives its truth, `dots_in` the dots as a perfect detection with
known noise would give them, `picture` and `pictures` the images of a camera, `jpegs` those of an MJPEG
camera. Fingers press and slide so that the fastest dot moves by exactly `step_pitches` in every frame, except
the first two.
"""

import hashlib
import tempfile
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from manytouch.geometry.camera import project
from manytouch.simulation.render.discs import Look, render_discs
from manytouch.values import Camera, Detections, Frame, Layout, Sensor, Status

COUNTS = {96: (12, 8), 384: (24, 16), 1040: (40, 26), 4000: (80, 50), 10000: (125, 80)}
"""Dots to (columns, rows)."""

SIZES = {"480p": (640, 480), "720p": (1280, 720), "1080p": (1920, 1080), "1440p": (2560, 1440)}
FAULTS = ("none", "black", "blurred", "saturated", "hidden", "flash")
PITCH_MM, DISTANCE_MM = 4.0, 116.3
LEAST_PITCH_PX = 5.0
STEEPEST = 0.6  # largest strain of the sheet's image, so that it does not fold
FINGERS = 2
TOUCHING = 2  # first steps, of half the length: a sheet at rest must be touched before it can move
_VERSION = 4  # of the pictures, for the cache


@dataclass(frozen=True, slots=True, kw_only=True)
class Sequence:
    """Parameters of a sequence.

    Attributes:
        dots: of `COUNTS`.
        size: of `SIZES`.
        frames: number of frames; the first shows the sheet at rest.
        step_pitches: motion of the fastest dot from each frame to the next.
        noise: standard deviation of a pixel of level 60, in grey levels of 255.
        light_noise: part of it that is shot noise, which grows with the level; 0: the same noise everywhere.
        missing_share: of the dots in a frame; half of them in all frames, half in this frame only.
        hidden_share: of the dots, others in each frame but the first.
        false_share: false dots over markers; half stay in place, half are new each frame.
        hole_pitches: radius of a patch without dots that wanders over the sheet.
        shift_pitches: the whole view jumps by this much, and back, every fifth frame; rim and all.
        fault: one of `FAULTS`, from frame `fault_from` for `fault_frames` frames (a flash: for one).
        is_clamped: the outermost dots stay where they are.
        margin: extent of the pattern against the image; above 1 its rim is never seen.
        jitter_pitches: deviation of the printed dots from the lattice; the sensor knows it.
        radius_spread, contrast_spread: of the printed dots, relative; the sensor does not contain them.
        seed: of the random numbers.
    """

    dots: int = 1040
    size: str = "1440p"
    frames: int = 30
    step_pitches: float = 0.25
    noise: float = 2.5
    light_noise: float = 0.8
    missing_share: float = 0.0
    hidden_share: float = 0.0
    false_share: float = 0.0
    hole_pitches: float = 0.0
    shift_pitches: float = 0.0
    fault: str = "none"
    fault_from: int = 10
    fault_frames: int = 30
    is_clamped: bool = True
    margin: float = 0.94
    jitter_pitches: float = 0.02
    radius_spread: float = 0.015
    contrast_spread: float = 0.08
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Course:
    """The truth of a sequence.

    Attributes:
        sequence: its parameters.
        sensor: of the sheet; its `rest_px` is the sheet at rest.
        pitch_px, radius_px: of the dots at rest.
        centre_px: (f, m, 2) true centres, also of dots that do not show.
        shape_px: (f, m, 2, 2) maps the unit disc to the dot, as `render_discs` takes.
        contrast: (m,) of each dot against the usual.
        is_visible: (f, m) the dot is in the image, whole, and neither missing nor hidden.
        is_faulty: (f,) frames with the fault.
        is_jump: (f,) frames in which the whole view was shifted since the frame before.
        false_px: one (n, 2) for each frame, false dots.
    """

    sequence: Sequence
    sensor: Sensor
    pitch_px: float
    radius_px: float
    centre_px: np.ndarray
    shape_px: np.ndarray
    contrast: np.ndarray
    is_visible: np.ndarray
    is_faulty: np.ndarray
    is_jump: np.ndarray
    false_px: tuple[np.ndarray, ...]


def course_of(sequence: Sequence) -> Course:
    """The truth of a sequence.

    Raises:
        ValueError: an unknown count, size or fault, dots that would be too small, or a step that
            this sheet cannot make without folding.
    """
    if sequence.dots not in COUNTS or sequence.size not in SIZES or sequence.fault not in FAULTS:
        raise ValueError(
            f"{sequence.dots} dots, size {sequence.size!r}, fault {sequence.fault!r}: "
            f"expected one of {list(COUNTS)}, {list(SIZES)}, {list(FAULTS)}"
        )
    sensor, pitch_px, radius_px = sensor_of(sequence)
    rest_px = sensor.layout.rest_px
    chance = np.random.default_rng([sequence.seed, 1])
    centre_px, shape_px = _moved(_sheet_of(sequence), sequence.frames, sequence.step_pitches)
    shift_px = _shifts(sequence, pitch_px, chance)
    centre_px = centre_px + shift_px[:, None]
    printed = np.random.default_rng([sequence.seed, 4]).standard_normal(len(rest_px))
    size = 1.0 + np.clip(sequence.radius_spread * printed, -0.2, 0.2)
    is_faulty = np.zeros(sequence.frames, dtype=bool)
    if sequence.fault != "none":
        length = 1 if sequence.fault == "flash" else sequence.fault_frames
        is_faulty[sequence.fault_from : sequence.fault_from + length] = True
    size_px = np.array(SIZES[sequence.size])
    is_inside = ((centre_px > radius_px) & (centre_px < size_px - 1 - radius_px)).all(axis=2)
    is_visible = is_inside & ~_absent(sequence, rest_px, pitch_px, chance)
    if sequence.fault in ("black", "saturated", "flash"):
        is_visible[is_faulty] = False
    elif sequence.fault == "hidden":
        is_visible[np.ix_(is_faulty, rest_px[:, 0] < np.median(rest_px[:, 0]))] = False
    return Course(
        sequence=sequence,
        sensor=sensor,
        pitch_px=pitch_px,
        radius_px=radius_px,
        centre_px=centre_px,
        shape_px=radius_px * size[:, None, None] * shape_px,
        contrast=np.clip(1.0 + sequence.contrast_spread * chance.standard_normal(len(rest_px)), 0.7, 1.2),
        is_visible=is_visible,
        is_faulty=is_faulty,
        is_jump=np.concatenate([[False], (np.diff(shift_px, axis=0) != 0.0).any(axis=1)]),
        false_px=_false_spots(sequence, centre_px, is_visible, radius_px, chance),
    )


class FoldError(ValueError):
    """The sheet would fold before its dots move by the required step."""


def can_move(sequence: Sequence) -> bool:
    """Whether the sheet of a sequence makes all its steps without folding, which depends on its seed."""
    try:
        _moved(_sheet_of(sequence), sequence.frames, sequence.step_pitches)
    except FoldError:
        return False
    return True


def sensor_of(sequence: Sequence) -> tuple[Sensor, float, float]:
    """The sensor of a sequence, the pitch and the radius of its dots in px."""
    columns, rows = COUNTS[sequence.dots]
    width_px, height_px = SIZES[sequence.size]
    pitch_px = sequence.margin * min(width_px / columns, height_px / rows)
    if pitch_px < LEAST_PITCH_PX:
        raise ValueError(
            f"{sequence.dots} dots in {width_px} x {height_px} px are {pitch_px:.1f} px apart, but at least "
            f"{LEAST_PITCH_PX:g} px are needed: use fewer dots or a larger image"
        )
    radius_px = min(10.0 * height_px / 1440, 0.26 * pitch_px) if sequence.dots < 1000 else 0.0
    radius_px = max(radius_px, min(8.5 * height_px / 1440, 0.26 * pitch_px), min(2.0, 0.3 * pitch_px))
    focal_px = pitch_px * DISTANCE_MM / PITCH_MM
    # barrel distortion that moves the corners of the lattice inwards by about one per cent
    corner = np.hypot(columns, rows) / 2 * PITCH_MM / DISTANCE_MM
    camera = Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=width_px / 2 - 0.5,
        cy_px=height_px / 2 - 0.5,
        distortion=np.array([-0.01 / corner**2, 0.0, 2e-4, -2e-4, 0.0]),
        rotation_vector=np.zeros(3),
        translation_mm=np.array([0.0, 0.0, DISTANCE_MM]),
    )
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    rest_mm = np.zeros((rows * columns, 3))
    rest_mm[:, 0] = (column - (columns - 1) / 2) * PITCH_MM
    rest_mm[:, 1] = (row - (rows - 1) / 2) * PITCH_MM
    printed = np.random.default_rng([sequence.seed, 0]).standard_normal((len(rest_mm), 2))
    layout = Layout(
        rest_mm=rest_mm,
        row_column=np.column_stack([row, column]).astype(np.int64),
        pitch_mm=np.array([PITCH_MM, PITCH_MM]),
        radius_mm=np.full(len(rest_mm), PITCH_MM * radius_px / pitch_px),
        polarity="light",
        is_missing=np.zeros(len(rest_mm), dtype=bool),
        rest_px=project(camera, rest_mm) + sequence.jitter_pitches * pitch_px * printed,
    )
    return Sensor(name=f"{sequence.dots} dots", camera=camera, layout=layout), pitch_px, radius_px


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sheet:
    """What the motion of a sheet depends on; equal sheets share one computed motion."""

    dots: int
    size: str
    margin: float
    jitter_pitches: float
    is_clamped: bool
    seed: int


def _sheet_of(sequence: Sequence) -> _Sheet:
    return _Sheet(
        dots=sequence.dots,
        size=sequence.size,
        margin=sequence.margin,
        jitter_pitches=sequence.jitter_pitches,
        is_clamped=sequence.is_clamped,
        seed=sequence.seed,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Fingers:
    """Presses that move over the sheet, each a shear and a spread of Gaussian shape.

    Attributes:
        home_px, reach_px: (k, 2), (2,) centre and range of the motion of each.
        width_px: one standard deviation of the dents.
        amplitude_px: largest displacement of one.
        low_px, high_px: (2,) rim that does not move, or None.
        rim_px: distance from the rim over which the sheet becomes free.
        phase, rate: (k, 4), (k, 2) of each one's path.
    """

    home_px: np.ndarray
    reach_px: np.ndarray
    width_px: float
    amplitude_px: float
    low_px: np.ndarray | None
    high_px: np.ndarray | None
    rim_px: float
    phase: np.ndarray
    rate: np.ndarray

    def displacement(self, point_px: np.ndarray, time: float) -> np.ndarray:
        """(n, 2) px of points at rest at a time; it is 0 at time 0."""
        moved = np.zeros_like(point_px)
        onset = min(time / 1.5, 1.0)
        onset = onset * onset * (3.0 - 2.0 * onset)
        for home_px, phase, rate in zip(self.home_px, self.phase, self.rate, strict=True):
            centre_px = home_px + self.reach_px * np.sin(rate * time + phase[:2])
            away = (point_px - centre_px) / self.width_px
            dent = np.exp(-0.5 * np.einsum("ni,ni->n", away, away))
            depth = onset * self.amplitude_px * (0.8 + 0.2 * np.sin(0.9 * time + phase[2]))
            angle = phase[3] + 1.2 * time
            shear = 0.75 * np.array([np.cos(angle), np.sin(angle)])
            moved += (depth * dent)[:, None] * (shear + 0.6 * away)
        if self.low_px is not None and self.high_px is not None:
            inward = np.minimum(point_px - self.low_px, self.high_px - point_px).min(axis=1) / self.rim_px
            share = np.clip(inward, 0.0, 1.0)
            moved *= (share * share * (3.0 - 2.0 * share))[:, None]
        return moved


def _fingers(sheet: _Sheet, rest_px: np.ndarray, pitch_px: float, step_pitches: float) -> Fingers:
    """Presses that reach far enough for a step, as far as the sheet does not fold."""
    chance = np.random.default_rng([sheet.seed, 2])
    size_px = np.array(SIZES[sheet.size], dtype=np.float64)
    low_px, high_px = rest_px.min(axis=0), rest_px.max(axis=0)
    extent_px = np.minimum(size_px, high_px - low_px)
    fingers = Fingers(
        home_px=size_px / 2 + np.array([[-0.25, 0.0], [0.25, 0.0]]) * extent_px,
        reach_px=np.array([0.12, 0.18]) * extent_px,
        width_px=min((5.5 + step_pitches) * pitch_px, 0.28 * float(size_px.min())),
        amplitude_px=max(0.8, 1.2 * step_pitches) * pitch_px,
        low_px=low_px if sheet.is_clamped else None,
        high_px=high_px if sheet.is_clamped else None,
        rim_px=4.0 * pitch_px,
        phase=chance.uniform(0.0, 2 * np.pi, (FINGERS, 4)),
        rate=chance.uniform(0.6, 1.4, (FINGERS, 2)),
    )
    steepest = max(_steepest(fingers, rest_px, time) for time in np.linspace(1.0, 40.0, 40))
    return replace(fingers, amplitude_px=fingers.amplitude_px * min(1.0, STEEPEST / steepest))


def _gradient(fingers: Fingers, rest_px: np.ndarray, time: float) -> np.ndarray:
    """(n, 2, 2) derivative of the displacement: row x or y of the displacement, column along x or y."""
    along = []
    for step in np.eye(2):
        ahead = fingers.displacement(rest_px + step, time) - fingers.displacement(rest_px - step, time)
        along.append(ahead / 2.0)
    return np.stack(along, axis=-1)


def _steepest(fingers: Fingers, rest_px: np.ndarray, time: float) -> float:
    return float(np.linalg.norm(_gradient(fingers, rest_px, time), axis=(1, 2), ord=2).max())


@lru_cache(maxsize=16)
def _moved(sheet: _Sheet, frames: int, step_pitches: float) -> tuple[np.ndarray, np.ndarray]:
    """(f, m, 2) centres in px, and (f, m, 2, 2) deformation of each dot."""
    sensor, pitch_px, _ = sensor_of(
        Sequence(
            dots=sheet.dots,
            size=sheet.size,
            margin=sheet.margin,
            jitter_pitches=sheet.jitter_pitches,
            seed=sheet.seed,
        )
    )
    rest_px = sensor.layout.rest_px
    fingers = _fingers(sheet, rest_px, pitch_px, step_pitches)
    target_px = step_pitches * pitch_px
    times = [0.0]
    length = 0.05
    for index in range(frames - 1):
        share = 0.5 if index < TOUCHING else 1.0
        length = _time_to_move(fingers, rest_px, times[-1], target_px=share * target_px, usual=length)
        times.append(times[-1] + length)
    centre_px = np.stack([rest_px + fingers.displacement(rest_px, time) for time in times])
    shape = np.stack([np.eye(2) + _gradient(fingers, rest_px, time) for time in times])
    centre_px.flags.writeable = shape.flags.writeable = False
    return centre_px, shape


def _time_to_move(
    fingers: Fingers, rest_px: np.ndarray, time: float, *, target_px: float, usual: float
) -> float:
    """Time after which the fastest dot has moved by a distance."""
    if target_px <= 0.0:
        return usual
    before = fingers.displacement(rest_px, time)

    def moved_px(length: float) -> float:
        away = fingers.displacement(rest_px, time + length) - before
        return float(np.sqrt(np.einsum("ni,ni->n", away, away).max()))

    low, high = 0.0, 0.5 * usual
    while moved_px(high) < target_px:
        low, high = high, high + min(0.3 * high, 0.2)
        if high > 20.0:
            raise FoldError(
                f"the sheet would fold before a dot moves by {target_px:.1f} px: use a smaller step"
            )
    while high - low > 1e-4 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if moved_px(middle) < target_px else (low, middle)
    return high


def _shifts(sequence: Sequence, pitch_px: float, chance: np.random.Generator) -> np.ndarray:
    """(f, 2) px by which the whole view is shifted: away and back, each time in another direction."""
    shift_px = np.zeros((sequence.frames, 2))
    if sequence.shift_pitches > 0.0:
        for begin in range(5, sequence.frames, 10):
            # Half of the shifts are along the lattice, where a pitch is hardest to detect.
            angle = chance.integers(4) * np.pi / 2 if chance.random() < 0.5 else chance.uniform(0, 2 * np.pi)
            away = sequence.shift_pitches * pitch_px * np.array([np.cos(angle), np.sin(angle)])
            shift_px[begin : begin + 5] = away
    return shift_px


def _absent(
    sequence: Sequence, rest_px: np.ndarray, pitch_px: float, chance: np.random.Generator
) -> np.ndarray:
    """(f, m) dots that are missing in all frames or in one, or are in the hole."""
    shape = (sequence.frames, len(rest_px))
    worn = chance.random(len(rest_px)) < sequence.missing_share / 2
    absent = worn | (chance.random(shape) < sequence.missing_share / 2)
    absent[0] = worn
    if sequence.hole_pitches > 0.0:
        low, high = rest_px.min(axis=0), rest_px.max(axis=0)
        along = np.linspace(0.0, 2 * np.pi, sequence.frames, endpoint=False)
        path = (low + high) / 2 + 0.25 * (high - low) * np.column_stack([np.cos(along), np.sin(2 * along)])
        away = np.linalg.norm(rest_px - path[:, None], axis=2)
        absent |= away < sequence.hole_pitches * pitch_px
    if sequence.hidden_share > 0.0:
        absent[1:] |= chance.random((sequence.frames - 1, len(rest_px))) < sequence.hidden_share
    return absent


def _false_spots(
    sequence: Sequence,
    centre_px: np.ndarray,
    is_visible: np.ndarray,
    radius_px: float,
    chance: np.random.Generator,
) -> tuple[np.ndarray, ...]:
    """False dots of the usual size that touch no dot."""
    from scipy.spatial import cKDTree

    size_px = np.array(SIZES[sequence.size]) - 2 * radius_px - 1
    half = round(0.5 * sequence.false_share * centre_px.shape[1])

    def anywhere() -> np.ndarray:
        return radius_px + chance.random((8 * half, 2)) * size_px

    dirt = anywhere()
    spots = []
    for frame, seen in zip(centre_px, is_visible, strict=True):
        if half == 0 or not seen.any():
            spots.append(np.zeros((0, 2)))
            continue
        dots = cKDTree(frame[seen])
        # The first free ones of many positions: those of the dirt are the same in nearly all frames.
        free = [place[dots.query(place)[0] > 2.6 * radius_px][:half] for place in (dirt, anywhere())]
        spots.append(np.concatenate(free))
    return tuple(spots)


def dots_in(course: Course, index: int, *, noise_px: float = 0.015) -> Detections:
    """The dots of a frame as a detection gives them: unordered, each with its own noise, false ones too.

    Each dot's noise is drawn from its own covariance, between 0.7 and 1.4 times `noise_px`; areas and
    contrasts are off by up to 2 %. A blurred frame shows half of its dots, with ten times the noise.
    """
    sequence = course.sequence
    chance = np.random.default_rng([sequence.seed, 3, index])
    is_blurred = sequence.fault == "blurred" and bool(course.is_faulty[index])
    shown = course.is_visible[index]
    if is_blurred:
        shown = shown & (chance.random(len(shown)) < 0.5)
    true_px = np.concatenate([course.centre_px[index][shown], course.false_px[index]])
    order = chance.permutation(len(true_px))
    true_px = true_px[order]
    std_px = noise_px * chance.uniform(0.7, 1.4, len(true_px)) * (10.0 if is_blurred else 1.0)
    status = Status.OK
    if course.is_faulty[index]:
        status = {
            "black": Status.DARK,
            "saturated": Status.SATURATED,
            "flash": Status.SATURATED,
            "blurred": Status.BLURRED,
        }.get(sequence.fault, Status.OK)
    spots = np.ones(len(course.false_px[index]))
    area_px2 = np.concatenate([np.linalg.det(course.shape_px[index][shown]), course.radius_px**2 * spots])
    contrast = np.concatenate([course.contrast[shown], spots])
    return Detections(
        centre_px=true_px + std_px[:, None] * chance.standard_normal(true_px.shape),
        covariance_px2=std_px[:, None, None] ** 2 * np.eye(2),
        area_px2=np.pi * area_px2[order] * chance.uniform(0.98, 1.02, len(true_px)),
        contrast=160.0 * contrast[order] * chance.uniform(0.98, 1.02, len(true_px)),
        status=status,
    )


def picture(course: Course, index: int) -> np.ndarray:
    """(h, w) uint8: the image of a frame."""
    sequence = course.sequence
    width_px, height_px = SIZES[sequence.size]
    shown = course.is_visible[index]
    false_px = course.false_px[index]
    round_spots = np.tile(course.radius_px * np.eye(2), (len(false_px), 1, 1))
    image = render_discs(
        np.concatenate([course.centre_px[index][shown], false_px]),
        np.concatenate([course.shape_px[index][shown], round_spots]),
        width_px=width_px,
        height_px=height_px,
        blur_px=1.0 if course.radius_px > 4.0 else 0.7,
        look=Look(
            ground=18.0,
            dot=190.0,
            tilt_x=-0.1,
            tilt_y=0.06,
            vignetting=0.25,
            read_noise=float(np.sqrt(1.0 - sequence.light_noise**2)) * sequence.noise,
            shot_noise=(sequence.light_noise * sequence.noise) ** 2 / 60.0,
        ),
        contrast=np.concatenate([course.contrast[shown], np.ones(len(false_px))]),
        seed=(sequence.seed << 32) + index,
    )
    if not course.is_faulty[index] or sequence.fault == "hidden":
        return image
    if sequence.fault == "black":
        return (image // 8).astype(np.uint8)
    if sequence.fault == "blurred":
        return cv2.GaussianBlur(image, (0, 0), 1.2 * course.radius_px)
    return np.maximum(image, 200) + np.uint8(55)


def pictures(course: Course) -> list[Frame]:
    """All frames of a sequence; drawn once, then read from a temporary folder."""
    file = cache_folder() / f"{_key(course.sequence)}.npz"
    if file.exists():
        with np.load(file) as stored:
            images = stored["images"]
    else:
        images = np.stack([picture(course, index) for index in range(course.sequence.frames)])
        file.parent.mkdir(parents=True, exist_ok=True)
        temporary = file.with_suffix(".part.npz")
        np.savez(temporary, images=images)
        temporary.replace(file)
    images.flags.writeable = False
    return [_frame(index, image) for index, image in enumerate(images)]


def jpegs(frames: list[Frame], quality: int = 90) -> list[bytes]:
    """The frames as an MJPEG camera sends them."""
    option = [cv2.IMWRITE_JPEG_QUALITY, quality]
    return [cv2.imencode(".jpg", frame.image, option)[1].tobytes() for frame in frames]


def to_and_fro(count: int, length: int) -> np.ndarray:
    """Indices of `length` frames that run through `count` frames forwards and backwards: no jump."""
    there_and_back = np.concatenate([np.arange(count), np.arange(count - 2, 0, -1)])
    return np.resize(there_and_back, length)


def cache_folder() -> Path:
    """Where pictures are kept; may be removed at any time."""
    return Path(tempfile.gettempdir()) / "manytouch-benchmarks"


def _key(sequence: Sequence) -> str:
    return hashlib.sha256(f"{_VERSION} {sequence!r}".encode()).hexdigest()[:20]


def _frame(index: int, image: np.ndarray | None) -> Frame:
    return Frame(index=index, timestamp_ns=index * 33_333_333, camera="benchmark", image=image)
