"""Dots in every frame: everywhere, or in windows around where they are expected."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.detection.appearance.dot_appearance import Appearance, appearance_of, radius_in_image
from manytouch.detection.candidates import DogBuffers, candidates, workshop
from manytouch.detection.condition import First, condition, first_of
from manytouch.detection.measurement.centroid import measured_rows
from manytouch.detection.measurement.sampling_pattern import Plans, plans_of
from manytouch.detection.noise import noise_of
from manytouch.detection.selection import select, typical_contrast, without_doubles
from manytouch.values import Detections, Frame, Roi, Sensor, Status
from manytouch.values.arrays import Points2, Scalars

SCALE_STEP = 1.5  # between the radii that are searched for when sizes differ
WALK = 3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DotSearchState:
    """What the search keeps between frames.

    Attributes:
        appearance: of the dots.
        markers: number of markers that can be seen.
        radius_px: (m,) radius of each marker in the image at rest.
        plans: which pixels are looked at for these radii.
        scales_px: (s,) radii that are searched for everywhere.
        scale_plans: which pixels are looked at for those.
        level: grey levels of 255 per level of the image; None before the first picture.
        first: the first good picture, for comparison; None before.
        workshops: memory for the search everywhere, one for each scale; empty before.
    """

    appearance: Appearance
    markers: int
    radius_px: Scalars
    plans: Plans
    scales_px: Float64[np.ndarray, " s"]
    scale_plans: Plans
    level: float | None = None
    first: First | None = None
    workshops: tuple[DogBuffers, ...] = ()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DotSearch:
    """Finds the dots of a sensor.

    Attributes:
        roi_px: x, y, width, height of the part of the image to look at; None for all of it.
        least_share: weakest dots against typical ones, contrast.
        least_snr: weakest dots against the noise of a pixel.
    """

    roi_px: Roi | None = None
    least_share: float = 0.09
    least_snr: float = 1.5

    def start(self, sensor: Sensor) -> DotSearchState:
        """State before the first frame.

        Raises:
            SensorError: the sensor has no markers.
        """
        appearance = appearance_of(sensor)
        assert sensor.layout is not None
        layout = sensor.layout
        radius_px = radius_in_image(sensor.camera, layout.rest_mm, layout.radius_mm)
        radius_px = np.clip(radius_px, appearance.radius_min_px, appearance.radius_max_px)
        scales_px = scales(appearance)
        return DotSearchState(
            appearance=appearance,
            markers=int((~layout.is_missing).sum()),
            radius_px=radius_px,
            plans=plans_of(radius_px),
            scales_px=scales_px,
            scale_plans=plans_of(scales_px),
        )

    def step(
        self, state: DotSearchState, frame: Frame, expected_px: Points2 | None
    ) -> tuple[DotSearchState, Detections]:
        """Dots of a frame; `expected_px` (m, 2) limits the search to windows, None looks everywhere."""
        if frame.image is None:
            return state, empty(Status.DECODE_ERROR)
        level = state.level if state.level is not None else level_of(frame.image)
        if state.level is None:
            state = replace(state, level=level)
        if state.first is not None and state.first.shape != frame.image.shape:
            return state, empty(Status.DECODE_ERROR)
        image, corner = cropped(frame.image, self.roi_px)
        if min(image.shape[:2]) < 8:
            return state, empty(Status.DECODE_ERROR)
        weights = state.appearance.weights(1 if image.ndim == 2 else image.shape[2]) * level
        noise = noise_of(image, weights)
        if expected_px is None:
            state = _with_workshops(state, image)
            rows, radius_px = self._everywhere(state, image, weights, noise)
        else:
            rows, radius_px = _windows(state, image, weights, noise, expected_px - corner)
        found, edge_px = self._selected(rows, radius_px, state.markers, noise, corner)
        status = condition(state.first, frame.image, found, edge_px, level=level, markers=state.markers)
        if state.first is None and status is Status.OK and len(edge_px) >= min(6, state.markers):
            state = replace(state, first=first_of(frame.image, found, edge_px))
        return state, found if status is Status.OK else replace(found, status=status)

    def _selected(
        self,
        rows: Float64[np.ndarray, "n 9"],
        radius_px: Scalars,
        markers: int,
        noise: float,
        corner: Float64[np.ndarray, "2"],
    ) -> tuple[Detections, Float64[np.ndarray, " k"]]:
        """The dots in whole-image coordinates, and the widths of their edges."""
        most = len(rows)
        centre, covariance = np.empty((most, 2)), np.empty((most, 2, 2))
        area, contrast, edge = np.empty(most), np.empty(most), np.empty(most)
        number = select(
            rows,
            radius_px,
            markers,
            self.least_share,
            self.least_snr * 3.0 * noise,
            corner[0],
            corner[1],
            centre,
            covariance,
            area,
            contrast,
            edge,
        )
        found = Detections(
            centre_px=centre[:number],
            covariance_px2=covariance[:number],
            area_px2=area[:number],
            contrast=contrast[:number],
        )
        return found, edge[:number]

    def _everywhere(
        self, state: DotSearchState, image: np.ndarray, weights: Float64[np.ndarray, " c"], noise: float
    ) -> tuple[Float64[np.ndarray, "n 9"], Scalars]:
        """All that looks like a dot of the right size: rows of `kernels.measure_dots`, and radii."""
        found, scale = [], []
        for number, radius_px in enumerate(state.scales_px):
            near = candidates(image, weights, radius_px, max(noise, 2.0), state.workshops[number])
            typical = typical_contrast(near.contrast, state.markers)
            strong = near.contrast > 0.6 * self.least_share * typical
            found.append(near if strong.all() else near.at(strong))
            scale.append(np.full(len(found[-1].contrast), number))
        index = scale[0] if len(scale) == 1 else np.concatenate(scale)
        place_px = found[0].place_px if len(found) == 1 else np.concatenate([near.place_px for near in found])
        if state.appearance.is_irregular:
            contrast = np.concatenate([near.contrast for near in found])
            single = without_doubles(place_px, state.scales_px[index], contrast, 1.0)
            place_px, index = place_px[single], index[single]
        plans, radius_px = state.scale_plans.at(index), state.scales_px[index]
        return measured_rows(image, weights, place_px, radius_px, plans, noise=noise), radius_px


def _windows(
    state: DotSearchState,
    image: np.ndarray,
    weights: Float64[np.ndarray, " c"],
    noise: float,
    expected_px: Float64[np.ndarray, "m 2"],
) -> tuple[Float64[np.ndarray, "n 9"], Scalars]:
    """The dots near expected places: rows of `kernels.measure_dots`, and radii."""
    radius_px, plans = state.radius_px, state.plans
    if len(expected_px) != len(radius_px):
        radius_px = np.full(len(expected_px), float(np.median(radius_px)))
        plans = plans_of(radius_px)
    return measured_rows(image, weights, expected_px, radius_px, plans, noise=noise, walk=WALK), radius_px


def _with_workshops(state: DotSearchState, image: np.ndarray) -> DotSearchState:
    """The state with memory for images like this one."""
    kept = state.workshops
    if kept and kept[0].shape == image.shape and kept[0].dtype == image.dtype:
        return state
    return replace(state, workshops=tuple(workshop(image, float(radius)) for radius in state.scales_px))


def scales(appearance: Appearance) -> Float64[np.ndarray, " s"]:
    """Radii to search for."""
    if not appearance.is_irregular:
        return np.array([np.sqrt(appearance.radius_min_px * appearance.radius_max_px)])
    ratio = appearance.radius_max_px / appearance.radius_min_px
    steps = int(np.ceil(np.log(ratio) / np.log(SCALE_STEP)))
    return np.geomspace(appearance.radius_min_px, appearance.radius_max_px, steps + 1)


def level_of(image: np.ndarray) -> float:
    """Grey levels of 255 per level of the image: cameras put 10, 12, 14 bits into 16 in either end."""
    if image.dtype == np.uint8:
        return 1.0
    largest = int(image.max())
    bits = next(bits for bits in (8, 10, 12, 14, 16) if largest < 2**bits)
    return 255.0 / float(2**bits - 1)


def cropped(image: np.ndarray, roi_px: Roi | None) -> tuple[np.ndarray, Float64[np.ndarray, "2"]]:
    """The part of the image to look at, and where its first pixel lies."""
    if roi_px is None:
        return image, np.zeros(2)
    x, y, width, height = roi_px
    x0, y0 = max(x, 0), max(y, 0)
    return image[y0 : max(y + height, 0), x0 : max(x + width, 0)], np.array([float(x0), float(y0)])


def empty(status: Status) -> Detections:
    """No dots, because of what is wrong with the picture."""
    return Detections(
        centre_px=np.zeros((0, 2)),
        covariance_px2=np.zeros((0, 2, 2)),
        area_px2=np.zeros(0),
        contrast=np.zeros(0),
        status=status,
    )
