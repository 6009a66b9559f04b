"""The paper's marker detection, step by step: the reference that ours is compared with.

Section 3.3 of Senarath, Fernando and Rajakaruna, "Contact Position Estimation in the Event of
Simultaneous Multiple Contacts in Vision-based Tactile Sensors": undistort (equations 5 to 9), crop
and align, grey, threshold, opening with padding, contours, area filter, midpoints (Figure 7 a to d).
How each step is read is written in docs/paper.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from manytouch.errors import ManytouchError, SensorError
from manytouch.geometry.camera import cam_from_sheet, camera_matrix, onto_plane, project
from manytouch.values import Camera, Detections, Frame, Layout, Roi, Sensor, Status
from manytouch.values.arrays import Points2, Scalars, read_only

Grey = UInt8[np.ndarray, "h w"]
Map = Float32[np.ndarray, "h w"]
Window = tuple[int, int, int, int]

TRIAL_FRAMES = 10
TRIED_MARGINS = range(-100, 101, 5)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AlignedView:
    """The area of interest as a camera without distortion sees it that looks straight at the sheet.

    Attributes:
        camera: the real camera.
        window_px: x, y, width, height of the area in the aligned image.
        maps: x and y in the real image of each pixel of the area (-1 where it shows nothing); None where
            the aligned image is the real one, so that cropping is enough.
        is_dark: markers are darker than their ground.
        minimum_area_px2: smaller contours are no markers.
    """

    camera: Camera
    window_px: Window
    maps: tuple[Map, Map] | None
    is_dark: bool
    minimum_area_px2: float

    def image_px(self, window_px: Points2) -> Points2:
        """Points of the area (n, 2) where the real, distorting camera shows them."""
        aligned_px = window_px + np.array(self.window_px[:2], dtype=np.float64)
        if self.maps is None or len(aligned_px) == 0:
            return aligned_px
        camera = self.camera
        offset_mm = _eye_mm(camera)
        direction = (aligned_px - _principal_px(camera)) / _focal_px(camera)
        on_sheet_mm = np.zeros((len(aligned_px), 3))
        on_sheet_mm[:, :2] = direction * -offset_mm[2] + offset_mm[:2]
        return project(camera, on_sheet_mm)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperDetectionState:
    """What detection keeps between frames.

    Attributes:
        view: the area of interest.
        markers: how many the layout has without those that are missing.
        margin: the one that was found by trial; None while it is not known.
        trials: frames that may still be tried.
    """

    view: AlignedView
    markers: int
    margin: int | None
    trials: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperDetection:
    """Markers by threshold, opening and contours. Found "by trial and error" in the paper: the parameters.

    Attributes:
        threshold: grey level of 255 that parts markers from ground: pixels above it are light, those below
            it dark markers. None takes Otsu's of every frame (doi:10.1109/TSMC.1979.4310076) and a margin.
        margin: grey levels by which the level lies from Otsu's towards the markers; None tries in the
            first frames which margins show as many markers as there are and keeps the middle one.
        kernel_px: side of the square opening kernel, odd; 1 leaves the noise in.
        minimum_area_px2: contours below it are no markers; None takes a quarter of the layout's dots.
        roi_px: x, y, width, height of the area of interest in the camera's image; None is all of it.
            The layout's outline and `outline_pitch` around it limit it further.
        outline_pitch: how far the area of interest reaches beyond the outermost markers.
    """

    threshold: int | None = None
    margin: int | None = None
    kernel_px: int = 3
    minimum_area_px2: float | None = None
    roi_px: Roi | None = None
    outline_pitch: float = 0.5

    def start(self, sensor: Sensor) -> PaperDetectionState:
        """The maps of the undistorted, aligned, cropped view; they stay the same for all frames.

        Raises:
            SensorError: the sensor has no layout, or its layout does not show in the area of interest.
            ManytouchError: the kernel has no centre.
        """
        if self.kernel_px < 1 or self.kernel_px % 2 == 0:
            raise ManytouchError(
                f"kernel_px is {self.kernel_px}, but an opening kernel needs a centre: give an odd number"
            )
        if sensor.layout is None:
            raise SensorError(
                f"sensor {sensor.name!r} has no [markers]: the paper's detection needs the layout; "
                "run `manytouch calibrate rest` first"
            )
        camera, layout = sensor.camera, sensor.layout
        window_px, maps = self._view(sensor.name, camera, layout)
        radius_px = np.median(layout.radius_mm) * _focal_px(camera) / _eye_mm(camera)[2]
        area_px2 = 0.25 * np.pi * np.prod(radius_px)
        view = AlignedView(
            camera=camera,
            window_px=window_px,
            maps=maps,
            is_dark=layout.polarity == "dark",
            minimum_area_px2=float(area_px2) if self.minimum_area_px2 is None else self.minimum_area_px2,
        )
        markers = int(np.count_nonzero(~layout.is_missing))
        return PaperDetectionState(view=view, markers=markers, margin=self.margin, trials=TRIAL_FRAMES)

    def step(
        self, state: PaperDetectionState, frame: Frame, expected_px: Points2 | None
    ) -> tuple[PaperDetectionState, Detections]:
        """Midpoints of all marker-sized contours; `expected_px` is not used, the whole area is searched.

        Standard deviation of a midpoint: 1 / sqrt(12 pi r) px, what is left when the area of a disc of
        radius r is counted in whole pixels (docs/paper.md). Uneven light and blur are not in it.
        """
        image, view = frame.image, state.view
        if image is None:
            return state, _nothing(Status.DECODE_ERROR)
        if image.shape[:2] != (view.camera.height_px, view.camera.width_px):
            return state, _nothing(Status.WRONG_SIZE)
        grey = _grey(_aligned(view, image))
        if view.is_dark:
            grey = cv2.bitwise_not(grey)
        state, level = self._level(state, grey)
        midpoint_px, area_px2, binary = self._markers(view, grey, level)
        variance_px2 = 1.0 / (12.0 * np.sqrt(np.pi * area_px2))
        return state, Detections(
            centre_px=read_only(view.image_px(midpoint_px)),
            covariance_px2=read_only(variance_px2[:, None, None] * np.eye(2)),
            area_px2=read_only(area_px2),
            contrast=read_only(_contrast(grey, binary, midpoint_px)),
        )

    def _level(self, state: PaperDetectionState, grey: Grey) -> tuple[PaperDetectionState, int]:
        """Grey level above which pixels belong to markers, and what was learnt of the margin."""
        if self.threshold is not None:
            return state, 255 - self.threshold if state.view.is_dark else self.threshold
        otsu = int(cv2.threshold(grey, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[0])
        if state.margin is None and state.trials > 0:
            margin = self._tried(state, grey, otsu)
            state = replace(state, margin=margin, trials=state.trials - 1)
        return state, otsu + (state.margin or 0)

    def _tried(self, state: PaperDetectionState, grey: Grey, otsu: int) -> int | None:
        """0 if Otsu's level shows all markers, else the middle of the most margins in a row that do."""
        if len(self._markers(state.view, grey, otsu)[0]) == state.markers:
            return 0
        margins = [margin for margin in TRIED_MARGINS if 0 <= otsu + margin < 255]
        found = [len(self._markers(state.view, grey, otsu + margin)[0]) for margin in margins]
        runs = [
            list(run)
            for is_right, run in groupby(range(len(margins)), lambda place: found[place] == state.markers)
            if is_right
        ]
        if not runs:
            return None
        longest = max(runs, key=len)
        return margins[longest[len(longest) // 2]]

    def _markers(self, view: AlignedView, grey: Grey, level: int) -> tuple[Points2, Scalars, Grey]:
        """Midpoints and areas in the aligned area, and the opened binary picture."""
        binary = np.asarray(cv2.threshold(grey, level, 255, cv2.THRESH_BINARY)[1])
        clean = opened(binary, self.kernel_px)
        contours, _ = cv2.findContours(clean, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        midpoint_px, area_px2 = contour_midpoints(contours)
        is_marker = area_px2 >= view.minimum_area_px2
        return midpoint_px[is_marker], area_px2[is_marker], clean

    def _view(self, name: str, camera: Camera, layout: Layout) -> tuple[Window, tuple[Map, Map] | None]:
        """Area of interest in the aligned image, and its maps into the real one."""
        eye_mm = _eye_mm(camera)
        rest_mm = (
            layout.rest_mm[:, :2] if layout.rest_px is None else onto_plane(camera, layout.rest_px)[:, :2]
        )
        aligned_px = (rest_mm - eye_mm[:2]) / -eye_mm[2] * _focal_px(camera) + _principal_px(camera)
        margin_px = self.outline_pitch * layout.pitch_mm / -eye_mm[2] * _focal_px(camera)
        low = np.floor(np.nanmin(aligned_px, axis=0) - margin_px).astype(int)
        high = np.ceil(np.nanmax(aligned_px, axis=0) + margin_px).astype(int) + 1
        rotation, _ = cam_from_sheet(camera)
        left, top, width, height = self.roi_px or (0, 0, camera.width_px, camera.height_px)
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
        map_x, map_y = function(
            camera_matrix(camera), camera.distortion, rotation.T, matrix, size, cv2.CV_32FC1
        )
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


def opened(binary: Grey, kernel_px: int) -> Grey:
    """Opening that removes specks; padded before, so that markers at the edge are not eroded from outside."""
    if kernel_px == 1:
        return binary
    pad = kernel_px // 2
    padded = cv2.copyMakeBorder(binary, pad, pad, pad, pad, cv2.BORDER_REPLICATE)
    kernel = np.ones((kernel_px, kernel_px), np.uint8)
    clean = cv2.morphologyEx(
        padded, cv2.MORPH_OPEN, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=(0, 0, 0, 0)
    )
    return np.ascontiguousarray(clean[pad:-pad, pad:-pad])


def contour_midpoints(contours: Sequence[np.ndarray]) -> tuple[Points2, Scalars]:
    """Midpoint (n, 2) and area (n,) of closed contours that pass through the centres of border pixels.

    The midpoint is the centroid of what the contour encloses (Green's theorem), the mean of its points
    where it encloses nothing. The area counts pixels: Pick's theorem adds the border's outer half.
    """
    if len(contours) == 0:
        return np.zeros((0, 2)), np.zeros(0)
    length = np.array([len(contour) for contour in contours])
    first = np.cumsum(length) - length
    point = np.concatenate(contours).reshape(-1, 2).astype(np.float64)
    origin = point[first]
    point -= np.repeat(origin, length, axis=0)
    following = np.roll(point, -1, axis=0)
    following[first + length - 1] = 0.0
    cross = point[:, 0] * following[:, 1] - following[:, 0] * point[:, 1]
    twice_area = np.add.reduceat(cross, first)
    moment = np.add.reduceat((point + following) * cross[:, None], first, axis=0)
    mean = np.add.reduceat(point, first, axis=0) / length[:, None]
    is_flat = twice_area == 0.0
    centroid = np.where(is_flat[:, None], mean, moment / np.where(is_flat, 1.0, 3.0 * twice_area)[:, None])
    return origin + centroid, 0.5 * np.abs(twice_area) + 0.5 * length + 1.0


def _aligned(state: AlignedView, image: np.ndarray) -> np.ndarray:
    left, top, width, height = state.window_px
    if state.maps is None:
        return image[top : top + height, left : left + width]
    ground = (np.iinfo(image.dtype).max if state.is_dark else 0,) * 4
    return cv2.remap(image, *state.maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=ground)


def _grey(image: np.ndarray) -> Grey:
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.asarray(cv2.convertScaleAbs(grey, alpha=255.0 / 65535.0) if grey.dtype == np.uint16 else grey)


def _contrast(grey: Grey, binary: Grey, midpoint_px: Points2) -> Scalars:
    """Grey level at each midpoint above the mean of everything that is no marker."""
    ground = cv2.mean(grey, mask=cv2.bitwise_not(binary))[0]
    column, row = np.rint(midpoint_px).astype(int).T
    return np.asarray(grey[row, column].astype(np.float64) - ground)


def _eye_mm(camera: Camera) -> np.ndarray:
    """(3,) the camera's optical centre in the sheet frame."""
    rotation, translation = cam_from_sheet(camera)
    return np.asarray(-rotation.T @ translation)


def _focal_px(camera: Camera) -> np.ndarray:
    return np.array([camera.fx_px, camera.fy_px])


def _principal_px(camera: Camera) -> np.ndarray:
    return np.array([camera.cx_px, camera.cy_px])


def _window(low: np.ndarray, high: np.ndarray) -> Window:
    width, height = high - low
    return int(low[0]), int(low[1]), int(width), int(height)


def _outside(name: str) -> SensorError:
    return SensorError(
        f"the layout of sensor {name!r} lies outside the area of interest: check the camera's pose and roi_px"
    )


def _nothing(status: Status) -> Detections:
    return Detections(
        centre_px=read_only(np.zeros((0, 2))),
        covariance_px2=read_only(np.zeros((0, 2, 2))),
        area_px2=read_only(np.zeros(0)),
        contrast=read_only(np.zeros(0)),
        status=status,
    )
