"""The sensor of each view of a camera with several.

Each view is tracked by itself, in its own picture and with the markers that it shows at rest; nothing has to
match across pictures, because each marker has one place on the sheet. A marker that several views show has
the image of the view that shows it most centrally (`camera.view_of`), in every frame.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int64

from manytouch.errors import LayoutError
from manytouch.geometry.camera import cam_from_sheet, project, view_of
from manytouch.values import Camera, Frame, Layout, Sensor, View
from manytouch.values.arrays import Counts, Mask, read_only

_MARGIN_RADII = 1.4  # from the edge of a picture; a little less than the tracker takes for its exterior nodes


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ViewSensor:
    """A view as a sensor of its own.

    Attributes:
        view: of the camera.
        sensor: with the markers that the view shows at rest, in pixels of its own picture.
        marker: (k,) their numbers in the layout of the sheet.
        is_own: (k,) whether the image of the marker is that of this view.
    """

    view: View
    sensor: Sensor
    marker: Counts
    is_own: Mask

    def picture(self, frame: Frame) -> Frame:
        """The part of a frame that this view took."""
        x, y, width, height = self.view.roi_px
        image = None if frame.image is None else frame.image[y : y + height, x : x + width]
        return replace(frame, image=image, encoded=None)


def view_sensors(sensor: Sensor) -> tuple[ViewSensor, ...]:
    """The views of a sensor with several.

    Raises:
        LayoutError: a view shows fewer than four markers.
    """
    layout = sensor.layout
    assert layout is not None
    number = view_of(sensor.camera, layout.rest_mm)
    found = []
    for index, view in enumerate(sensor.camera.views):
        marker = _shown(layout, view.camera)
        if len(marker) < 4:
            raise LayoutError(
                f"the view {view.name!r} of the sensor {sensor.name!r} shows fewer than four markers: "
                "correct its pose in the sensor file (x_cam = R x_sheet + t)"
            )
        row_column = layout.row_column
        if row_column is not None:
            row_column = read_only(row_column[marker] - row_column[marker].min(axis=0))
        part = replace(
            layout,
            rest_mm=read_only(layout.rest_mm[marker]),
            row_column=row_column,
            radius_mm=read_only(layout.radius_mm[marker]),
            is_missing=read_only(layout.is_missing[marker]),
            rest_px=None,
            rest_radius_px=None,
        )
        own = replace(sensor, camera=view.camera, layout=part)
        is_own = read_only(number[marker] == index)
        found.append(ViewSensor(view=view, sensor=own, marker=read_only(marker), is_own=is_own))
    return tuple(found)


def _shown(layout: Layout, camera: Camera) -> Int64[np.ndarray, " k"]:
    """Markers that a camera shows wholly at rest. The others of a lattice are exterior nodes of its view."""
    in_cam = layout.rest_mm @ cam_from_sheet(camera)[0].T + camera.translation_mm
    place_px = project(camera, layout.rest_mm)
    focal_px = np.sqrt(camera.fx_px * camera.fy_px)
    margin_px = _MARGIN_RADII * focal_px * layout.radius_mm / np.maximum(in_cam[:, 2], 1e-6)
    last_px = np.array([camera.width_px, camera.height_px]) - 1.0
    is_inside = (place_px >= margin_px[:, None]) & (place_px <= last_px - margin_px[:, None])
    return np.flatnonzero(is_inside.all(axis=1) & (in_cam[:, 2] > 0.0))
