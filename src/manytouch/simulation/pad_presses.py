"""Presses on a bonded pad with their ground truth, without pictures.

A ball of 3 mm, 0.5 mm deep, then 0.1 mm sideways while it sticks::

    touch = press(Sphere(radius_mm=3.0), thickness_mm=4.0, friction=1.0,
                  path_mm=np.array([[2.0, 1.0, 0.5], [2.1, 1.0, 0.5]]))
    for state in solve_pad(sensor, Loading(touches=(touch,))):
        print(state.marker_mm, state.marker_px, state.truth.contacts, state.face_depth_mm(place_mm))
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from manytouch.errors import SensorError
from manytouch.simulation.fem.cache import StateCache
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.sheet import PadModel
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation, TrueContact
from manytouch.simulation.scene.pad import markers_mm, pad_solid
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.simulation.solve_scene import states_folder
from manytouch.values import Sensor, Truth
from manytouch.values.arrays import Points2, Points3, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PressedPad:
    """A pressed pad in equilibrium.

    Attributes:
        truth: markers in the image, the contact face over them, and the contacts, as `Simulator.truth`.
        contacts: one for each touch and patch of the loading, in its order, also those that do not touch.
        markers: how the pad moved in the plane of its markers.
        face: how its touched face moved.
        status: of the solver, "ok" or "not_converged".
    """

    truth: Truth
    contacts: tuple[TrueContact, ...]
    markers: Deformation
    face: Deformation
    status: str

    @property
    def marker_mm(self) -> Points3:
        """(m, 3) displacements of the markers."""
        layout = self.truth.surface.layout
        assert layout is not None
        return self.markers.displacement_mm(np.ascontiguousarray(layout.rest_mm[:, :2]))

    @property
    def marker_px(self) -> Points2:
        """(m, 2) centroids of the images of the markers' discs; NaN outside the image."""
        return self.truth.grid.position_px

    def face_depth_mm(self, place_mm: Points2) -> Scalars:
        """(n,) depths of undeformed places (n, 2) of the touched face; NaN outside the pad."""
        depth_mm: Scalars = -self.face.displacement_mm(place_mm)[:, 2]
        return depth_mm


def solve_pad(
    sensor: Sensor, loading: Loading, *, model: PadModel | None = None, folder: Path | None = None
) -> Iterator[PressedPad]:
    """The equilibria of a bonded pad at each step of a loading, each reached from the one before.

    With friction a step should be at most a quarter of a millimetre long.

    Args:
        sensor: its sheet is bonded and has `young_MPa` and `poisson`; it has markers.
        loading: bodies and patches, whose positions have z = 0 on the bonded face.
        model: the solid; None: meshed for the loading.
        folder: of solved states; None: the user's.

    Raises:
        SensorError: the sensor has no such sheet or no markers.
        OutputError: the folder cannot be written.
    """
    sheet = sensor.sheet
    if sheet is None or sheet.boundary != "bonded" or sheet.young_MPa is None or sheet.poisson is None:
        raise SensorError(
            f"the sheet of the sensor {sensor.name!r} cannot be pressed as a pad: "
            '[sheet] needs boundary = "bonded", young_MPa and poisson'
        )
    if sensor.layout is None:
        raise SensorError(f"the sensor {sensor.name!r} needs [markers]")
    solid = pad_solid(sheet, loading) if model is None else model
    for state in StateCache(folder=folder or states_folder()).states(solid, loading):
        found = condense(state, loading, pad_markers_mm=markers_mm(sheet))
        scene = SolidScene(name="press", time_s=np.array([0.0, 1.0]), states=(found, found), duration_s=1.0)
        yield PressedPad(
            truth=Simulator(sensor=sensor, scene=scene).truth(0),
            contacts=found.contacts,
            markers=found,
            face=replace(found.touched, contacts=()),
            status=state.status,
        )
