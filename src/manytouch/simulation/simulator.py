"""The simulated sensor: images of a scene by its camera, and the ground truth."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial

import numpy as np
from jaxtyping import Float32, Float64

from manytouch.geometry.refraction import project_through_window
from manytouch.simulation.render.discs import Look, Spot, disc_coverage, image_from_coverage
from manytouch.simulation.render.dot_ellipses import CORNERS, outlines, polygon_ellipses
from manytouch.simulation.render.optics import IN_FOCUS, Faults, ImagingSettings, draw_faults, shadows
from manytouch.simulation.scene.deformation import TrueContact
from manytouch.simulation.scene.moving_sheet import MovingSheet, PointMotion
from manytouch.values import (
    Camera,
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
SMEAR_PX = 0.5
"""A moving dot is drawn this often along its way during the exposure."""
MOST_SMEARS = 16
FRAMES_KEPT = 16
"""Frames whose dots are kept: the truth of a frame is needed some frames after its picture."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _DrawnDots:
    """Dots and dust at a time.

    Attributes:
        corner_mm: (n, 3) first corner of the outline of each, sheet frame.
        centre_px, shape_px: (n, 2) and (n, 2, 2) as `render_discs` takes.
    """

    corner_mm: Points3
    centre_px: Points2
    shape_px: Covariances2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Simulator:
    """A sensor under a scene; frames can be made in any order.

    The centre of a marker, in the truth as for a perfect camera, is the centroid of the image of its
    whole printed disc, bent with the sheet and projected; not the image of the disc's middle, from
    which it differs by some hundredths of a pixel, and not moved by blur, light or a missing half.
    Of a bonded pad the dots show on their own plane; surface and contacts are those of the contact face.

    Attributes:
        sensor: true camera, layout and sheet.
        scene: the sheet in time, and what touches it.
        fps: frames per second.
        look: levels, light and noise of the pictures.
        optics: how the camera takes them.
        faults: of the print and the light; none where not given.
        camera_number: of the view that it is of a sensor with several; each has noise of its own.
    """

    sensor: Sensor
    scene: MovingSheet
    fps: float = 30.0
    look: Look = DEMO_LOOK
    optics: ImagingSettings = IN_FOCUS
    faults: Faults | None = None
    camera_number: int = 0
    _faults: Faults = field(init=False, repr=False)
    _of_surface: PointMotion = field(init=False, repr=False)
    _outline_mm: Points3 = field(init=False, repr=False)
    _outline: PointMotion = field(init=False, repr=False)
    _drawn_dots: Callable[[float], _DrawnDots] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        layout, sheet = self._layout, self._sheet
        faults = self.faults or draw_faults(layout, sheet)
        dust_mm = np.column_stack([faults.dust_mm, np.zeros(len(faults.dust_mm))])
        outline_mm = np.concatenate(
            [outlines(layout.rest_mm, layout.radius_mm), outlines(dust_mm, faults.dust_radius_mm)]
        )
        rest_mm = np.ascontiguousarray(layout.rest_mm[:, :2])
        corner_mm = np.ascontiguousarray(outline_mm[:, :2])
        object.__setattr__(self, "_faults", faults)
        object.__setattr__(self, "_of_surface", self._motion_of(rest_mm))
        object.__setattr__(self, "_outline_mm", outline_mm)
        object.__setattr__(self, "_outline", self.scene.motion_of(corner_mm, layout.height_mm))
        # without a reference to this value, which would keep it and its scene until garbage is searched for
        draw = partial(_draw_dots, self.sensor.camera, sheet, self._outline_mm, self._outline)
        object.__setattr__(self, "_drawn_dots", lru_cache(FRAMES_KEPT)(draw))

    @property
    def frame_count(self) -> int:
        """Frames of the scene."""
        return round(self.scene.duration_s * self.fps)

    def frame(self, index: int) -> Frame:
        """The picture of a frame; its noise depends on the scene's seed and the index alone."""
        time_s = self._time_s(index)
        look = self.optics.lit(self.look, time_s)
        if self._faults.shadow:
            look = replace(look, shadows=look.shadows + self._shadows(time_s))
        seed = (self.scene.seed << 32) + (self.camera_number << 28) + index
        image, encoded = self.optics.compressed(
            image_from_coverage(self._coverage(time_s), look=look, seed=seed)
        )
        return Frame(
            index=index,
            timestamp_ns=self._timestamp_ns(index),
            camera=f"sim-{self.scene.name}",
            image=image,
            encoded=encoded,
        )

    def truth(self, index: int) -> Truth:
        """The ground truth of a frame; its standard deviations are 0."""
        time_s, layout = self._time_s(index), self._layout
        displacement_mm = self._of_surface(time_s)
        count = len(displacement_mm)
        surface = Surface(
            position_mm=read_only(layout.rest_mm + displacement_mm),
            displacement_mm=read_only(displacement_mm),
            covariance_mm2=read_only(np.zeros((count, 3, 3))),
            layout=layout,
        )
        return Truth(
            frame_index=index,
            grid=self._grid(self._drawn_dots(time_s).centre_px[:count], index),
            surface=surface,
            contacts=self._contacts(index),
        )

    def _motion_of(self, place_mm: Points2) -> PointMotion:
        """How undeformed places move on the face of depth and surface, which of a pad is its contact face."""
        if self._sheet.boundary == "bonded":
            return self.scene.contact_face_motion_of(place_mm)
        return self.scene.motion_of(place_mm, self._layout.height_mm)

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

    def _time_s(self, index: int) -> float:
        return index / self.fps

    def _timestamp_ns(self, index: int) -> int:
        return round(index * 1e9 / self.fps)

    def _outline_at(self, time_s: float) -> Points3:
        return self._outline_mm + self._outline(time_s)

    def _project(self, point_mm: Points3) -> Points2:
        """Pixels of points of the sheet frame, through the window of a pad."""
        return project_through_window(self.sensor.camera, self._sheet, point_mm)

    def _coverage(self, time_s: float) -> Float32[np.ndarray, "h w"]:
        """How much of each pixel's light comes from dots, over the exposure."""
        if self.optics.exposure_s == 0.0:
            return self._covered(time_s)
        half_s = 0.5 * self.optics.exposure_s
        ends = [self._project(self._outline_at(time_s + s)) for s in (-half_s, half_s)]
        count = int(np.clip(np.ceil(np.nanmax(np.abs(ends[1] - ends[0])) / SMEAR_PX), 1, MOST_SMEARS))
        shares = (2.0 * np.arange(count) + 1.0) / count - 1.0
        total = self._covered(time_s + half_s * shares[0])
        for share in shares[1:]:
            total += self._covered(time_s + half_s * share)
        return np.asarray(total / np.float32(count))

    def _covered(self, time_s: float) -> Float32[np.ndarray, "h w"]:
        camera, faults = self.sensor.camera, self._faults
        dust, dots = len(faults.dust_mm), self._drawn_dots(time_s)
        return disc_coverage(
            dots.centre_px,
            dots.shape_px,
            width_px=camera.width_px,
            height_px=camera.height_px,
            blur_px=self.optics.blurs_px(camera, dots.corner_mm),
            contrast=np.concatenate([faults.is_printed, np.ones(dust)]),
            cut=np.concatenate([faults.cut, np.tile([0.0, 0.0, np.inf], (dust, 1))]),
        )

    def _grid(self, centre_px: Points2, index: int) -> TrackedGrid:
        camera = self.sensor.camera
        last_px = np.array([camera.width_px, camera.height_px]) - 0.5
        is_seen = np.all((centre_px > -0.5) & (centre_px < last_px), axis=1) & self._faults.is_printed
        return TrackedGrid(
            position_px=read_only(np.where(is_seen[:, None], centre_px, np.nan)),
            covariance_px2=read_only(np.where(is_seen[:, None, None], np.zeros((2, 2)), np.nan)),
            is_seen=read_only(is_seen),
            frames_unseen=read_only(np.where(is_seen, 0, index + 1).astype(np.int64)),
            timestamp_ns=self._timestamp_ns(index),
        )

    def _contacts(self, index: int) -> Contacts:
        time_s, before_s = self._time_s(index), self._time_s(index - 1)
        now = self.scene.contacts(time_s)
        before = self.scene.contacts(before_s) if index > 0 else {}
        shown = [(id_, Phase.MOVE if id_ in before else Phase.START, now[id_], time_s) for id_ in now]
        shown += [(id_, Phase.END, before[id_], before_s) for id_ in before if id_ not in now]
        return Contacts(contacts=tuple(self._contact(*one) for one in sorted(shown, key=lambda one: one[0])))

    def _contact(self, id_: int, phase: Phase, contact: TrueContact, time_s: float) -> Contact:
        half_major_mm, half_minor_mm, angle_rad = contact.ellipse
        return Contact(
            id=id_,
            phase=phase,
            centre_mm=contact.centre_mm,
            centre_px=read_only(self._shown_px(contact.centre_mm[None], time_s)[0]),
            depth_mm=contact.depth_mm,
            force_N=contact.force_N,
            torque_Nmm=contact.torque_Nmm,
            area_mm2=contact.region_mm2 if np.isfinite(contact.region_mm2) else contact.area_mm2,
            half_major_mm=half_major_mm,
            half_minor_mm=half_minor_mm,
            orientation_rad=angle_rad,
            covariance=read_only(np.zeros((8, 8))),
        )

    def _shown_px(self, place_mm: Float64[np.ndarray, "n 2"], time_s: float) -> Points2:
        """Where undeformed places show at a time; those of a pad lie on its contact face."""
        moved_mm = self._motion_of(place_mm)(time_s)
        face_mm = np.full(len(place_mm), self._sheet.marker_depth_mm or 0.0)
        return self._project(np.column_stack([place_mm, face_mm]) + moved_mm)

    def _shadows(self, time_s: float) -> tuple[Spot, ...]:
        contacts = list(self.scene.contacts(time_s).values())
        centre_mm = np.array([contact.centre_mm for contact in contacts]).reshape(-1, 2)
        camera = self.sensor.camera
        radius_mm = np.sqrt(np.array([contact.area_mm2 for contact in contacts]) / np.pi)
        radius_px = 1.0 + radius_mm * camera.fx_px / camera.translation_mm[2]
        return shadows(self._faults.shadow, self._shown_px(centre_mm, time_s), radius_px)


def _draw_dots(
    camera: Camera, sheet: Sheet, outline_mm: Points3, motion: PointMotion, time_s: float
) -> _DrawnDots:
    """All dots and dust: as `render.dot_ellipses`, through the window of a pad."""
    moved_mm = outline_mm + motion(time_s)
    corner_px = project_through_window(camera, sheet, moved_mm).reshape(-1, CORNERS, 2)
    centre_px, shape_px = polygon_ellipses(corner_px)
    return _DrawnDots(corner_mm=moved_mm[::CORNERS], centre_px=centre_px, shape_px=shape_px)
