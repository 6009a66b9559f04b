"""Given contacts on a sensor to its marker field, its image or a reading, without files."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from numbers import Integral
from typing import Any, Literal, TypeVar, overload

import numpy as np
from jaxtyping import Float64

from manytouch.errors import ContactError, SensorError, require_type
from manytouch.simulation.contacts.coarse_sheet import (
    MOST_EVALUATIONS,
    CoarseSheet,
    DeadLoad,
    SheetEquilibrium,
)
from manytouch.simulation.contacts.kinds import (
    STEEPEST,
    Ball,
    Patch,
    PointForces,
    SimulatedContact,
    require_possible,
)
from manytouch.simulation.render.discs import DARK_DOTS
from manytouch.simulation.scene.deformation import NO_CONTACT, Deformation, TrueContact
from manytouch.simulation.scene.moving_sheet import PointMotion
from manytouch.simulation.scene.pressure_region import region_area
from manytouch.simulation.shell.live_sheet import body_contact, pressed_points
from manytouch.simulation.simulator import DEMO_LOOK, Simulator
from manytouch.simulation.views import ViewsSimulator
from manytouch.values import Detections, Frame, Reading, Sensor, Sheet
from manytouch.values.arrays import Image, Points2, Points3, read_only

Press = Sequence[SimulatedContact]
Result = TypeVar("Result")


@overload
def simulate_contacts(
    sensor: Sensor, contacts: Press, *, output: Literal["markers"] = "markers", seed: int = 0
) -> Float64[np.ndarray, "m 3"]: ...
@overload
def simulate_contacts(
    sensor: Sensor, contacts: Sequence[Press], *, output: Literal["markers"] = "markers", seed: int = 0
) -> Float64[np.ndarray, "b m 3"]: ...
@overload
def simulate_contacts(
    sensor: Sensor, contacts: Press, *, output: Literal["image"], seed: int = 0
) -> Image: ...
@overload
def simulate_contacts(
    sensor: Sensor, contacts: Sequence[Press], *, output: Literal["image"], seed: int = 0
) -> np.ndarray: ...
@overload
def simulate_contacts(
    sensor: Sensor, contacts: Press, *, output: Literal["reading"], seed: int = 0
) -> Reading: ...
@overload
def simulate_contacts(
    sensor: Sensor, contacts: Sequence[Press], *, output: Literal["reading"], seed: int = 0
) -> list[Reading]: ...
def simulate_contacts(
    sensor: Sensor,
    contacts: Press | Sequence[Press],
    *,
    output: Literal["markers", "image", "reading"] = "markers",
    seed: int = 0,
) -> Any:
    """What a clamped sheet shows under given contacts, from a shell on a coarse grid.

    Each press is solved from rest, so that its result depends on nothing else: a batch has the same bits as
    its presses one by one. docs/how-to.md states rate and errors.

    Args:
        sensor: with markers and a clamped sheet whose `young_MPa` and `poisson` are known; a pretension that
            is not known counts as none.
        contacts: those of one press, or a sequence of presses.
        output: "markers": displacements since rest; "image": what the camera sees; "reading": all true
            values, in a frame without an image.
        seed: of the noise of images; press i of a batch has seed + i.

    Returns:
        For one press; a batch has another axis b in front, or a list of readings.

        - "markers": (m, 3) displacements of the markers in mm, sheet frame; a press has z < 0. NaN outside
          the sheet.
        - "image": (h, w) grey levels.
        - "reading": true markers, surface and contacts with standard deviations of 0, contacts in their order
          as ids; without detections.

    Raises:
        ArgumentError: an argument has a wrong type.
        SensorError: the sheet of the sensor cannot be simulated.
        ContactError: a contact is outside of the sheet, too deep, or has a wrong shape.
        ValueError: the output has another name.
    """
    require_type("the sensor", sensor, Sensor, "a Sensor (manytouch.load_sensor reads one)")
    require_type("contacts", contacts, Sequence, "a list of contacts, or a list of such lists")
    require_type("the output", output, str, "markers, image or reading")
    require_type("the seed", seed, Integral, "a whole number")
    makers: dict[str, Callable[[_Press], Any]] = {"markers": _markers, "image": _image, "reading": _reading}
    if output not in makers:
        raise ValueError(f"the output is {output!r}: give one of {', '.join(makers)}")
    is_batch = any(isinstance(each, Sequence) for each in contacts)
    presses: Sequence[Any] = contacts if is_batch else [contacts]
    sheet = _require_sheet(sensor)
    solver = _solver(sheet)
    results = []
    for number, press in enumerate(presses):
        where = f"press {number}: " if is_batch else ""
        require_type(f"{where}contacts", press, Sequence, "a list of contacts")
        for place, contact in enumerate(press):
            require_possible(contact, f"{where}contact {place}", sheet, solver.spacing_mm)
        results.append(makers[output](_Press(sensor, press, solver.solve(press, where), int(seed) + number)))
    if not is_batch:
        return results[0]
    return results if output == "reading" else np.stack(results)


@dataclass(frozen=True, slots=True, eq=False)
class _Press:
    """A solved press: sensor, contacts as given, the pressed sheet, the seed of its noise."""

    sensor: Sensor
    contacts: Press
    pressed: SheetEquilibrium
    seed: int

    def true_contacts(self) -> dict[int, TrueContact]:
        """The contacts that touch, by their place in the list."""
        face, found, ball = self.pressed.face, {}, 0
        for number, contact in enumerate(self.contacts):
            if isinstance(contact, Ball):
                here = self._true_ball(ball)
                ball += 1
            else:
                here = _dead_contact(contact, face, self.pressed.energy.half_mm)
            if here is not NO_CONTACT:
                found[number] = here
        return found

    def _true_ball(self, number: int) -> TrueContact:
        """What a ball does to the sheet, with its region."""
        pressed, layout = self.pressed, self.sensor.layout
        assert layout is not None
        found = body_contact(pressed.energy, pressed.loads, number, pressed.face)
        if not found.is_touching:
            return found
        points = pressed_points(pressed.energy, pressed.loads, number)
        return replace(found, region_mm2=region_area(*points, float(np.sqrt(np.prod(layout.pitch_mm)))))

    def simulator(self) -> Simulator | ViewsSimulator:
        """The simulated sensor under the press."""
        layout = self.sensor.layout
        assert layout is not None
        is_dark = layout.polarity == "dark"
        look = replace(DEMO_LOOK, ground=DARK_DOTS.ground, dot=DARK_DOTS.dot) if is_dark else DEMO_LOOK
        scene = _StillSheet(self.pressed.face, self.true_contacts(), self.seed)
        kind = ViewsSimulator if self.sensor.camera.views else Simulator
        return kind(sensor=self.sensor, scene=scene, look=look)


@dataclass(frozen=True, slots=True, eq=False)
class _StillSheet:
    """A pressed sheet as a scene in which nothing moves."""

    face: Deformation
    true_contacts: dict[int, TrueContact]
    seed: int
    name: str = "contacts"
    duration_s: float = 1.0

    def with_duration(self, duration_s: float) -> "_StillSheet":
        """The same with another duration."""
        return replace(self, duration_s=duration_s)

    def motion_of(self, place_mm: Points2, height_mm: float = 0.0) -> PointMotion:
        """See `MovingSheet`."""
        moved_mm: Points3 = self.face.moved_mm(np.ascontiguousarray(place_mm), height_mm)
        return lambda time_s: moved_mm

    def contact_face_motion_of(self, place_mm: Points2) -> PointMotion:
        """See `MovingSheet`; the sheet is clamped."""
        return self.motion_of(place_mm)

    def contacts(self, time_s: float) -> dict[int, TrueContact]:
        """See `MovingSheet`."""
        return self.true_contacts if time_s >= 0.0 else {}


class _Solver:
    """Solves presses on one sheet; calls from several threads wait for each other."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet, self._coarse, self._lock = sheet, CoarseSheet(sheet), threading.Lock()

    @property
    def spacing_mm(self) -> float:
        return self._coarse.spacing_mm

    def solve(self, press: Press, where: str) -> SheetEquilibrium:
        """The sheet under contacts; where: which press it is, in front of errors.

        Raises:
            ContactError: there is no equilibrium, or the sheet is deeper than the model is meant for.
        """
        balls = [contact for contact in press if isinstance(contact, Ball)]
        ball_mm = np.array([[ball.x_mm, ball.y_mm, ball.depth_mm, ball.radius_mm] for ball in balls])
        forces = [_places_and_forces(contact) for contact in press if not isinstance(contact, Ball)]
        dead = DeadLoad(
            place_mm=np.concatenate([np.zeros((0, 2)), *(place_mm for place_mm, _ in forces)]),
            force_N=np.concatenate([np.zeros((0, 3)), *(force_N for _, force_N in forces)]),
        )
        with self._lock:
            pressed = self._coarse.press(ball_mm.reshape(-1, 4).astype(np.float64), dead)
        moved_mm = float(np.abs(pressed.face.face_mm[..., 2]).max())
        most_mm = STEEPEST * 0.5 * float(self._sheet.size_mm.min())
        if moved_mm > most_mm:
            raise ContactError(
                f"{where}the sheet would move by {moved_mm:.3g} mm or more, further than {most_mm:.3g} mm: "
                "press with less force, or on a larger area"
            )
        if not pressed.has_converged:
            raise ContactError(
                f"{where}no equilibrium was found after {MOST_EVALUATIONS} steps, as of a thin sheet that "
                "wrinkles: press less deep, or give the sheet more pretension"
            )
        return pressed


_solver = lru_cache(maxsize=4)(_Solver)


def _require_sheet(sensor: Sensor) -> Sheet:
    sheet = sensor.sheet
    if sheet is None or sheet.boundary != "clamped" or sheet.young_MPa is None or sheet.poisson is None:
        raise SensorError(
            f"the sheet of the sensor {sensor.name!r} cannot be simulated: [sheet] needs "
            'boundary = "clamped", young_MPa and poisson'
        )
    if sensor.layout is None:
        raise SensorError(f"the sensor {sensor.name!r} needs [markers]")
    return sheet


def _places_and_forces(contact: Patch | PointForces) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) and (n, 3) places and forces of a dead load."""
    if isinstance(contact, PointForces):
        return np.asarray(contact.place_mm, dtype=np.float64), np.asarray(contact.force_N, dtype=np.float64)
    place_mm = contact.places_mm()
    return place_mm, np.tile(np.array(contact.force_N, dtype=np.float64) / len(place_mm), (len(place_mm), 1))


def _dead_contact(contact: Patch | PointForces, face: Deformation, half_mm: float) -> TrueContact:
    """What a dead load does to the sheet; its torque is about its force centroid."""
    place_mm, force_N = _places_and_forces(contact)
    total_N = force_N.sum(axis=0)
    if not force_N.any():
        return NO_CONTACT
    moved_mm, normal = face.normals(place_mm)
    there_mm = place_mm + moved_mm[:, :2] + 2.0 * half_mm * normal[:, :2]
    weight = np.abs(force_N[:, 2]) if force_N[:, 2].any() else np.linalg.norm(force_N, axis=1)
    weight = weight / weight.sum()
    arm_mm = there_mm - weight @ there_mm
    area_mm2 = np.nan
    if isinstance(contact, Patch):
        area_mm2 = float(np.prod(contact.size_mm)) * (np.pi / 4.0 if contact.outline == "ellipse" else 1.0)
    return TrueContact(
        force_N=read_only(total_N),
        torque_Nmm=float((arm_mm[:, 0] * force_N[:, 1] - arm_mm[:, 1] * force_N[:, 0]).sum()),
        area_mm2=area_mm2,
        centre_mm=read_only(weight @ place_mm),
        depth_mm=-float(moved_mm[:, 2].min()),
    )


def _markers(press: _Press) -> Points3:
    layout = press.sensor.layout
    assert layout is not None
    return press.pressed.face.moved_mm(np.ascontiguousarray(layout.rest_mm[:, :2]), layout.height_mm)


def _image(press: _Press) -> Image:
    image = press.simulator().frame(0).image
    assert image is not None
    return image


def _reading(press: _Press) -> Reading:
    truth = press.simulator().truth(0)
    none = np.zeros(0)
    return Reading(
        frame=Frame(index=0, timestamp_ns=0, camera="sim-contacts", image=None),
        detections=Detections(
            centre_px=np.zeros((0, 2)), covariance_px2=np.zeros((0, 2, 2)), area_px2=none, contrast=none
        ),
        grid=truth.grid,
        surface=truth.surface,
        contacts=truth.contacts,
        milliseconds=float("nan"),
    )
