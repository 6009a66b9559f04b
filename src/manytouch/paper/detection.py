"""The marker detection of the paper, step by step.

Section 3.3 of Senarath, Fernando and Rajakaruna, "Contact Position Estimation in the Event of
Simultaneous Multiple Contacts in Vision-based Tactile Sensors": undistort (equations 5 to 9), crop
and align, grey, threshold, opening with padding, contours, area filter, midpoints (Figure 7 a to d).
The interpretation of each step is in docs/paper.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Literal

import cv2
import numpy as np
from jaxtyping import UInt8

from manytouch.errors import ManytouchError, SensorError
from manytouch.paper.aligned_view import AlignedView, area_of_interest, focal_px, optical_centre_mm
from manytouch.values import Detections, Frame, Roi, Sensor, Status
from manytouch.values.arrays import Mask, Points2, Scalars, read_only
from manytouch.values.images.grey_levels import least_scale, to_8_bits

Grey = UInt8[np.ndarray, "h w"]

OpeningPadding = Literal["repeat", "none"]

TRIAL_FRAMES = 10
TRIED_MARGINS = range(-100, 101, 5)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperDetectionState:
    """What the detection keeps between frames.

    Attributes:
        view: the area of interest.
        markers: number of markers that are not missing.
        margin: found by trial; None while it is not known.
        trials: number of frames left for trials.
        scale: of grey levels (`to_8_bits`), by the images so far; None before the first one.
    """

    view: AlignedView
    markers: int
    margin: int | None
    trials: int
    scale: float | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DetectionStages:
    """What the detection computes of an image on its way, all of the area of interest (Figure 7 b to d).

    Attributes:
        grey: undistorted, aligned and cropped; light markers on dark also where the markers are dark.
        level: grey level above which pixels belong to markers.
        binary, opened: 255 where the threshold, and then the opening, sees a marker, else 0.
        contours: outer contours of the opened image, each (points, 1, 2).
        midpoint_px, area_px2: (n, 2), (n,) of the contours.
        is_marker: (n,) whether the area is within its limits.
    """

    grey: Grey
    level: int
    binary: Grey
    opened: Grey
    contours: Sequence[np.ndarray]
    midpoint_px: Points2
    area_px2: Scalars
    is_marker: Mask


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperDetection:
    """Detects markers by threshold, opening and contours, with parameters found "by trial and error".

    Attributes:
        threshold: grey level (0 to 255) between markers and background: light markers are above it, dark ones
            below. None: Otsu's level of every frame (doi:10.1109/TSMC.1979.4310076) and a margin.
        margin: grey levels from Otsu's level towards the markers; None: the middle of the margins at which
            the first frames show the right number of markers.
        kernel_px: side of the square opening kernel, odd; 1 does not remove noise.
        opening_padding: what continues the image beyond its border during the opening. "repeat": its
            outermost pixels; "none": nothing, so that dots at the border are eroded, as the paper warns.
        minimum_area_px2: smaller contours are not markers; None: a quarter of the dot area of the layout.
        maximum_area_px2: larger contours are not markers; None: no limit.
        roi_px: x, y, width, height of the area of interest in the camera's image; None: all of it.
            The layout's outline and `outline_pitch` around it limit it further.
        outline_pitch: extent of the area of interest beyond the outer markers, in pitches.
    """

    threshold: int | None = None
    margin: int | None = None
    kernel_px: int = 3
    opening_padding: OpeningPadding = "repeat"
    minimum_area_px2: float | None = None
    maximum_area_px2: float | None = None
    roi_px: Roi | None = None
    outline_pitch: float = 0.5

    def start(self, sensor: Sensor) -> PaperDetectionState:
        """The maps of the undistorted, aligned, cropped view, which are the same for all frames.

        Raises:
            SensorError: the sensor has no layout, or the layout is not in the area of interest.
            ManytouchError: the side of the opening kernel is not odd, or the threshold is no grey level.
        """
        if self.kernel_px < 1 or self.kernel_px % 2 == 0:
            raise ManytouchError(
                f"kernel_px is {self.kernel_px}, but the side of the opening kernel must be odd: give an "
                "odd number"
            )
        if self.threshold is not None and not 0 <= self.threshold <= 255:
            raise ManytouchError(
                f"the threshold is {self.threshold}, but it must be a grey level from 0 to 255"
            )
        if sensor.layout is None:
            raise SensorError(
                f"sensor {sensor.name!r} has no [markers]: the detection of the paper needs the layout: "
                "run `manytouch calibrate rest` first"
            )
        camera, layout = sensor.camera, sensor.layout
        window_px, maps = area_of_interest(
            sensor.name, camera, layout, roi_px=self.roi_px, outline_pitch=self.outline_pitch
        )
        radius_px = np.median(layout.radius_mm) * focal_px(camera) / optical_centre_mm(camera)[2]
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
        """Midpoints of all marker-sized contours; `expected_px` is not used.

        Standard deviation of a midpoint: 1 / sqrt(12 pi r) px, the error of counting the area of a disc of
        radius r in whole pixels (docs/paper.md). It does not include uneven light and blur.
        """
        image, view = frame.image, state.view
        if image is None:
            return state, _no_detections(Status.DECODE_ERROR)
        if image.shape[:2] != (view.camera.height_px, view.camera.width_px):
            return state, _no_detections(Status.WRONG_SIZE)
        state, found = self.stages(state, image)
        midpoint_px, area_px2 = found.midpoint_px[found.is_marker], found.area_px2[found.is_marker]
        variance_px2 = 1.0 / (12.0 * np.sqrt(np.pi * area_px2))
        return state, Detections(
            centre_px=read_only(view.image_px(midpoint_px)),
            covariance_px2=read_only(variance_px2[:, None, None] * np.eye(2)),
            area_px2=read_only(area_px2),
            contrast=read_only(_contrast(found.grey, found.opened, midpoint_px)),
        )

    def stages(
        self, state: PaperDetectionState, image: np.ndarray
    ) -> tuple[PaperDetectionState, DetectionStages]:
        """The intermediate results for an image of the camera's size, and the state with the margin."""
        scale = least_scale(state.scale, image)
        state = replace(state, scale=scale)
        grey = _grey(state.view.apply(image), scale)
        if state.view.is_dark:
            grey = cv2.bitwise_not(grey)
        state, level = self._level(state, grey)
        return state, self._search(state.view, grey, level)

    def _level(self, state: PaperDetectionState, grey: Grey) -> tuple[PaperDetectionState, int]:
        """Grey level above which pixels belong to markers, and the state with the margin."""
        if self.threshold is not None:
            return state, 255 - self.threshold if state.view.is_dark else self.threshold
        otsu = int(cv2.threshold(grey, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[0])
        if state.margin is None and state.trials > 0:
            margin = self._find_margin(state, grey, otsu)
            state = replace(state, margin=margin, trials=state.trials - 1)
        return state, otsu + (state.margin or 0)

    def _find_margin(self, state: PaperDetectionState, grey: Grey, otsu: int) -> int | None:
        """0 if Otsu's level shows all markers, else the middle of the longest run of margins that do."""
        if self._count(state.view, grey, otsu) == state.markers:
            return 0
        margins = [margin for margin in TRIED_MARGINS if 0 <= otsu + margin < 255]
        found = [self._count(state.view, grey, otsu + margin) for margin in margins]
        runs = [
            list(run)
            for is_right, run in groupby(range(len(margins)), lambda index: found[index] == state.markers)
            if is_right
        ]
        if not runs:
            return None
        longest = max(runs, key=len)
        return margins[longest[len(longest) // 2]]

    def _count(self, view: AlignedView, grey: Grey, level: int) -> int:
        return int(np.count_nonzero(self._search(view, grey, level).is_marker))

    def _search(self, view: AlignedView, grey: Grey, level: int) -> DetectionStages:
        """Threshold, opening, contours and areas."""
        binary = np.asarray(cv2.threshold(grey, level, 255, cv2.THRESH_BINARY)[1])
        clean = open_binary(binary, self.kernel_px, self.opening_padding)
        contours, _ = cv2.findContours(clean, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        midpoint_px, area_px2 = contour_midpoints(contours)
        is_marker = area_px2 >= view.minimum_area_px2
        if self.maximum_area_px2 is not None:
            is_marker &= area_px2 <= self.maximum_area_px2
        return DetectionStages(
            grey=grey,
            level=level,
            binary=binary,
            opened=clean,
            contours=contours,
            midpoint_px=midpoint_px,
            area_px2=area_px2,
            is_marker=is_marker,
        )


def open_binary(binary: Grey, kernel_px: int, padding: OpeningPadding = "repeat") -> Grey:
    """Opening that removes specks; with padding, markers at the edge of the image are not eroded."""
    if kernel_px == 1:
        return binary
    pad = kernel_px // 2 if padding == "repeat" else 0
    padded = cv2.copyMakeBorder(binary, pad, pad, pad, pad, cv2.BORDER_REPLICATE)
    kernel = np.ones((kernel_px, kernel_px), np.uint8)
    clean = cv2.morphologyEx(
        padded, cv2.MORPH_OPEN, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=(0, 0, 0, 0)
    )
    height, width = binary.shape
    return np.ascontiguousarray(clean[pad : pad + height, pad : pad + width])


def contour_midpoints(contours: Sequence[np.ndarray]) -> tuple[Points2, Scalars]:
    """Midpoint (n, 2) and area (n,) of closed contours that pass through the centres of border pixels.

    The midpoint is the centroid of the enclosed area (Green's theorem), or the mean of the points if the
    contour encloses nothing. The area counts pixels: Pick's theorem adds the border's outer half.
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
    weighted_sum = np.add.reduceat((point + following) * cross[:, None], first, axis=0)
    mean = np.add.reduceat(point, first, axis=0) / length[:, None]
    is_flat = twice_area == 0.0
    centroid = np.where(
        is_flat[:, None], mean, weighted_sum / np.where(is_flat, 1.0, 3.0 * twice_area)[:, None]
    )
    return origin + centroid, 0.5 * np.abs(twice_area) + 0.5 * length + 1.0


def _grey(image: np.ndarray, scale: float) -> Grey:
    return to_8_bits(image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), scale)


def _contrast(grey: Grey, binary: Grey, midpoint_px: Points2) -> Scalars:
    """Grey level at each midpoint above the mean of the background."""
    background = cv2.mean(grey, mask=cv2.bitwise_not(binary))[0]
    column, row = np.rint(midpoint_px).astype(int).T
    return np.asarray(grey[row, column].astype(np.float64) - background)


def _no_detections(status: Status) -> Detections:
    return Detections(
        centre_px=read_only(np.zeros((0, 2))),
        covariance_px2=read_only(np.zeros((0, 2, 2))),
        area_px2=read_only(np.zeros(0)),
        contrast=read_only(np.zeros(0)),
        status=status,
    )
