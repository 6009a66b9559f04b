"""Predicted accuracy of a designed sensor, once it is built and calibrated.

It is the error of the method `mechanics` on a solid sheet that was calibrated by the usual protocol
(`prototype`), over several draws of the noise of the centres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.design.dimensions import Design, light_lattice
from manytouch.design.prototype import CENTRE_NOISE_PX, FINGERTIP, ObservedPress, OnMessage, Prototype
from manytouch.estimation.mechanics.estimator import MechanicsEstimator
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.values import Contact, Sensor, TrackedGrid
from manytouch.values.arrays import Points2, read_only

SETTLING_STEPS = 6
RAMP = (0.1, 0.4, 1.0)
PLACES = (4, 3)  # along half the length and half the width
FEW_PLACES = (2, 2)
SEED = 7
DRAWS = 3
"""Draws of the noise per press."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PredictedAccuracy:
    """Standard deviations of a press at k positions, NaN where it would not be found.

    Attributes:
        place_mm: (k, 2) in a quarter of the area; the other quarters are its mirror images.
        force_N: (k,) of the press.
        depth_mm: (k,) of the press.
        position_std_mm, depth_std_mm, force_std_N: (k,); the position along an axis.
    """

    place_mm: Points2
    force_N: Float64[np.ndarray, " k"]
    depth_mm: Float64[np.ndarray, " k"]
    position_std_mm: Float64[np.ndarray, " k"]
    depth_std_mm: Float64[np.ndarray, " k"]
    force_std_N: Float64[np.ndarray, " k"]

    @property
    def rms(self) -> tuple[float, float, float]:
        """Position (mm), depth (µm) and force (%): root mean square over the positions."""
        parts = (self.position_std_mm, 1e3 * self.depth_std_mm, 100 * self.force_std_N / self.force_N)
        position, depth, force = (float(np.sqrt(np.nanmean(part**2))) for part in parts)
        return position, depth, force


def predicted_accuracy(
    sensor: Sensor,
    *,
    area_mm: tuple[float, float],
    force_N: float,
    places: tuple[int, int] = PLACES,
    on_message: OnMessage = None,
) -> PredictedAccuracy:
    """Standard deviations over a quarter of the area.

    Args:
        sensor: from `design`.
        area_mm: touchable area.
        force_N: approximate force of the presses.
        places: number of positions along x and y, from the middle to the corner of the area.
        on_message: receives progress messages.

    Raises:
        SensorError: the prototype cannot be calibrated.
    """
    random = np.random.default_rng(SEED)
    prototype = Prototype.of(sensor)
    calibrated = prototype.calibrate(random, on_message)
    x, y = (np.linspace(0.0, side / 2, count) for side, count in zip(area_mm, places, strict=True))
    place_mm = np.column_stack([part.ravel() for part in np.meshgrid(x, y)])
    method = MechanicsEstimator()
    initial = method.start(calibrated)
    rows = []
    for place, depth_mm in zip(place_mm, prototype.fingertip_depths_mm(place_mm, force_N), strict=True):
        if on_message is not None:
            on_message(f"pressing at {place[0]:.0f}, {place[1]:.0f} mm")
        rows.append(press_deviations(method, initial, prototype.press(FINGERTIP, place, depth_mm), random))
    table = read_only(np.array(rows))
    return PredictedAccuracy(
        place_mm=read_only(place_mm),
        force_N=table[:, 0],
        depth_mm=table[:, 1],
        position_std_mm=table[:, 2],
        depth_std_mm=table[:, 3],
        force_std_N=table[:, 4],
    )


def typical_force_N(found: Design) -> float:
    """The geometric mean of the smallest and the largest required force."""
    return float(np.sqrt(np.prod(found.requirements.force_N)))


def press_deviations(
    method: MechanicsEstimator,
    initial: MechanicsState,
    press: ObservedPress | None,
    random: np.random.Generator,
) -> Sequence[float]:
    """Force and depth of a press, and RMS errors of position (along an axis), depth and force."""
    if press is None:
        return (np.nan,) * 5
    true = press.contact
    off = []
    for _ in range(DRAWS):
        estimate = _estimate(method, initial, press, random)
        if estimate is None:
            return (true.normal_force_N, true.depth_mm, np.nan, np.nan, np.nan)
        depth_mm, force_N = estimate.depth_mm - true.depth_mm, -estimate.force_N[2] - true.normal_force_N
        off.append([*(estimate.centre_mm - true.centre_mm), depth_mm, force_N])
    x, y, depth, force = np.sqrt(np.mean(np.square(off), axis=0))
    return (
        true.normal_force_N,
        true.depth_mm,
        float(np.hypot(x, y) / np.sqrt(2.0)),
        float(depth),
        float(force),
    )


def _estimate(
    method: MechanicsEstimator, initial: MechanicsState, press: ObservedPress, random: np.random.Generator
) -> Contact | None:
    """The nearest contact that the method finds, or None."""
    state, displacement_px, true_mm = initial, press.displacement_px, press.contact.centre_mm
    contacts: tuple[Contact, ...] = ()
    for share in RAMP:
        for _ in range(SETTLING_STEPS if share == RAMP[-1] else 1):
            noise_px = random.normal(0.0, CENTRE_NOISE_PX, displacement_px.shape)
            position_px = initial.reference_px + share * displacement_px + noise_px
            state, _, found = method.step(state, _grid(position_px))
        contacts = found.touching
    return min(contacts, key=lambda item: float(np.linalg.norm(item.centre_mm - true_mm)), default=None)


def _grid(position_px: Points2) -> TrackedGrid:
    count = len(position_px)
    return TrackedGrid(
        position_px=read_only(position_px),
        covariance_px2=read_only(np.tile(CENTRE_NOISE_PX**2 * np.eye(2), (count, 1, 1))),
        is_seen=read_only(np.ones(count, dtype=np.bool_)),
        frames_unseen=read_only(np.zeros(count, dtype=np.int64)),
    )


def scale_design(
    found: Design, *, pitch: float = 1.0, thickness: float = 1.0, stand_off: float = 1.0
) -> Sensor:
    """The designed sensor with some dimensions multiplied by factors, for the trade-off."""
    sensor = found.sensor
    layout, sheet, camera = sensor.layout, sensor.sheet, sensor.camera
    assert layout is not None and sheet is not None  # noqa: PT018 - a design has both
    if pitch != 1.0:
        wide = float(layout.pitch_mm[0]) * pitch
        size = (float(sheet.size_mm[0]), float(sheet.size_mm[1]))
        layout = light_lattice(size, wide, float(layout.radius_mm[0]) * min(pitch, 1.0), layout.height_mm)
    return replace(
        sensor,
        layout=layout,
        sheet=replace(sheet, thickness_mm=sheet.thickness_mm * thickness),
        camera=replace(camera, translation_mm=read_only(camera.translation_mm * stand_off)),
    )
