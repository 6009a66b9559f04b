"""Indenters that users move on the simulated sheet, and the solved scene that is shown without them."""

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from manytouch.simulation.fem.contact.indenters import Indenter, Sphere
from manytouch.simulation.scene.deformation import Deformation, TrueContact
from manytouch.simulation.scene.motion import Body, poses
from manytouch.simulation.scene.moving_sheet import PointMotion
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.shell.energy import PosedIndenter
from manytouch.simulation.shell.live_sheet import LiveSheet
from manytouch.values import Press, Release, Sheet
from manytouch.values.arrays import Points2, Points3

FINGER_BALL = Sphere(radius_mm=6.0)
MOST_FINGERS = 20
STEEPEST = 0.4  # largest ratio of the depth of a finger to its distance from the clamp
EASE_S = 0.05  # time in which a finger comes 63 % nearer to its target
MAX_DEPTH_STEP_MM = 2.5
"""Largest change of the depth in one frame, so that the solution can follow."""
MAX_SIDEWAYS_STEP_MM = 6.0
"""Largest change of x and y together in one frame."""
LIFTED_MM = -3.0  # target depth of a lifted finger: above the face
ALONE_S = 3.0  # the scene goes on when nobody has pressed for so long
MAX_EVALUATIONS = 18  # of the live sheet's energy in a frame
MAX_EVALUATIONS_AT_START = 60  # the same in the frame in which the sheet begins to be solved live
FRAMES_KEPT = 300  # of the latest frames
FIRST_ID = 100_000  # of people's fingers, above all touches of a scene


@dataclass(slots=True, eq=False)
class _Finger:
    """A body that a user presses, or that is being lifted: where it is, and where it should be."""

    id: int
    indenter: Indenter
    position_mm: np.ndarray
    target_mm: np.ndarray
    rotation_vector: np.ndarray

    def ease(self, share: float) -> None:
        step_mm = share * (self.target_mm - self.position_mm)
        step_mm[:2] *= min(1.0, MAX_SIDEWAYS_STEP_MM / max(float(np.linalg.norm(step_mm[:2])), 1e-9))
        step_mm[2] = min(max(step_mm[2], -MAX_DEPTH_STEP_MM), MAX_DEPTH_STEP_MM)
        self.position_mm = self.position_mm + step_mm

    @property
    def pressed(self) -> PosedIndenter:
        return PosedIndenter(
            indenter=self.indenter, position_mm=self.position_mm, rotation_vector=self.rotation_vector
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _SheetFrame:
    """The sheet in one frame, and what touches it, by id."""

    face: Deformation
    contacts: Mapping[int, TrueContact]


class InteractiveIndenters:
    """A solved scene in a loop, which is interrupted by indenters that users move; a `MovingSheet`.

    `step` makes the next frame; only the latest frames are available.
    The first finger takes over: the scene's bodies are lifted, and the sheet is solved live until nobody has
    pressed for some seconds. Then the scene begins again.
    """

    def __init__(
        self, scene: SolidScene, bodies: tuple[Body, ...], sheet: Sheet, fps: float, pitch_mm: float
    ) -> None:
        """Nobody presses yet.

        Args:
            scene: that is shown; it begins untouched.
            bodies: that press in it.
            sheet: the same.
            fps: frames per second.
            pitch_mm: of the markers, which defines the regions of contacts.
        """
        self.scene, self.bodies, self.sheet, self.fps, self.pitch_mm = scene, bodies, sheet, fps, pitch_mm
        self._lock = threading.Lock()
        self._held: dict[int, _Finger] = {}
        self._lifted: list[_Finger] = []
        self._next_id = FIRST_ID
        self._live = LiveSheet(sheet)
        self._is_live = False
        self._alone_s = 0.0
        self._scene_frame = 0
        self._period_s = float(scene.time_s[-1])
        self._frames: dict[int, _SheetFrame] = {}

    @property
    def name(self) -> str:
        return self.scene.name

    @property
    def duration_s(self) -> float:
        return self.scene.duration_s

    @property
    def seed(self) -> int:
        return self.scene.seed

    def with_duration(self, duration_s: float) -> "InteractiveIndenters":
        """The same without any indenter, on a scene of another duration."""
        scene = self.scene.with_duration(duration_s)
        return InteractiveIndenters(scene, self.bodies, self.sheet, self.fps, self.pitch_mm)

    def motion_of(self, place_mm: Points2, height_mm: float = 0.0) -> PointMotion:
        """See `MovingSheet`; of the latest frames."""
        place_mm = np.ascontiguousarray(place_mm)

        def displacement_mm(time_s: float) -> Points3:
            with self._lock:
                face = self._frames[round(time_s * self.fps)].face
            return face.moved_mm(place_mm, height_mm)

        return displacement_mm

    def contact_face_motion_of(self, place_mm: Points2) -> PointMotion:
        """See `MovingSheet`; the sheet is clamped."""
        return self.motion_of(place_mm)

    def contacts(self, time_s: float) -> dict[int, TrueContact]:
        """What touches in one of the latest frames; nothing in others."""
        with self._lock:
            frame = self._frames.get(round(time_s * self.fps))
        return {} if frame is None else dict(frame.contacts)

    def is_available(self, index: int) -> bool:
        """Whether this frame is one of the latest."""
        with self._lock:
            return index in self._frames

    def apply(self, command: Press | Release) -> None:
        """Put a finger on the sheet, move it, or lift it; from the next frame on."""
        with self._lock:
            match command:
                case Release(finger=finger):
                    if finger in self._held:
                        self._lift(self._held.pop(finger))
                case Press(finger=finger, x_mm=x_mm, y_mm=y_mm, depth_mm=depth_mm):
                    target_mm = self._on_sheet(x_mm, y_mm, depth_mm)
                    if finger in self._held:
                        self._held[finger].target_mm = target_mm
                    elif len(self._held) < MOST_FINGERS:
                        start_mm = np.array([*target_mm[:2], self.sheet.thickness_mm])
                        self._held[finger] = _Finger(
                            self._next_id, FINGER_BALL, start_mm, target_mm, np.zeros(3)
                        )
                        self._next_id += 1

    def step(self, index: int) -> None:
        """Make the next frame."""
        with self._lock:
            if self._held and not self._is_live:
                self._take_over()
            self._alone_s = 0.0 if self._held else self._alone_s + 1.0 / self.fps
            if self._is_live and self._alone_s > ALONE_S:
                self._is_live = False
                period = self._period_s * self.fps
                self._scene_frame = math.ceil((self._scene_frame // period + 1) * period)
            frame = self._live_frame_now() if self._is_live else self._scene_frame_now()
            self._frames[index] = frame
            self._frames.pop(index - FRAMES_KEPT, None)

    def _scene_frame_now(self) -> _SheetFrame:
        """The scene's next frame."""
        time_s = self._scene_frame / self.fps
        self._scene_frame += 1
        return _SheetFrame(face=self.scene.face(time_s), contacts=self.scene.contacts(time_s))

    def _live_frame_now(self) -> _SheetFrame:
        """The live sheet's next frame."""
        share = 1.0 - float(np.exp(-1.0 / (self.fps * EASE_S)))
        fingers = [*self._held.values(), *self._lifted]
        for finger in fingers:
            finger.ease(share)
        self._live.settle([finger.pressed for finger in fingers], max_evaluations=MAX_EVALUATIONS)
        face = self._live.deformation(self.pitch_mm)
        pairs = zip(fingers, face.contacts, strict=True)
        contacts = {finger.id: contact for finger, contact in pairs if contact.is_touching}
        above_mm = self.sheet.thickness_mm
        self._lifted = [
            finger for finger in self._lifted if finger.id in contacts or finger.position_mm[2] < above_mm
        ]
        return _SheetFrame(face=face, contacts=contacts)

    def _take_over(self) -> None:
        """Go on live from where the scene is, its bodies being lifted."""
        self._is_live = True
        before_s = max(self._scene_frame - 1, 0) / self.fps
        local_s = before_s % self._period_s
        touching = self.scene.contacts(before_s)
        for body, position_mm, rotation_vector in poses(
            self.bodies, local_s, thickness_mm=self.sheet.thickness_mm
        ):
            if position_mm[2] >= self.sheet.thickness_mm:
                continue
            near = {
                id_: float(np.linalg.norm(contact.centre_mm - position_mm[:2]))
                for id_, contact in touching.items()
            }
            id_ = min(near, key=lambda one: near[one], default=self._next_id)
            touching.pop(id_, None)
            self._next_id += 1
            self._lift(_Finger(id_, body.indenter, position_mm, position_mm, rotation_vector))
        self._live.start_from(self.scene.face(before_s))
        self._live.settle(
            [finger.pressed for finger in self._lifted], max_evaluations=MAX_EVALUATIONS_AT_START
        )

    def _lift(self, finger: _Finger) -> None:
        finger.target_mm = np.array([*finger.position_mm[:2], self.sheet.thickness_mm - LIFTED_MM])
        self._lifted.append(finger)

    def _on_sheet(self, x_mm: float, y_mm: float, depth_mm: float) -> np.ndarray:
        """Where a finger shall be: moved inwards until all of it is on the sheet, and not too deep there."""
        reach_mm = np.maximum(self.sheet.size_mm / 2 - 1.2 * FINGER_BALL.radius_mm, 0.0)
        at_mm = np.clip(np.array([x_mm, y_mm]), -reach_mm, reach_mm)
        from_rim_mm = float((self.sheet.size_mm / 2 - np.abs(at_mm)).min())
        deep_mm = min(max(depth_mm, 0.0), STEEPEST * from_rim_mm)
        return np.array([*at_mm, self.sheet.thickness_mm - deep_mm])
