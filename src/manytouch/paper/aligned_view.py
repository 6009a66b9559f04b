"""The area of interest, undistorted and aligned with the sheet (section 3.3, equations 5 to 9)."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32

from manytouch.errors import SensorError
from manytouch.geometry.camera import cam_from_sheet, camera_matrix, onto_plane, project
from manytouch.values import Camera, Layout, Roi
from manytouch.values.arrays import Points2

Map = Float32[np.ndarray, "h w"]
Window = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AlignedView:
    """The area of interest in the image of a camera without distortion and perpendicular to the sheet.

    Attributes:
        camera: the real camera.
        window_px: x, y, width, height of the area in the aligned image.
        maps: x and y in the real image of each pixel of the area, -1 outside of that image; None where the
            aligned image is the real one, so that cropping is sufficient.
        is_dark: markers are darker than the background.
        minimum_area_px2: smaller contours are not markers.
    """

    camera: Camera
    window_px: Window
    maps: tuple[Map, Map] | None
    is_dark: bool
    minimum_area_px2: float

    def image_px(self, area_px: Points2) -> Points2:
        """Positions of points of the area in the real, distorted image.

        Args:
            area_px: (n, 2) positions in the area, whose first pixel is (0, 0).

        Returns:
            (n, 2).
        """
        aligned_px = area_px + np.array(self.window_px[:2], dtype=np.float64)
        if self.maps is None or len(aligned_px) == 0:
            return aligned_px
        camera = self.camera
        centre_mm = optical_centre_mm(camera)
        direction = (aligned_px - _principal_px(camera)) / focal_px(camera)
        on_sheet_mm = np.zeros((len(aligned_px), 3))
        on_sheet_mm[:, :2] = direction * -centre_mm[2] + centre_mm[:2]
        return project(camera, on_sheet_mm)

    def apply(self, image: np.ndarray) -> np.ndarray:
        """The area of interest of an image; pixels outside of it get the background's grey level."""
        left, top, width, height = self.window_px
        if self.maps is None:
            return image[top : top + height, left : left + width]
        level = (np.iinfo(image.dtype).max if self.is_dark else 0,) * 4
        return cv2.remap(
            image, *self.maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=level
        )


def area_of_interest(
    name: str, camera: Camera, layout: Layout, *, roi_px: Roi | None, outline_pitch: float
) -> tuple[Window, tuple[Map, Map] | None]:
    """Window of the area in the aligned image, and its maps into the real one; see `AlignedView`.

    Args:
        name: of the sensor, for messages.
        camera, layout: of the sensor.
        roi_px: x, y, width, height of the area in the real image; None: all of it.
        outline_pitch: extent of the area beyond the outer markers, in pitches.

    Raises:
        SensorError: the layout is not in the area.
    """
    centre_mm = optical_centre_mm(camera)
    rest_mm = layout.rest_mm[:, :2] if layout.rest_px is None else onto_plane(camera, layout.rest_px)[:, :2]
    aligned_px = (rest_mm - centre_mm[:2]) / -centre_mm[2] * focal_px(camera) + _principal_px(camera)
    margin_px = outline_pitch * layout.pitch_mm / -centre_mm[2] * focal_px(camera)
    low = np.floor(np.nanmin(aligned_px, axis=0) - margin_px).astype(int)
    high = np.ceil(np.nanmax(aligned_px, axis=0) + margin_px).astype(int) + 1
    rotation, _ = cam_from_sheet(camera)
    left, top, width, height = roi_px or Roi(0, 0, camera.width_px, camera.height_px)
    roi_low = np.maximum([left, top], 0)
    roi_high = np.minimum([left + width, top + height], [camera.width_px, camera.height_px])
    if not camera.distortion.any() and np.allclose(rotation, np.eye(3), atol=1e-9):
        low, high = np.maximum(low, roi_low), np.minimum(high, roi_high)
        if np.any(high <= low):
            raise _outside(name)
        return _window(low, high), None
    matrix = camera_matrix(camera)
    matrix[:2, 2] -= low
    function = (
        cv2.fisheye.initUndistortRectifyMap if camera.model == "fisheye" else cv2.initUndistortRectifyMap
    )
    size = tuple(int(length) for length in high - low)
    map_x, map_y = function(camera_matrix(camera), camera.distortion, rotation.T, matrix, size, cv2.CV_32FC1)
    shows = (
        (map_x >= roi_low[0])
        & (map_x <= roi_high[0] - 1)
        & (map_y >= roi_low[1])
        & (map_y <= roi_high[1] - 1)
    )
    if not shows.any():
        raise _outside(name)
    map_x[~shows] = map_y[~shows] = -1.0
    rows, columns = np.flatnonzero(shows.any(axis=1)), np.flatnonzero(shows.any(axis=0))
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    low = low + np.array([columns[0], rows[0]])
    maps = np.ascontiguousarray(map_x[part]), np.ascontiguousarray(map_y[part])
    return _window(low, low + np.array(maps[0].shape[::-1])), maps


def optical_centre_mm(camera: Camera) -> np.ndarray:
    """(3,) optical centre of a camera in the sheet frame."""
    rotation, translation = cam_from_sheet(camera)
    return np.asarray(-rotation.T @ translation)


def focal_px(camera: Camera) -> np.ndarray:
    """(2,) focal lengths along x and y."""
    return np.array([camera.fx_px, camera.fy_px])


def _principal_px(camera: Camera) -> np.ndarray:
    return np.array([camera.cx_px, camera.cy_px])


def _window(low: np.ndarray, high: np.ndarray) -> Window:
    width, height = high - low
    return int(low[0]), int(low[1]), int(width), int(height)


def _outside(name: str) -> SensorError:
    return SensorError(
        f"the layout of sensor {name!r} is outside the area of interest: check the pose of the camera and "
        "roi_px"
    )
