"""The designed sensor as `accuracy` tests it: a sheet of solid finite elements, calibrated and pressed.

The shell of the method `mechanics` differs from a solid by more than the noise, and calibration removes a
part of the difference that no formula predicts. Therefore a solid sheet is calibrated from presses of a round
tip at the places of probing.gcode (`calibration.sheet.press_plan`), and pressed by a ball of the size of a
fingertip. Marker displacements are computed; no picture is rendered. `test_accuracy.py` tests this too.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from manytouch.calibration.sheet.calibrate import calibrate_sheet
from manytouch.calibration.sheet.fit import KnownPress
from manytouch.calibration.sheet.press_plan import CONTACT_RADIUS_MM, DEPTHS_MM, TIP_RADIUS_MM, places_mm
from manytouch.design.deflection import FINGERTIP_MM2, clamped_shell, fingertip
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.simulation.fem.cache import StateCache
from manytouch.simulation.fem.contact.indenters import Indenter, Sphere
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.loading import press as press_loading
from manytouch.simulation.fem.sheet import SheetModel
from manytouch.simulation.render.dot_ellipses import dot_ellipses, outlines
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation, TrueContact
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.solve_scene import states_folder
from manytouch.values import Sensor
from manytouch.values.arrays import Points2

TIP = Sphere(radius_mm=TIP_RADIUS_MM)
FINGERTIP = Sphere(radius_mm=8.0)
ELEMENT_OVER_THICKNESS = 1.0  # largest side of an element; the two below limit it further
ELEMENT_MM = 2.5  # larger elements are too stiff under a fingertip
LEAST_ELEMENTS = 16  # along the shorter side of the sheet
STEP_MM = 3.0  # largest depth from one solved state of a press to the next
SQUEEZE_MM = 0.15
"""Additional depth of a ball, which indents the face of a solid, relative to the shell."""
CENTRE_NOISE_PX = 0.01
"""Noise of a centre for a grey level noise of 2.5 (docs/derivations/detection.md)."""

OnMessage = Callable[[str], object] | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ObservedPress:
    """A press and its image.

    Attributes:
        displacement_px: (m, 2) of the markers' images.
        contact: ground truth of force, centre and depth.
    """

    displacement_px: Points2
    contact: TrueContact


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Prototype:
    """A designed sensor whose sheet is a solid.

    Solved presses are cached by their content, so that another pitch or stand-off needs no new ones.

    Attributes:
        sensor: as designed.
        model: of its sheet.
        states: cache of solved presses.
    """

    sensor: Sensor
    model: SheetModel
    states: StateCache

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
            element_mm=min(
                ELEMENT_OVER_THICKNESS * sheet.thickness_mm, ELEMENT_MM, min(size) / LEAST_ELEMENTS
            ),
        )
        return Prototype(sensor=sensor, model=model, states=StateCache(folder=states_folder()))

    def press(self, body: Indenter, place_mm: np.ndarray, depth_mm: float) -> ObservedPress | None:
        """A press by an indenter to a depth of its lowest point; None where no equilibrium is found."""
        found = self.solve(body, place_mm, depth_mm)
        return None if found is None else observe_press(self.sensor, found, np.ones(2))

    def fingertip_depths_mm(self, places_mm: Points2, force_N: float) -> list[float]:
        """Depths at which a ball of a fingertip's size presses with about `force_N`, by the shell."""
        model = self.model
        shell = clamped_shell(
            size_mm=model.size_mm, thickness_mm=model.thickness_mm, poisson=model.material.poisson
        )
        points, weight = fingertip(float(np.sqrt(FINGERTIP_MM2 / np.pi)))
        depths = []
        for place_mm in places_mm:
            over_E_mm2 = force_N / model.material.young_MPa
            load = shell.patch.load(place_mm + points, np.outer(weight, [0.0, 0.0, -over_E_mm2]))
            face = Face(shell=shell, point_mm=place_mm + points)
            deepest_mm = -face.displacement(equilibrium(shell, load).coefficient_mm)[:, 2].min()
            # about: the accuracy is stated with the force that the solid then has
            depths.append(round(1.05 * float(deepest_mm) + SQUEEZE_MM, 2))
        return depths

    def calibrate(self, random: np.random.Generator, on_message: OnMessage = None) -> Sensor:
        """The sensor with the sheet that `calibrate sheet` fits to the presses of probing.gcode.

        Presses that are mirror images of each other are solved once.
        """
        presses = []
        for place in places_mm(self.sensor):
            for depth_mm in DEPTHS_MM:
                if on_message is not None and np.all(place >= 0.0):
                    on_message(f"pressing a round tip {depth_mm:g} mm deep at {place[0]:g}, {place[1]:g} mm")
                found = self.solve(TIP, np.abs(place), depth_mm)
                if found is not None:
                    mirror = np.where(place < 0.0, -1.0, 1.0)
                    known = _known_press(observe_press(self.sensor, found, mirror), place, random)
                    presses.append(known)
        sheet = calibrate_sheet(self.sensor, presses).sheet
        # The force error is measured, so that no prior is added to it.
        return replace(self.sensor, sheet=replace(sheet, young_std_MPa=0.0))

    def solve(self, body: Indenter, place_mm: np.ndarray, depth_mm: float) -> Deformation | None:
        """The sheet pressed by a body at a place (2,) of the sheet; None where no equilibrium is found."""
        steps = int(np.ceil(depth_mm / STEP_MM))
        path = np.array([[*place_mm, depth_mm * (step + 1) / steps] for step in range(steps)])
        thickness_mm = self.model.thickness_mm
        loading = Loading(touches=(press_loading(body, thickness_mm=thickness_mm, path_mm=path),))
        state = list(self.states.states(self.model, loading))[-1]
        if state.status != "ok":
            return None
        last = press_loading(body, thickness_mm=thickness_mm, path_mm=path[-1:])
        return condense(state, Loading(touches=(last,)))


def _known_press(found: ObservedPress, place_mm: np.ndarray, random: np.random.Generator) -> KnownPress:
    displacement_px = found.displacement_px
    return KnownPress(
        name=f"{place_mm[0]:g}, {place_mm[1]:g} mm",
        place_mm=place_mm,
        radius_mm=CONTACT_RADIUS_MM,
        displacement_px=displacement_px + random.normal(0.0, CENTRE_NOISE_PX, displacement_px.shape),
        is_seen=np.ones(len(displacement_px), dtype=np.bool_),
        noise_px=CENTRE_NOISE_PX,
        force_N=found.contact.normal_force_N,
    )


def observe_press(sensor: Sensor, found: Deformation, mirror: np.ndarray) -> ObservedPress:
    """The image of a press, or of its mirror image where a component (x, y) of `mirror` is -1."""
    layout, (contact,) = sensor.layout, found.contacts
    assert layout is not None
    outline_mm = outlines(layout.rest_mm, layout.radius_mm)
    # Equal keyframes, as a scene interpolates in time; it also moves markers that stand above the face.
    keyframe = replace(found, contacts=())
    scene = SolidScene(name="press", time_s=np.arange(3.0), states=(keyframe,) * 3, duration_s=2.0)
    moved_mm = scene.motion_of(outline_mm[:, :2] * mirror, layout.height_mm)(1.0) * [*mirror, 1.0]
    here, rest = (dot_ellipses(sensor.camera, place)[0] for place in (outline_mm + moved_mm, outline_mm))
    return ObservedPress(
        displacement_px=here - rest, contact=replace(contact, centre_mm=contact.centre_mm * mirror)
    )
