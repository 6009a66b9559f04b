"""How well a designed sensor will tell a press: the deviations that the inversion itself reports.

A fingertip presses the shell at several places; the dots that the camera would see go through the method
`mechanics`, and the deviations of its contact are taken: noise of the centres and the model's error, both
as the method states them on real readings.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.design.choose import RIM_MM, Design, lattice
from manytouch.design.deflection import FINGERTIP_MM2, fingertip
from manytouch.design.wishes import Wishes
from manytouch.estimation.inversion import InversionMemory, MechanicalInversion
from manytouch.mechanics.equilibrium import equilibrium
from manytouch.values import Contact, Sensor, TrackedGrid
from manytouch.values.arrays import Points2, read_only

CENTRE_NOISE_PX = 0.03
SETTLING_STEPS = 6
RAMP = (0.1, 0.4, 1.0)
PLACES = (4, 3)  # along half the length and half the width


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PredictedAccuracy:
    """Deviations of a press at k places, NaN where it would not be found.

    Attributes:
        place_mm: (k, 2) in a quarter of the area; the others are like it.
        force_N: of the press.
        depth_mm: (k,) how deep it goes there.
        position_std_mm, depth_std_mm, force_std_N: (k,); position: the larger of x and y.
    """

    place_mm: Points2
    force_N: float
    depth_mm: Float64[np.ndarray, " k"]
    position_std_mm: Float64[np.ndarray, " k"]
    depth_std_mm: Float64[np.ndarray, " k"]
    force_std_N: Float64[np.ndarray, " k"]


def predicted_accuracy(
    found: Design, *, places: tuple[int, int] = PLACES, say: Callable[[str], object] | None = None
) -> PredictedAccuracy:
    """Deviations over a quarter of the area, for the geometric mean of the wished forces.

    Args:
        found: from `design`.
        places: how many along x and y, from the middle to the corner of the area.
        say: told what is being computed.
    """
    if say is not None:
        say(f"pressing at {places[0] * places[1]} places")
    force_N = float(np.sqrt(np.prod(found.wishes.force_N)))
    x, y = (
        np.linspace(0.0, side / 2, count) for side, count in zip(found.wishes.area_mm, places, strict=True)
    )
    place_mm = np.column_stack([part.ravel() for part in np.meshgrid(x, y)])
    rows = np.array(list(_pressed(found.sensor, place_mm, force_N)))
    return PredictedAccuracy(
        place_mm=read_only(place_mm),
        force_N=force_N,
        depth_mm=read_only(rows[:, 0]),
        position_std_mm=read_only(rows[:, 1]),
        depth_std_mm=read_only(rows[:, 2]),
        force_std_N=read_only(rows[:, 3]),
    )


def predicted_at(sensor: Sensor, wishes: Wishes) -> tuple[float, float, float]:
    """Deviations of position (mm), depth (µm) and force (% of it) of a press in the middle."""
    force_N = float(np.sqrt(np.prod(wishes.force_N)))
    _, position, depth, force = next(_pressed(sensor, np.zeros((1, 2)), force_N))
    return position, 1e3 * depth, 100 * force / force_N


def _pressed(sensor: Sensor, place_mm: Points2, force_N: float) -> Iterator[tuple[float, ...]]:
    """Depth and deviations of position, depth and force at each place."""
    sheet = sensor.sheet
    assert sheet is not None and sheet.young_MPa is not None  # noqa: PT018 - a design has both
    method = MechanicalInversion()
    fresh = method.start(sensor)
    for place in place_mm:
        contact = _found(method, fresh, place, force_N / sheet.young_MPa)
        if contact is None:
            yield (np.nan,) * 4
            continue
        position = max(contact.std("x"), contact.std("y"))
        yield contact.depth_mm, position, contact.std("depth"), contact.std("normal_force")


def _found(
    method: MechanicalInversion, fresh: InversionMemory, place: np.ndarray, force_over_E_mm2: float
) -> Contact | None:
    """The contact that the method finds at a place, or None."""
    model = fresh.model
    points, weight = fingertip(np.sqrt(FINGERTIP_MM2 / np.pi))
    load = np.zeros((model.patch.node_count, 3))
    load[:, 2] = -model.patch.load(place + points, weight)
    shape, state = None, fresh
    contacts: tuple[Contact, ...] = ()
    for share in RAMP:
        shape = equilibrium(model.shell, share * force_over_E_mm2 * load, start_mm=shape).coefficient_mm
        grid = _seen(fresh.reference_px + model.dots.displacement_px(shape))
        for _ in range(SETTLING_STEPS if share == RAMP[-1] else 1):
            state, _, read = method.step(state, grid)
        contacts = read.touching
    near = [item for item in contacts if np.linalg.norm(item.centre_mm - place) < 2 * RIM_MM]
    return max(near, key=lambda item: item.depth_mm, default=None)


def _seen(position_px: Points2) -> TrackedGrid:
    count = len(position_px)
    return TrackedGrid(
        position_px=read_only(position_px),
        covariance_px2=read_only(np.tile(CENTRE_NOISE_PX**2 * np.eye(2), (count, 1, 1))),
        is_seen=read_only(np.ones(count, dtype=np.bool_)),
        frames_unseen=read_only(np.zeros(count, dtype=np.int64)),
    )


def changed(found: Design, *, pitch: float = 1.0, thickness: float = 1.0, stand_off: float = 1.0) -> Sensor:
    """The designed sensor with one measure a factor larger, to see what it would cost or gain."""
    sensor = found.sensor
    layout, sheet, camera = sensor.layout, sensor.sheet, sensor.camera
    assert layout is not None and sheet is not None  # noqa: PT018 - a design has both
    if pitch != 1.0:
        wide = float(layout.pitch_mm[0]) * pitch
        size = (float(sheet.size_mm[0]), float(sheet.size_mm[1]))
        layout = lattice(size, wide, float(layout.radius_mm[0]) * min(pitch, 1.0), layout.height_mm)
    return replace(
        sensor,
        layout=layout,
        sheet=replace(sheet, thickness_mm=sheet.thickness_mm * thickness),
        camera=replace(camera, translation_mm=read_only(camera.translation_mm * stand_off)),
    )
