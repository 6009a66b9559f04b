"""The simulated sensor: a scene, seen by its camera, and what really happened."""

from dataclasses import dataclass, field

import numpy as np

from manytouch.geometry.camera import project
from manytouch.simulation.imaging import displacements, dot_ellipses, outlines
from manytouch.simulation.plate import PatchLoad, Plate, PlateModes, clamped_plate
from manytouch.simulation.render import Look, render_discs
from manytouch.simulation.scene import Scene
from manytouch.values import (
    Contact,
    Contacts,
    Frame,
    Layout,
    Phase,
    Sensor,
    Sheet,
    Surface,
    TrackedGrid,
    Truth,
)
from manytouch.values.arrays import Covariances2, Points2, Points3, read_only

DEMO_LOOK = Look(tilt_x=0.12, tilt_y=-0.08, vignetting=0.25, read_noise=1.2, shot_noise=0.02)
WITHIN_PATCH = np.array(
    [[0.0, 0.0]]
    + [
        [share * np.cos(angle), share * np.sin(angle)]
        for share in (0.2, 0.4, 0.6, 0.8, 1.0)
        for angle in 2 * np.pi * np.arange(12) / 12
    ]
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Simulator:
    """A sensor under the presses of a scene; any frame can be asked for.

    Attributes:
        sensor: true camera, layout and sheet; the sheet's material must be known.
        scene: what touches it.
        fps: frames per second.
        look: levels, light and noise of the pictures.
        blur_px: of the lens and pixel.
    """

    sensor: Sensor
    scene: Scene
    fps: float = 30.0
    look: Look = DEMO_LOOK
    blur_px: float = 0.8
    _plate: Plate = field(init=False, repr=False)
    _marker_modes: PlateModes = field(init=False, repr=False)
    _outline_mm: Points3 = field(init=False, repr=False)
    _outline_modes: PlateModes = field(init=False, repr=False)

    def __post_init__(self) -> None:
        layout, plate = self._layout, clamped_plate(self._sheet)
        outline_mm = outlines(layout.rest_mm, layout.radius_mm)
        object.__setattr__(self, "_plate", plate)
        object.__setattr__(self, "_marker_modes", plate.modes_at(layout.rest_mm[:, :2]))
        object.__setattr__(self, "_outline_mm", outline_mm)
        object.__setattr__(self, "_outline_modes", plate.modes_at(outline_mm[:, :2]))

    @property
    def frame_count(self) -> int:
        """Frames of the scene."""
        return round(self.scene.duration_s * self.fps)

    def frame(self, index: int) -> Frame:
        """The picture of a frame; its noise depends on the scene's seed and the index alone."""
        camera, layout = self.sensor.camera, self._layout
        loads = self.scene.loads(self._time_s(index))
        centre_px, shape_px = self._dots(self._plate.coefficients(tuple(loads.values())))
        image = render_discs(
            centre_px,
            shape_px,
            width_px=camera.width_px,
            height_px=camera.height_px,
            blur_px=self.blur_px,
            look=self.look,
            contrast=np.where(layout.is_missing, 0.0, 1.0),
            seed=(self.scene.seed << 32) + index,
        )
        return Frame(
            index=index,
            timestamp_ns=round(index * 1e9 / self.fps),
            camera=f"sim-{self.scene.name}",
            image=image,
        )

    def truth(self, index: int) -> Truth:
        """What really happens in a frame; deviations are 0, because it is the truth."""
        loads = self.scene.loads(self._time_s(index))
        coefficients = self._plate.coefficients(tuple(loads.values()))
        displacement_mm = displacements(self._marker_modes.field(coefficients), self._lever_mm)
        count = len(displacement_mm)
        surface = Surface(
            position_mm=read_only(self._layout.rest_mm + displacement_mm),
            displacement_mm=read_only(displacement_mm),
            covariance_mm2=read_only(np.zeros((count, 3, 3))),
        )
        return Truth(
            frame_index=index,
            grid=self._grid(self._dots(coefficients)[0], index),
            surface=surface,
            contacts=self._contacts(index, loads),
        )

    @property
    def _layout(self) -> Layout:
        if self.sensor.layout is None:
            raise ValueError("a simulated sensor needs a layout of markers")
        return self.sensor.layout

    @property
    def _sheet(self) -> Sheet:
        if self.sensor.sheet is None:
            raise ValueError("a simulated sensor needs a sheet")
        return self.sensor.sheet

    @property
    def _lever_mm(self) -> float:
        return self._sheet.thickness_mm / 2 + self._layout.height_mm

    def _time_s(self, index: int) -> float:
        return index / self.fps

    def _dots(self, coefficients: np.ndarray) -> tuple[Points2, Covariances2]:
        moved_mm = displacements(self._outline_modes.field(coefficients), self._lever_mm)
        return dot_ellipses(self.sensor.camera, self._outline_mm + moved_mm)

    def _grid(self, centre_px: Points2, index: int) -> TrackedGrid:
        camera = self.sensor.camera
        last_px = np.array([camera.width_px, camera.height_px]) - 0.5
        is_seen = np.all((centre_px > -0.5) & (centre_px < last_px), axis=1) & ~self._layout.is_missing
        return TrackedGrid(
            position_px=read_only(np.where(is_seen[:, None], centre_px, np.nan)),
            covariance_px2=read_only(np.where(is_seen[:, None, None], np.zeros((2, 2)), np.nan)),
            is_seen=read_only(is_seen),
            frames_unseen=read_only(np.where(is_seen, 0, index + 1).astype(np.int64)),
        )

    def _contacts(self, index: int, loads: dict[int, PatchLoad]) -> Contacts:
        before = self.scene.loads(self._time_s(index - 1)) if index > 0 else {}
        now = self._described(loads, {id_: Phase.MOVE if id_ in before else Phase.START for id_ in loads})
        ended = {id_: Phase.END for id_ in before if id_ not in loads}
        if ended:
            now += self._described(before, ended)
        return Contacts(contacts=tuple(sorted(now, key=lambda contact: contact.id)))

    def _described(self, loads: dict[int, PatchLoad], phases: dict[int, Phase]) -> list[Contact]:
        """The contacts of some of the loads while all of them press."""
        coefficients = self._plate.coefficients(tuple(loads.values()))
        return [self._contact(id_, phase, loads[id_], coefficients) for id_, phase in phases.items()]

    def _contact(self, id_: int, phase: Phase, load: PatchLoad, coefficients: np.ndarray) -> Contact:
        centre_mm = np.array(load.centre_mm)
        sheet_field = self._plate.modes_at(centre_mm + load.radius_mm * WITHIN_PATCH).field(coefficients)
        face_mm = displacements(sheet_field, self._lever_mm)[:1] + np.array([*load.centre_mm, 0.0])
        return Contact(
            id=id_,
            phase=phase,
            centre_mm=read_only(centre_mm),
            centre_px=read_only(project(self.sensor.camera, face_mm)[0]),
            depth_mm=float(sheet_field.depth_mm.max()),
            force_N=read_only(np.array([0.0, 0.0, -load.force_N])),
            torque_Nmm=0.0,
            area_mm2=float(np.pi * load.radius_mm**2),
            covariance=read_only(np.zeros((8, 8))),
        )
