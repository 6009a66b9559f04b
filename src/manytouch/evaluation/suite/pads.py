"""Cases of bonded pads: solved presses that ship with the package, their pictures and their sensor files."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np

from manytouch.evaluation.suite.cases import HOLD_FRAMES, PAD_GROUPS, REST_FRAMES, Case
from manytouch.simulation.render.discs import DARK_DOTS
from manytouch.simulation.scene.deformation import Deformation, undeformed
from manytouch.simulation.scene.deformation_file import read_deformations
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Camera, Frame, Layout, Sensor, Sheet, Truth
from manytouch.values.arrays import read_only

FPS = 30.0
WIDTH_PX, HEIGHT_PX, FOCAL_PX, DISTANCE_MM = 640, 480, 598.0, 25.0
WINDOW_MM, WINDOW_INDEX, PAD_INDEX = 3.0, 1.49, 1.41
NOMINAL = {"young_MPa": 1.2, "thickness_mm": 1.04}
"""What the nominal file states over the truth; its deviations are those of `--sensor gelsight-mini`."""
NOMINAL_POISSON = -0.006
NOMINAL_STD = {"young_MPa": 0.3, "thickness_mm": 0.05, "poisson": 0.01, "marker_depth_mm": 0.1}


@dataclass(frozen=True, slots=True, kw_only=True)
class PadCase(Case):
    """A press on a bonded pad, three depths held for four frames each after 15 frames at rest.

    Attributes:
        solution: file in `deformations` with the plane of the markers and the contact face at each depth.
        marker_depth_mm: below the contact face.
        rows, columns: of the markers.
    """

    solution: str
    marker_depth_mm: float
    rows: int = 7
    columns: int = 9

    @property
    def frame_count(self) -> int:
        """Frames of its recording."""
        return REST_FRAMES + 3 * HOLD_FRAMES


_GEL = {
    "size_mm": (25.0, 21.0),
    "thickness_mm": 4.0,
    "young_MPa": 0.3,
    "poisson": 0.48,
    "marker_depth_mm": 0.5,
    "pitch_mm": 2.0,
}
_THIN = {
    "size_mm": (20.0, 20.0),
    "thickness_mm": 2.5,
    "young_MPa": 0.4,
    "poisson": 0.49,
    "marker_depth_mm": 0.3,
    "pitch_mm": 1.9,
}
_SOFT = _GEL | {"young_MPa": 0.2, "poisson": 0.45, "marker_depth_mm": 0.3}
_DEEP = _GEL | {"young_MPa": 0.4, "poisson": 0.49, "marker_depth_mm": 1.0}
_PRESSES: tuple[tuple[str, dict[str, object], float, bool], ...] = (
    ("ball-3-mm", _GEL, 1.0, True),
    ("flat-punch-3-mm", _GEL, 0.5, True),
    ("ball-5-mm-thin-pad", _THIN, 1.0, True),
    ("ball-5-mm-near-a-side", _GEL, 1.0, True),
    ("ball-5-mm-sticking", _GEL, 1.0, True),
    ("edge", _GEL, 1.0, True),
    ("lying-cylinder", _SOFT, 1.0, False),
    ("ball-8-mm-deep-markers", _DEEP, 1.0, False),
    ("square-5-mm", _GEL, 0.5, False),
)
"""Names, pads, largest depths, and whether they may be looked at; solved by `benchmarks/ship_pads.py`."""
QUICK = ("ball-3-mm", "ball-5-mm-near-a-side", "square-5-mm")


def pads(group: str) -> Iterator[PadCase]:
    """The cases of one of `PAD_GROUPS`."""
    for number, (name, pad, deepest_mm, looked_at) in enumerate(_PRESSES):
        yield PadCase(
            group=group,  # type: ignore[arg-type]
            name=name,
            seed=4000 + number + 100 * PAD_GROUPS.index(group),
            looked_at=looked_at,
            is_quick=name in QUICK,
            touches=(),
            deepest_mm=deepest_mm,
            noise=1.2,
            width_px=WIDTH_PX,
            solution=f"pad-{name}.npz",
            **pad,  # type: ignore[arg-type]
        )


def true_pad(case: PadCase) -> Sensor:
    """The sensor as it is."""
    return pad_sensor(
        case.title,
        size_mm=(float(case.size_mm[0]), float(case.size_mm[1])),
        thickness_mm=case.thickness_mm,
        young_MPa=case.young_MPa,
        poisson=case.poisson,
        marker_depth_mm=case.marker_depth_mm,
        rows=case.rows,
        columns=case.columns,
        pitch_mm=case.pitch_mm,
    )


def pad_sensor(
    name: str,
    *,
    size_mm: tuple[float, float],
    thickness_mm: float,
    young_MPa: float,
    poisson: float,
    marker_depth_mm: float,
    rows: int,
    columns: int,
    pitch_mm: float,
    width_px: int = WIDTH_PX,
    centre_noise_px: float = 0.03,
) -> Sensor:
    """Dark dots on a pad bonded to a window of 3 mm, 25 mm from the camera.

    Args:
        name: of the sensor.
        size_mm, thickness_mm, young_MPa, poisson, marker_depth_mm: of the pad.
        rows, columns, pitch_mm: of the dots.
        width_px: of the image, with sides of 4 to 3.
        centre_noise_px: of a dot.
    """
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    middle = 0.5 * (np.array([columns, rows]) - 1.0)
    place_mm = (np.column_stack([column, row]) - middle) * pitch_mm
    height_px, focal_px = width_px * HEIGHT_PX // WIDTH_PX, FOCAL_PX * width_px / WIDTH_PX
    return Sensor(
        name=name,
        camera=Camera(
            width_px=width_px,
            height_px=height_px,
            fx_px=focal_px,
            fy_px=focal_px,
            cx_px=0.5 * (width_px - 1),
            cy_px=0.5 * (height_px - 1),
            distortion=read_only(np.zeros(5)),
            rotation_vector=read_only(np.zeros(3)),
            translation_mm=read_only(np.array([0.0, 0.0, DISTANCE_MM])),
        ),
        layout=Layout(
            rest_mm=read_only(np.column_stack([place_mm, np.zeros(len(place_mm))])),
            row_column=read_only(np.column_stack([row, column]).astype(np.int64)),
            pitch_mm=read_only(np.full(2, pitch_mm)),
            radius_mm=read_only(np.full(len(place_mm), 0.25)),
            polarity="dark",
            is_missing=read_only(np.zeros(len(place_mm), dtype=bool)),
        ),
        sheet=Sheet(
            size_mm=read_only(np.array(size_mm)),
            thickness_mm=thickness_mm,
            young_MPa=young_MPa,
            poisson=poisson,
            boundary="bonded",
            marker_depth_mm=marker_depth_mm,
            window_mm=WINDOW_MM,
            window_index=WINDOW_INDEX,
            pad_index=PAD_INDEX,
        ),
        centre_noise_px=centre_noise_px,
    )


def given_pad(case: PadCase) -> Sensor:
    """The sensor as given to the methods: the true one, or a nominal one with wide deviations."""
    true = true_pad(case)
    sheet = true.sheet
    assert sheet is not None
    if case.group == "pads":
        return true
    young_MPa, thickness_mm = (
        case.young_MPa * NOMINAL["young_MPa"],
        case.thickness_mm * NOMINAL["thickness_mm"],
    )
    return replace(
        true,
        sheet=replace(
            sheet,
            young_MPa=young_MPa,
            young_std_MPa=NOMINAL_STD["young_MPa"] * young_MPa,
            thickness_mm=thickness_mm,
            thickness_std_mm=NOMINAL_STD["thickness_mm"] * thickness_mm,
            poisson=case.poisson + NOMINAL_POISSON,
            poisson_std=NOMINAL_STD["poisson"],
            marker_depth_std_mm=NOMINAL_STD["marker_depth_mm"],
        ),
    )


def pad_states(case: PadCase) -> tuple[tuple[Deformation, Deformation], ...]:
    """The plane of the markers and the contact face at each depth.

    Raises:
        SourceError: the file is missing or damaged.
    """
    found = read_deformations(files("manytouch.evaluation") / "deformations" / case.solution)
    depths = [key.removesuffix(" face") for key in found if key.endswith(" face")]
    return tuple((found[depth], found[f"{depth} face"]) for depth in depths)


def simulate_pad(case: PadCase) -> tuple[Sensor, tuple[Frame, ...], tuple[Truth, ...]]:
    """The true sensor, pictures and truth; depth and surface refer to the contact face over the markers."""
    sensor, states = true_pad(case), pad_states(case)
    rest = undeformed(states[0][0])
    held = [frame for step in range(len(states)) for frame in _span(step)]
    scene = SolidScene(
        name=case.title,
        time_s=np.array([0, REST_FRAMES - 1, *held, case.frame_count]) / FPS,
        states=(rest, rest, *(markers for markers, _ in states for _ in range(2)), states[-1][0]),
        seed=case.seed,
        duration_s=case.frame_count / FPS,
    )
    look = replace(
        DARK_DOTS, tilt_x=0.1, tilt_y=-0.05, vignetting=0.2, read_noise=case.noise, shot_noise=0.02
    )
    simulator = Simulator(sensor=sensor, scene=scene, fps=FPS, look=look)
    assert sensor.layout is not None
    place_mm = np.ascontiguousarray(sensor.layout.rest_mm[:, :2])
    truths = []
    for number in range(case.frame_count):
        truth, step = simulator.truth(number), (number - REST_FRAMES) // HOLD_FRAMES
        if step >= 0:
            moved_mm = read_only(states[step][1].displacement_mm(place_mm))
            position_mm = read_only(sensor.layout.rest_mm + moved_mm)
            surface = replace(truth.surface, displacement_mm=moved_mm, position_mm=position_mm)
            truth = replace(truth, surface=surface)
        truths.append(truth)
    frames = tuple(simulator.frame(number) for number in range(case.frame_count))
    return sensor, frames, tuple(truths)


def _span(step: int) -> tuple[int, int]:
    """First and last frame of a depth."""
    first = REST_FRAMES + step * HOLD_FRAMES
    return first, first + HOLD_FRAMES - 1
