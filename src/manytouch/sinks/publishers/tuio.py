"""TUIO 1.1 and 2.0: contacts as the cursors, pointers and blobs of a touch screen.

TUIO 1.1 (tuio.org/?specification): a bundle per profile with `source`, `alive`, one `set` per contact and
`fseq`. Profiles: `2Dcur` (s x y X Y m), `25Dcur` (s x y z X Y Z m; z is the pressure, since the standard has
no field for it) and `2Dblb` (s x y a w h f X Y A m r).

TUIO 2.0 (tuio.org/?tuio20): one bundle with `/tuio2/frm` (f_id time dim source), for each contact
`/tuio2/ptr` (s_id tu_id c_id x_pos y_pos angle shear radius press x_vel y_vel p_vel m_acc p_acc) and
`/tuio2/bnd` (s_id x_pos y_pos angle width height area), and `/tuio2/alv`.

Velocities are in widths and heights of the sheet per second; accelerations are 0.
"""

import time
from collections.abc import Sequence
from typing import Any

from manytouch.sinks.publishers.touches import NormalisedTouch, TouchScale
from manytouch.sinks.publishers.udp import Message
from manytouch.values import Reading

PORT = 3333
SOURCE = "manytouch"
PROFILES = ("2Dcur", "25Dcur", "2Dblb")
POINTER_TYPE = 0  # unknown user, unknown finger


class Tuio11:
    """Encoder of TUIO 1.1."""

    def __init__(self, scale: TouchScale) -> None:
        self._scale = scale
        self._sequence = 0

    def __call__(self, reading: Reading) -> Sequence[Sequence[Message]]:
        """A bundle for each profile."""
        self._sequence += 1
        touches = self._scale(reading)
        return [self._bundle(f"/tuio/{profile}", profile, touches) for profile in PROFILES]

    def _bundle(self, path: str, profile: str, touches: Sequence[NormalisedTouch]) -> list[Message]:
        return [
            (path, [("s", "source"), ("s", SOURCE)]),
            (path, [("s", "alive"), *(("i", touch.id) for touch in touches)]),
            *((path, [("s", "set"), ("i", touch.id), *_floats(_set(profile, touch))]) for touch in touches),
            (path, [("s", "fseq"), ("i", self._sequence)]),
        ]


def _set(profile: str, touch: NormalisedTouch) -> tuple[float, ...]:
    """Numbers of a `set` message behind the session id."""
    place, velocity = (touch.x, touch.y), (touch.x_per_s, touch.y_per_s)
    if profile == "2Dcur":
        return *place, *velocity, 0.0
    if profile == "25Dcur":
        return *place, touch.pressure, *velocity, 0.0, 0.0
    size = (touch.angle_rad, touch.width, touch.height, touch.area)
    return *place, *size, *velocity, 0.0, 0.0, 0.0


class Tuio20:
    """Encoder of TUIO 2.0.

    The time of a bundle is the Unix time at which it is encoded; the dimension of the sensor is the size of
    the camera's image.
    """

    def __init__(self, scale: TouchScale, size_px: tuple[int, int]) -> None:
        self._scale = scale
        self._dimension = size_px[0] << 16 | size_px[1]
        self._sequence = 0

    def __call__(self, reading: Reading) -> Sequence[Sequence[Message]]:
        """One bundle."""
        self._sequence += 1
        touches = self._scale(reading)
        frame: list[tuple[str, Any]] = [
            ("i", self._sequence),
            ("t", time.time()),
            ("i", self._dimension),
            ("s", f"{SOURCE}:0"),
        ]
        return [
            [
                ("/tuio2/frm", frame),
                *(message for touch in touches for message in _pointer(touch)),
                ("/tuio2/alv", [("i", touch.id) for touch in touches]),
            ]
        ]


def _pointer(touch: NormalisedTouch) -> tuple[Message, Message]:
    radius = 0.5 * (touch.width + touch.height) / 2.0
    pointer = (touch.x, touch.y, touch.angle_rad, 0.0, radius, touch.pressure)
    motion = (touch.x_per_s, touch.y_per_s, 0.0, 0.0, 0.0)
    bounds = (touch.x, touch.y, touch.angle_rad, touch.width, touch.height, touch.area)
    return (
        ("/tuio2/ptr", [*_integers(touch.id, POINTER_TYPE, 0), *_floats((*pointer, *motion))]),
        ("/tuio2/bnd", [*_integers(touch.id), *_floats(bounds)]),
    )


def _floats(values: Sequence[float]) -> list[tuple[str, object]]:
    return [("f", value) for value in values]


def _integers(*values: int) -> list[tuple[str, object]]:
    return [("i", value) for value in values]
