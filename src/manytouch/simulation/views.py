"""The simulated sensor with several cameras: their pictures in a row, and the ground truth of all."""

from dataclasses import dataclass, field, replace

import numpy as np

from manytouch.geometry.camera import view_of
from manytouch.geometry.views.merging import side_by_side
from manytouch.simulation.render.discs import Look
from manytouch.simulation.render.optics import IN_FOCUS, Faults, ImagingSettings, draw_faults
from manytouch.simulation.scene.moving_sheet import MovingSheet
from manytouch.simulation.simulator import DEMO_LOOK, Simulator
from manytouch.values import Frame, Sensor, TrackedGrid, Truth, View
from manytouch.values.arrays import read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ViewsSimulator:
    """A sensor with several views under a scene; attributes and methods as those of `Simulator`."""

    sensor: Sensor
    scene: MovingSheet
    fps: float = 30.0
    look: Look = DEMO_LOOK
    optics: ImagingSettings = IN_FOCUS
    faults: Faults | None = None
    _views: tuple[Simulator, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        sensor = self.sensor
        assert sensor.layout is not None
        assert sensor.sheet is not None
        views = tuple(
            Simulator(
                sensor=replace(sensor, camera=view.camera),
                scene=self.scene,
                fps=self.fps,
                look=self.look,
                optics=self.optics,
                faults=self.faults or draw_faults(sensor.layout, sensor.sheet),
                camera_number=number,
            )
            for number, view in enumerate(sensor.camera.views)
        )
        object.__setattr__(self, "_views", views)

    @property
    def frame_count(self) -> int:
        """Frames of the scene."""
        return self._views[0].frame_count

    def frame(self, index: int) -> Frame:
        """The pictures of a frame in a row."""
        return side_by_side([view.frame(index) for view in self._views])

    def truth(self, index: int) -> Truth:
        """The ground truth of a frame; a marker has the image of the view that shows it most centrally."""
        camera = self.sensor.camera
        truths = [view.truth(index) for view in self._views]
        first = truths[0]
        assert self.sensor.layout is not None
        number = view_of(camera, self.sensor.layout.rest_mm)
        shown = [_in_frame(truth.grid, view) for truth, view in zip(truths, camera.views, strict=True)]
        is_seen = np.choose(number, [grid.is_seen for grid in shown])
        contacts = []
        for each in zip(*(truth.contacts.contacts for truth in truths), strict=True):
            rest_mm = np.append(each[0].centre_mm, 0.0)
            at = int(view_of(camera, rest_mm[None])[0]) if np.isfinite(rest_mm).all() else 0
            shown_px = camera.views[at].to_frame(each[at].centre_px)
            contacts.append(replace(each[at], centre_px=read_only(shown_px)))
        grid = replace(
            first.grid,
            position_px=read_only(np.choose(number[:, None], [grid.position_px for grid in shown])),
            covariance_px2=read_only(np.where(is_seen[:, None, None], np.zeros((2, 2)), np.nan)),
            is_seen=read_only(is_seen),
            frames_unseen=read_only(np.where(is_seen, 0, index + 1).astype(np.int64)),
        )
        return replace(first, grid=grid, contacts=replace(first.contacts, contacts=tuple(contacts)))


def _in_frame(grid: TrackedGrid, view: View) -> TrackedGrid:
    return replace(grid, position_px=view.to_frame(grid.position_px))
