"""A designed sensor before it is built: its sheet as a solid, pressed in 3-D and seen by its camera.

The shell that the inversion knows and a solid differ, by more than noise does, and calibration takes away
a part of that: how large a part no formula tells. So the sheet is pressed as finite elements, calibrated
from a foot at the places of the probing script, and touched with a ball like a fingertip.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from manytouch.calibration.protocol import DEPTHS_MM, places_mm
from manytouch.calibration.sheet import calibrate_sheet
from manytouch.calibration.sheet_fit import Press
from manytouch.simulation.condensed import condensed
from manytouch.simulation.deformation import Deformation, TrueContact
from manytouch.simulation.fem.indenters import RoundPunch, Sphere
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.fem.material import NeoHooke
from manytouch.simulation.fem.sheet import SheetModel, sheet_solver, solve_sheet
from manytouch.simulation.fem.solve import Solver
from manytouch.simulation.imaging import dot_ellipses, outlines
from manytouch.simulation.solid_scene import SolidScene
from manytouch.values import Sensor
from manytouch.values.arrays import Points2

FOOT = RoundPunch(radius_mm=5.0)
FINGERTIP = Sphere(radius_mm=8.0)
ELEMENT_THICKNESS = 1.0
ELEMENT_MM = 2.5  # a larger one is too stiff under a fingertip: depths come out too good
LEAST_ELEMENTS = 16
STEP_MM = 3.0
SEEN_PX = 0.01
"""Deviation of a marker's centre where grey levels have 2.5 (docs/derivations/detection.md)."""

Say = Callable[[str], object] | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Touched:
    """What a press shows and is.

    Attributes:
        displacement_px: (m, 2) of the markers' images.
        contact: its true force, centre and depth.
    """

    displacement_px: Points2
    contact: TrueContact


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Prototype:
    """A designed sensor whose sheet is a solid.

    Attributes:
        sensor: as designed.
        solver: of its sheet.
    """

    sensor: Sensor
    solver: Solver

    @staticmethod
    def of(sensor: Sensor) -> "Prototype":
        """The prototype of a design with a sheet of known stiffness."""
        sheet = sensor.sheet
        assert sheet is not None and sheet.young_MPa is not None and sheet.poisson is not None  # noqa: PT018
        size = (float(sheet.size_mm[0]), float(sheet.size_mm[1]))
        model = SheetModel(
            size_mm=size,
            thickness_mm=sheet.thickness_mm,
            material=NeoHooke(young_MPa=sheet.young_MPa, poisson=sheet.poisson),
            element_mm=min(ELEMENT_THICKNESS * sheet.thickness_mm, ELEMENT_MM, min(size) / LEAST_ELEMENTS),
        )
        return Prototype(sensor=sensor, solver=sheet_solver(model))

    def touched(self, body: RoundPunch | Sphere, place_mm: np.ndarray, depth_mm: float) -> Touched | None:
        """A body pressed to a depth of its lowest point; None where no equilibrium is found."""
        found = self._pressed(body, place_mm, depth_mm)
        return None if found is None else _touched(self.sensor, found, np.ones(2))

    def calibrated(self, chance: np.random.Generator, say: Say = None) -> Sensor:
        """The sensor with its sheet as `calibrate sheet` finds it from the presses of the probing script.

        Presses that are each other's mirror image are solved once.
        """
        places = places_mm(self.sensor)
        solved: dict[tuple[float, ...], Deformation | None] = {}
        held = []
        for place in places:
            for depth_mm in DEPTHS_MM:
                key = (*np.abs(place).tolist(), depth_mm)
                if key not in solved:
                    if say is not None:
                        say(f"pressing a foot {depth_mm:g} mm deep at {key[0]:g}, {key[1]:g} mm")
                    solved[key] = self._pressed(FOOT, np.abs(place), depth_mm)
                found = solved[key]
                if found is not None:
                    side = np.where(place < 0.0, -1.0, 1.0)
                    held.append(_press(_touched(self.sensor, found, side), place, chance))
        return replace(self.sensor, sheet=calibrate_sheet(self.sensor, held).sheet)

    def _pressed(
        self, body: RoundPunch | Sphere, place_mm: np.ndarray, depth_mm: float
    ) -> Deformation | None:
        sheet = self.sensor.sheet
        assert sheet is not None
        steps = int(np.ceil(depth_mm / STEP_MM))
        path = np.array([[*place_mm, depth_mm * (step + 1) / steps] for step in range(steps)])
        asked = Loading(touches=(press(body, thickness_mm=sheet.thickness_mm, path_mm=path),))
        state = list(solve_sheet(self.solver, asked))[-1]
        if state.status != "ok":
            return None
        last = press(body, thickness_mm=sheet.thickness_mm, path_mm=path[-1:])
        return condensed(state, Loading(touches=(last,)))


def _press(found: Touched, place_mm: np.ndarray, chance: np.random.Generator) -> Press:
    moved = found.displacement_px
    return Press(
        name=f"{place_mm[0]:g}, {place_mm[1]:g} mm",
        place_mm=place_mm,
        radius_mm=FOOT.radius_mm,
        displacement_px=moved + chance.normal(0.0, SEEN_PX, moved.shape),
        is_seen=np.ones(len(moved), dtype=np.bool_),
        noise_px=SEEN_PX,
        force_N=found.contact.normal_force_N,
    )


def _touched(sensor: Sensor, found: Deformation, side: np.ndarray) -> Touched:
    """What the camera sees of a press, or of its mirror image where a side (x, y) is -1."""
    layout, (contact,) = sensor.layout, found.contacts
    assert layout is not None
    outline_mm = outlines(layout.rest_mm, layout.radius_mm)
    # Nothing changes between these keyframes; the scene lifts points off the face where markers are high.
    still = replace(found, contacts=())
    scene = SolidScene(name="press", time_s=np.arange(3.0), states=(still,) * 3, duration_s=2.0)
    moved_mm = scene.watch(outline_mm[:, :2] * side, layout.height_mm)(1.0) * [*side, 1.0]
    here, rest = (dot_ellipses(sensor.camera, place)[0] for place in (outline_mm + moved_mm, outline_mm))
    return Touched(displacement_px=here - rest, contact=replace(contact, centre_mm=contact.centre_mm * side))
