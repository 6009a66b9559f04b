"""Contacts as protocols for touch screens and music describe them: places and pressures from 0 to 1."""

from dataclasses import dataclass

import numpy as np

from manytouch.pipeline import Controls
from manytouch.sinks.display_grid import grid_corners
from manytouch.sinks.publishers.address import OutputAddress
from manytouch.values import Contact, Reading, Sensor

FORCE_N, DEPTH_PITCH = 10.0, 1.0
FULL_SCALES = ("force-N", "depth-pitch")


@dataclass(frozen=True, slots=True, kw_only=True)
class NormalisedTouch:
    """A contact in normalised numbers.

    Attributes:
        id: of the contact.
        x, y: centre, 0..1 from left to right and from top to bottom of the markers and half a pitch beyond.
        pressure: 0..1, normal force over that of full scale, or depth over that of full scale if the force
            is unknown.
        x_per_s, y_per_s: velocity; 0 in the first frame of a contact.
        angle_rad: of the major axis of the ellipse, 0 if unknown.
        width, height: full axes of the ellipse over the width of the sheet and over its height; 0 if unknown.
        area: of the contact's region over the area of the sheet; 0 if unknown.
    """

    id: int
    x: float
    y: float
    pressure: float
    x_per_s: float
    y_per_s: float
    angle_rad: float
    width: float
    height: float
    area: float


class TouchScale:
    """Converts readings to touches, in order; it keeps the last places for the velocities."""

    def __init__(self, sensor: Sensor, *, force_N: float = FORCE_N, depth_pitch: float = DEPTH_PITCH) -> None:
        """Prepare.

        Args:
            sensor: with its layout.
            force_N: normal force of full scale.
            depth_pitch: depth of full scale, in pitches, where the force is unknown.
        """
        layout = sensor.layout
        if layout is None:
            raise ValueError("the sensor has no layout")
        self._low, self._high = grid_corners(layout)
        self._force_N = force_N
        self._depth_mm = depth_pitch * float(np.sqrt(np.prod(layout.pitch_mm)))
        self._last: dict[int, tuple[float, float]] = {}
        self._last_ns: int | None = None

    def __call__(self, reading: Reading) -> tuple[NormalisedTouch, ...]:
        """The contacts that are present in a reading, without those that just ended."""
        now_ns = reading.frame.timestamp_ns
        step_s = 0.0 if self._last_ns is None else (now_ns - self._last_ns) * 1e-9
        touches = tuple(self._touch(contact, step_s) for contact in reading.contacts.touching)
        self._last = {touch.id: (touch.x, touch.y) for touch in touches}
        self._last_ns = now_ns
        return touches

    def pressure(self, contact: Contact) -> float:
        """Pressure of a contact, 0..1."""
        force_N = float(-contact.force_N[2])
        share = force_N / self._force_N if np.isfinite(force_N) else contact.depth_mm / self._depth_mm
        return float(np.clip(np.nan_to_num(share), 0.0, 1.0))

    def _touch(self, contact: Contact, step_s: float) -> NormalisedTouch:
        size = self._high - self._low
        x, y = (float(value) for value in np.clip((contact.centre_mm - self._low) / size, 0.0, 1.0))
        before = self._last.get(contact.id)
        moved = (0.0, 0.0) if before is None or step_s <= 0 else (x - before[0], y - before[1])
        return NormalisedTouch(
            id=contact.id,
            x=x,
            y=y,
            pressure=self.pressure(contact),
            x_per_s=moved[0] / step_s if step_s > 0 else 0.0,
            y_per_s=moved[1] / step_s if step_s > 0 else 0.0,
            angle_rad=_known(contact.orientation_rad),
            width=_known(2.0 * contact.half_major_mm / float(size[0])),
            height=_known(2.0 * contact.half_minor_mm / float(size[1])),
            area=_known(contact.area_mm2 / float(size[0] * size[1])),
        )


def scale_of(address: OutputAddress, controls: Controls) -> TouchScale:
    """The scale that the options of an address give.

    Raises:
        ManytouchError: an option is wrong.
    """
    force_N, depth_pitch = full_scales(address)
    return TouchScale(controls.sensor, force_N=force_N, depth_pitch=depth_pitch)


def full_scales(address: OutputAddress) -> tuple[float, float]:
    """Force (N) and depth (pitches) of a full touch, by the options of an address.

    Raises:
        ManytouchError: an option is wrong.
    """
    return (
        address.number("force-N", FORCE_N, (1e-6, 1e6)),
        address.number("depth-pitch", DEPTH_PITCH, (1e-3, 1e3)),
    )


def _known(value: float) -> float:
    return float(value) if np.isfinite(value) else 0.0
