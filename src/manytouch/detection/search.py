"""Dots in every frame: everywhere, or in windows around where they are expected."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.detection.appearance import Appearance, appearance_of, radius_in_image
from manytouch.detection.candidates import candidates, without_doubles
from manytouch.detection.centroid import Dots, measure
from manytouch.detection.condition import First, condition, first_of
from manytouch.detection.noise import noise_of
from manytouch.values import Detections, Frame, Sensor
from manytouch.values.arrays import Points2, Scalars

SCALE_STEP = 1.5  # between the radii that are searched for when sizes differ
WALK = 3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Searching:
    """What the search keeps between frames.

    Attributes:
        appearance: of the dots.
        markers: number of markers that can be seen.
        radius_px: (m,) radius of each marker in the image at rest.
        level: grey levels of 255 per level of the image; None before the first picture.
        first: the first good picture, for comparison; None before.
    """

    appearance: Appearance
    markers: int
    radius_px: Scalars
    level: float | None = None
    first: First | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DotSearch:
    """Finds the dots of a sensor.

    Attributes:
        roi_px: x, y, width, height of the part of the image to look at; None for all of it.
        least_share: weakest dots against typical ones, contrast.
        least_snr: weakest dots against the noise of a pixel.
    """

    roi_px: tuple[int, int, int, int] | None = None
    least_share: float = 0.09
    least_snr: float = 1.5

    def start(self, sensor: Sensor) -> Searching:
        """State before the first frame.

        Raises:
            SensorError: the sensor has no markers.
        """
        appearance = appearance_of(sensor)
        assert sensor.layout is not None
        layout = sensor.layout
        radius_px = radius_in_image(sensor.camera, layout.rest_mm, layout.radius_mm)
        radius_px = np.clip(radius_px, appearance.radius_min_px, appearance.radius_max_px)
        return Searching(appearance=appearance, markers=int((~layout.is_missing).sum()), radius_px=radius_px)

    def step(
        self, state: Searching, frame: Frame, expected_px: Points2 | None
    ) -> tuple[Searching, Detections]:
        """Dots of a frame; `expected_px` (m, 2) limits the search to windows, None looks everywhere."""
        if frame.image is None:
            return state, empty("decode_error")
        level = state.level if state.level is not None else level_of(frame.image)
        state = replace(state, level=level)
        if state.first is not None and state.first.shape != frame.image.shape:
            return state, empty("decode_error")
        image, corner = cropped(frame.image, self.roi_px)
        if min(image.shape[:2]) < 8:
            return state, empty("decode_error")
        weights = state.appearance.weights(1 if image.ndim == 2 else image.shape[2]) * level
        noise = noise_of(image, weights)
        if expected_px is None:
            dots, radius_px = self._everywhere(state, image, weights, noise)
        else:
            dots, radius_px = self._windows(state, image, weights, noise, expected_px - corner)
        keep = self._plausible(state, dots, radius_px, noise)
        detections = detections_of(dots, keep, corner)
        status = condition(state.first, frame.image, dots, keep, level=level, markers=state.markers)
        if state.first is None and status == "ok" and keep.sum() >= min(6, state.markers):
            state = replace(state, first=first_of(frame.image, dots, keep))
        return state, replace(detections, status=status)

    def _everywhere(
        self, state: Searching, image: np.ndarray, weights: Float64[np.ndarray, " c"], noise: float
    ) -> tuple[Dots, Scalars]:
        """All that looks like a dot of the right size."""
        appearance = state.appearance
        places, radii, contrasts = [], [], []
        for radius_px in scales(appearance):
            near = candidates(image, weights, radius_px, max(noise, 2.0))
            typical = typical_contrast(near.contrast, state.markers)
            strong = near.contrast > 0.6 * self.least_share * typical
            places.append(near.place_px[strong])
            radii.append(near.radius_px[strong])
            contrasts.append(near.contrast[strong])
        place_px, radius_px, contrast = (
            np.concatenate(places),
            np.concatenate(radii),
            np.concatenate(contrasts),
        )
        if appearance.is_irregular:
            single = without_doubles(place_px, radius_px, contrast, 1.0)
            place_px, radius_px = place_px[single], radius_px[single]
        return measure(image, weights, place_px, radius_px, noise=noise), radius_px

    def _windows(
        self,
        state: Searching,
        image: np.ndarray,
        weights: Float64[np.ndarray, " c"],
        noise: float,
        expected_px: Float64[np.ndarray, "m 2"],
    ) -> tuple[Dots, Scalars]:
        """The dots near expected places."""
        wanted = np.isfinite(expected_px).all(axis=1)
        near_px = expected_px[wanted]
        if len(expected_px) == len(state.radius_px):
            radius_px = state.radius_px[wanted]
        else:
            radius_px = np.full(len(near_px), float(np.median(state.radius_px)))
        return measure(image, weights, near_px, radius_px, noise=noise, walk=WALK), radius_px

    def _plausible(self, state: Searching, dots: Dots, radius_px: Scalars, noise: float) -> np.ndarray:
        """(n,) which of the measured dots are dots: contrast, size, and each only once."""
        with np.errstate(invalid="ignore"):
            typical = typical_contrast(dots.contrast[dots.is_found], state.markers)
            keep = dots.is_found & (dots.contrast > self.least_share * typical)
            keep &= dots.contrast * np.sqrt(dots.area_px2) > self.least_snr * 3.0 * noise
            full = np.pi * radius_px**2
            keep &= (dots.area_px2 > 0.06 * full) & (dots.area_px2 < 3.0 * full)
            keep &= (dots.cut < 0.6) & (np.trace(dots.covariance_px2, axis1=1, axis2=2) < 0.5 * radius_px**2)
        chosen = np.flatnonzero(keep)
        single = without_doubles(
            dots.centre_px[chosen], radius_px[chosen], dots.contrast[chosen] * dots.area_px2[chosen], 0.8
        )
        keep[chosen[~single]] = False
        return keep


def scales(appearance: Appearance) -> Scalars:
    """Radii to search for."""
    if not appearance.is_irregular:
        return np.array([np.sqrt(appearance.radius_min_px * appearance.radius_max_px)])
    ratio = appearance.radius_max_px / appearance.radius_min_px
    steps = int(np.ceil(np.log(ratio) / np.log(SCALE_STEP)))
    return np.geomspace(appearance.radius_min_px, appearance.radius_max_px, steps + 1)


def typical_contrast(contrast: Scalars, markers: int) -> float:
    """Median of the strongest ones, as many as there should be dots."""
    if len(contrast) == 0:
        return 0.0
    strongest: float = np.median(np.sort(contrast)[-max(markers, 1) :]).item()
    return strongest


def level_of(image: np.ndarray) -> float:
    """Grey levels of 255 per level of the image: cameras put 10, 12, 14 bits into 16 in either end."""
    if image.dtype == np.uint8:
        return 1.0
    largest = int(image.max())
    bits = next(bits for bits in (8, 10, 12, 14, 16) if largest < 2**bits)
    return 255.0 / float(2**bits - 1)


def cropped(
    image: np.ndarray, roi_px: tuple[int, int, int, int] | None
) -> tuple[np.ndarray, Float64[np.ndarray, "2"]]:
    """The part of the image to look at, and where its first pixel lies."""
    if roi_px is None:
        return image, np.zeros(2)
    x, y, width, height = roi_px
    x0, y0 = max(x, 0), max(y, 0)
    return image[y0 : max(y + height, 0), x0 : max(x + width, 0)], np.array([float(x0), float(y0)])


def detections_of(dots: Dots, keep: np.ndarray, corner: Float64[np.ndarray, "2"]) -> Detections:
    """The kept dots, in whole-image coordinates."""
    return Detections(
        centre_px=dots.centre_px[keep] + corner,
        covariance_px2=dots.covariance_px2[keep],
        area_px2=dots.area_px2[keep],
        contrast=dots.contrast[keep],
    )


def empty(status: str) -> Detections:
    """No dots, because of what is wrong with the picture."""
    return Detections(
        centre_px=np.zeros((0, 2)),
        covariance_px2=np.zeros((0, 2, 2)),
        area_px2=np.zeros(0),
        contrast=np.zeros(0),
        status=status,
    )
