"""How well a designed sensor will tell a press once it is built and calibrated.

Two parts: noise of the centres, as the normal matrix of the method `mechanics` passes it on, and what the
method is off by on a solid whose sheet was calibrated as a user does it (`prototype`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.design.choose import Design, lattice
from manytouch.design.prototype import FINGERTIP, SEEN_PX, Prototype, Say, Touched
from manytouch.estimation.mechanics.contacts import ContactEstimator, ModelError
from manytouch.estimation.mechanics.estimator import MechanicsEstimator, MechanicsState
from manytouch.values import Contact, Sensor, TrackedGrid
from manytouch.values.arrays import Points2, read_only

NO_MODEL_ERROR = ModelError(
    position_pitch=0.0,
    position_radius=0.0,
    position_clamp=0.0,
    depth_share=0.0,
    depth_pitch=0.0,
    force_share=0.0,
    force_unit=0.0,
    shear_share=0.0,
    torque_share=0.0,
    area_share=0.0,
    area_thickness2=0.0,
)
"""What the model leaves is seen on the prototype here."""
SETTLING_STEPS = 6
RAMP = (0.1, 0.4, 1.0)
PLACES = (4, 3)  # along half the length and half the width
FEW_PLACES = (2, 2)
SEED = 7


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PredictedAccuracy:
    """Deviations of a press at k places, NaN where it would not be found.

    Attributes:
        place_mm: (k, 2) in a quarter of the area; the others are like it.
        force_N: (k,) of the press.
        depth_mm: (k,) how deep it goes there.
        position_std_mm, depth_std_mm, force_std_N: (k,); position: along an axis.
    """

    place_mm: Points2
    force_N: Float64[np.ndarray, " k"]
    depth_mm: Float64[np.ndarray, " k"]
    position_std_mm: Float64[np.ndarray, " k"]
    depth_std_mm: Float64[np.ndarray, " k"]
    force_std_N: Float64[np.ndarray, " k"]

    @property
    def usual(self) -> tuple[float, float, float]:
        """Position (mm), depth (µm) and force (% of it): root mean square over the places."""
        parts = (self.position_std_mm, 1e3 * self.depth_std_mm, 100 * self.force_std_N / self.force_N)
        position, depth, force = (float(np.sqrt(np.nanmean(part**2))) for part in parts)
        return position, depth, force


def predicted_accuracy(
    sensor: Sensor,
    *,
    area_mm: tuple[float, float],
    force_N: float,
    places: tuple[int, int] = PLACES,
    say: Say = None,
) -> PredictedAccuracy:
    """Deviations over a quarter of the area.

    Args:
        sensor: from `design`.
        area_mm: that can be touched.
        force_N: about which the presses have.
        places: how many along x and y, from the middle to the corner of the area.
        say: told what is being computed.

    Raises:
        SensorError: the prototype cannot be calibrated.
    """
    chance = np.random.default_rng(SEED)
    prototype = Prototype.of(sensor)
    calibrated = prototype.calibrated(chance, say)
    x, y = (np.linspace(0.0, side / 2, count) for side, count in zip(area_mm, places, strict=True))
    place_mm = np.column_stack([part.ravel() for part in np.meshgrid(x, y)])
    method = MechanicsEstimator(contact_estimator=ContactEstimator(error=NO_MODEL_ERROR))
    fresh = method.start(calibrated)
    rows = []
    for place, depth_mm in zip(place_mm, prototype.fingertip_depths_mm(place_mm, force_N), strict=True):
        if say is not None:
            say(f"touching it at {place[0]:.0f}, {place[1]:.0f} mm")
        rows.append(_deviations(method, fresh, prototype.touched(FINGERTIP, place, depth_mm), chance))
    table = read_only(np.array(rows))
    return PredictedAccuracy(
        place_mm=read_only(place_mm),
        force_N=table[:, 0],
        depth_mm=table[:, 1],
        position_std_mm=table[:, 2],
        depth_std_mm=table[:, 3],
        force_std_N=table[:, 4],
    )


def usual_force_N(found: Design) -> float:
    """The geometric mean of the smallest and the largest force that were wished for."""
    return float(np.sqrt(np.prod(found.wishes.force_N)))


def _deviations(
    method: MechanicsEstimator, fresh: MechanicsState, touched: Touched | None, chance: np.random.Generator
) -> Sequence[float]:
    """Force and depth of a press, and the deviations of position, depth and force."""
    if touched is None:
        return (np.nan,) * 5
    true = touched.contact
    told = _told(method, fresh, touched, chance)
    if told is None:
        return (true.normal_force_N, true.depth_mm, np.nan, np.nan, np.nan)
    off_mm = told.centre_mm - true.centre_mm
    position = np.sqrt(0.5 * (off_mm @ off_mm + told.std("x") ** 2 + told.std("y") ** 2))
    depth = np.hypot(told.depth_mm - true.depth_mm, told.std("depth"))
    force = np.hypot(-told.force_N[2] - true.normal_force_N, told.std("normal_force"))
    return (true.normal_force_N, true.depth_mm, float(position), float(depth), float(force))


def _told(
    method: MechanicsEstimator, fresh: MechanicsState, touched: Touched, chance: np.random.Generator
) -> Contact | None:
    """The nearest contact that the method finds, or None."""
    state, moved, true_mm = fresh, touched.displacement_px, touched.contact.centre_mm
    contacts: tuple[Contact, ...] = ()
    for share in RAMP:
        for _ in range(SETTLING_STEPS if share == RAMP[-1] else 1):
            noise_px = chance.normal(0.0, SEEN_PX, moved.shape)
            state, _, read = method.step(state, _seen(fresh.reference_px + share * moved + noise_px))
        contacts = read.touching
    return min(contacts, key=lambda item: float(np.linalg.norm(item.centre_mm - true_mm)), default=None)


def _seen(position_px: Points2) -> TrackedGrid:
    count = len(position_px)
    return TrackedGrid(
        position_px=read_only(position_px),
        covariance_px2=read_only(np.tile(SEEN_PX**2 * np.eye(2), (count, 1, 1))),
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
