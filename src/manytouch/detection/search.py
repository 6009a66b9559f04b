"""Search for dots in every frame: in the whole image, or in windows around expected positions."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import plain
from manytouch.detection.candidates import DogBuffers, allocate_dog_buffers, find_candidates
from manytouch.detection.condition import ReferenceImage, describe_reference, find_condition
from manytouch.detection.dot_appearance import (
    Appearance,
    expected_appearance,
    radius_in_image,
)
from manytouch.detection.images import crop
from manytouch.detection.measurement.centroid import measure_rows
from manytouch.detection.measurement.records import AREA, CXX, CYY, X, Y
from manytouch.detection.measurement.sampling_pattern import SamplingPatterns, sampling_patterns
from manytouch.detection.noise import estimate_noise
from manytouch.detection.rim import fit_rims
from manytouch.detection.selection import (
    SelectedDots,
    SelectionLimits,
    find_single_dots,
    select_dots,
    typical_contrast,
)
from manytouch.values import Detections, Frame, Roi, Sensor, Status
from manytouch.values.arrays import Points2, Scalars
from manytouch.values.images.grey_levels import level_scale

SCALE_STEP = 1.5
"""Ratio of successive radii that are searched for when dots differ in size."""
WALK_STEPS = 3
"""Steps from the expected position to the dot, in windows."""
FEWEST_REFERENCE_DOTS = 6
"""Fewest dots of an image that later images are compared with."""
SMALLEST_IMAGE_PX = 8
"""Smallest width and height of an image in which dots are searched for."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DotSearchState:
    """State of the search between frames.

    Attributes:
        appearance: of the dots.
        markers: number of markers that are in the image.
        radius_px: (m,) radius of each marker in the image at rest.
        patterns: sampling patterns of these radii.
        scales_px: (s,) radii that whole images are searched for.
        scale_patterns: sampling patterns of those.
        level_scale: grey levels of 255 per level of an image, from the first one; None before it.
        reference: properties of the first good image; None before.
        buffers: memory for the search of whole images, one for each scale; empty before.
        is_before_scene: whether other things are seen between the markers.
    """

    appearance: Appearance
    markers: int
    radius_px: Scalars
    patterns: SamplingPatterns
    scales_px: Float64[np.ndarray, " s"]
    scale_patterns: SamplingPatterns
    level_scale: float | None = None
    reference: ReferenceImage | None = None
    buffers: tuple[DogBuffers, ...] = ()
    is_before_scene: bool = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DotSearch:
    """Finds the dots of a sensor.

    Attributes:
        roi_px: x, y, width, height of the region of interest; None for the whole image.
        least_share: contrast of the weakest dots over that of typical ones.
        least_snr: contrast of the weakest dots over the noise of a pixel.
        steady_radius: change of the radius of a dot, as a share of it, that is no sign of another thing
            behind a transparent skin.
        scene_std: standard deviation that such a thing adds to the centre, over the further change of the
            radius.
        rim_gap: distance, over the radius, up to which the centre of the pixels counts where that of the rim
            is another; from twice of it on only the rim counts.
        rim_std, hidden_rim_std: standard deviation of the centre of a rim over the radius, and how much the
            square of the share of the rim that is not seen adds to it.
    """

    roi_px: Roi | None = None
    least_share: float = 0.09
    least_snr: float = 1.5
    steady_radius: float = 0.05
    scene_std: float = 3.0
    rim_gap: float = 0.1
    rim_std: float = 0.03
    hidden_rim_std: float = 1.7

    def start(self, sensor: Sensor) -> DotSearchState:
        """State before the first frame.

        Raises:
            SensorError: the sensor has no markers.
        """
        appearance = expected_appearance(sensor)
        assert sensor.layout is not None
        layout = sensor.layout
        radius_px = radius_in_image(sensor.camera, layout.rest_mm, layout.radius_mm)
        radius_px = np.clip(radius_px, appearance.radius_min_px, appearance.radius_max_px)
        scales_px = choose_scales(appearance)
        return DotSearchState(
            appearance=appearance,
            markers=int((~layout.is_missing).sum()),
            radius_px=radius_px,
            patterns=sampling_patterns(radius_px),
            scales_px=scales_px,
            scale_patterns=sampling_patterns(scales_px),
            is_before_scene=layout.is_before_scene,
        )

    def step(
        self, state: DotSearchState, frame: Frame, expected_px: Points2 | None
    ) -> tuple[DotSearchState, Detections]:
        """Dots of a frame.

        `expected_px` (m, 2) limits the search to windows around these positions; None searches the whole
        image. A frame without an image has the status `DECODE_ERROR`; an image that has another size than
        the first good one, or that is smaller than `SMALLEST_IMAGE_PX` within the region of interest, has
        `WRONG_SIZE`.
        """
        if frame.image is None:
            return state, no_detections(Status.DECODE_ERROR)
        scale = state.level_scale if state.level_scale is not None else level_scale(frame.image)
        if state.level_scale is None:
            state = replace(state, level_scale=scale)
        if state.reference is not None and state.reference.shape[:2] != frame.image.shape[:2]:
            return state, no_detections(Status.WRONG_SIZE)
        image, corner = crop(frame.image, self.roi_px)
        if min(image.shape[:2]) < SMALLEST_IMAGE_PX:
            return state, no_detections(Status.WRONG_SIZE)
        weights = state.appearance.weights(1 if image.ndim == 2 else image.shape[2]) * scale
        noise = estimate_noise(image, weights)
        if expected_px is None:
            state = _with_buffers(state, image)
            rows, radius_px = self._search_image(state, image, weights, noise)
        else:
            rows, radius_px = _search_windows(state, image, weights, noise, expected_px - corner)
        if state.is_before_scene and expected_px is not None:
            rims = self._rims(image, weights, rows, radius_px, expected_px - corner)
            rows = self._with_scene(rows, radius_px, rims)
        found, edge_px = self._select(rows, radius_px, state.markers, noise, corner)
        status = find_condition(
            state.reference, frame.image, found, edge_px, level_scale=scale, markers=state.markers
        )
        is_good = status is Status.OK and len(edge_px) >= min(FEWEST_REFERENCE_DOTS, state.markers)
        if state.reference is None and is_good:
            state = replace(state, reference=describe_reference(frame.image, found, edge_px))
        return state, replace(found, status=status, is_predicted=frame.is_predicted)

    def _select(
        self,
        rows: Float64[np.ndarray, "n 9"],
        radius_px: Scalars,
        markers: int,
        noise: float,
        corner: Float64[np.ndarray, "2"],
    ) -> tuple[Detections, Float64[np.ndarray, " k"]]:
        """The dots in whole-image coordinates, and the widths of their edges."""
        most = len(rows)
        selected = SelectedDots(
            centre=np.empty((most, 2)),
            covariance=np.empty((most, 2, 2)),
            area=np.empty(most),
            contrast=np.empty(most),
            edge=np.empty(most),
        )
        limits = SelectionLimits(markers, self.least_share, self.least_snr * 3.0 * noise)
        number = select_dots(rows, radius_px, plain(limits), corner, plain(selected))
        found = Detections(
            centre_px=selected.centre[:number],
            covariance_px2=selected.covariance[:number],
            area_px2=selected.area[:number],
            contrast=selected.contrast[:number],
        )
        return found, selected.edge[:number]

    def _rims(
        self,
        image: np.ndarray,
        weights: Float64[np.ndarray, " c"],
        rows: Float64[np.ndarray, "n 9"],
        radius_px: Scalars,
        expected_px: Points2,
    ) -> tuple[Points2, Scalars]:
        """Rims near the measured dots, or near their expected positions where more of a rim is there."""
        rim_px, share = fit_rims(image, weights, rows[:, [X, Y]], radius_px)
        away_px = np.linalg.norm(rows[:, [X, Y]] - expected_px, axis=1)
        far = np.flatnonzero(away_px > 2.0 * self.rim_gap * radius_px)
        other_px, other_share = fit_rims(image, weights, expected_px[far], radius_px[far])
        is_better = other_share > share[far]
        rim_px[far[is_better]], share[far[is_better]] = other_px[is_better], other_share[is_better]
        return rim_px, share

    def _with_scene(
        self, rows: Float64[np.ndarray, "n 9"], radius_px: Scalars, rims: tuple[Points2, Scalars]
    ) -> Float64[np.ndarray, "n 9"]:
        """Rows in which things behind the skin do not count.

        A dot with another size than at rest is measured together with such a thing: its variance is larger.
        Where its rim is seen, the share of the rim states how certain the dot is; and where the centre of the
        rim is elsewhere, it is the centre of the dot.
        """
        rim_px, share = rims
        rows, has_rim = rows.copy(), share > 0.0
        with np.errstate(invalid="ignore"):
            change = np.abs(np.sqrt(rows[:, AREA] / np.pi) / radius_px - 1.0)
            gap = np.linalg.norm(rim_px - rows[:, [X, Y]], axis=1) / radius_px
        std = self.scene_std * np.maximum(change - self.steady_radius, 0.0)
        rim_std = self.rim_std + self.hidden_rim_std * (1.0 - share) ** 2
        std[has_rim] = np.minimum(std, rim_std)[has_rim]
        part = np.clip(gap / self.rim_gap - 1.0, 0.0, 1.0)[has_rim]
        std[has_rim] = np.maximum(std[has_rim], part * rim_std[has_rim])
        away_px = (rim_px - rows[:, [X, Y]])[has_rim]
        rows[has_rim, X] += part * away_px[:, 0]
        rows[has_rim, Y] += part * away_px[:, 1]
        rows[:, [CXX, CYY]] += (radius_px * std)[:, None] ** 2
        return rows

    def _search_image(
        self, state: DotSearchState, image: np.ndarray, weights: Float64[np.ndarray, " c"], noise: float
    ) -> tuple[Float64[np.ndarray, "n 9"], Scalars]:
        """All spots of the right size: measured rows, and expected radii."""
        found, scale = [], []
        for number, radius_px in enumerate(state.scales_px):
            near = find_candidates(image, weights, radius_px, max(noise, 2.0), state.buffers[number])
            typical = typical_contrast(near.contrast, state.markers)
            strong = near.contrast > 0.6 * self.least_share * typical
            found.append(near if strong.all() else near.at(strong))
            scale.append(np.full(len(found[-1].contrast), number))
        index = scale[0] if len(scale) == 1 else np.concatenate(scale)
        place_px = found[0].place_px if len(found) == 1 else np.concatenate([near.place_px for near in found])
        if state.appearance.is_irregular:
            contrast = np.concatenate([near.contrast for near in found])
            single = find_single_dots(place_px, state.scales_px[index], contrast, 1.0)
            place_px, index = place_px[single], index[single]
        patterns, radius_px = state.scale_patterns.at(index), state.scales_px[index]
        return measure_rows(image, weights, place_px, radius_px, patterns, noise=noise), radius_px


def _search_windows(
    state: DotSearchState,
    image: np.ndarray,
    weights: Float64[np.ndarray, " c"],
    noise: float,
    expected_px: Float64[np.ndarray, "m 2"],
) -> tuple[Float64[np.ndarray, "n 9"], Scalars]:
    """The dots near expected positions: measured rows, and expected radii."""
    radius_px, patterns = state.radius_px, state.patterns
    if len(expected_px) != len(radius_px):
        radius_px = np.full(len(expected_px), float(np.median(radius_px)))
        patterns = sampling_patterns(radius_px)
    rows = measure_rows(image, weights, expected_px, radius_px, patterns, noise=noise, walk=WALK_STEPS)
    return rows, radius_px


def _with_buffers(state: DotSearchState, image: np.ndarray) -> DotSearchState:
    """The state with memory for images like this one."""
    kept = state.buffers
    if kept and kept[0].shape == image.shape and kept[0].dtype == image.dtype:
        return state
    return replace(
        state, buffers=tuple(allocate_dog_buffers(image, float(radius)) for radius in state.scales_px)
    )


def choose_scales(appearance: Appearance) -> Float64[np.ndarray, " s"]:
    """Radii (s,) in px that a whole image is searched for."""
    if not appearance.is_irregular:
        return np.array([np.sqrt(appearance.radius_min_px * appearance.radius_max_px)])
    ratio = appearance.radius_max_px / appearance.radius_min_px
    steps = int(np.ceil(np.log(ratio) / np.log(SCALE_STEP)))
    return np.geomspace(appearance.radius_min_px, appearance.radius_max_px, steps + 1)


def no_detections(status: Status) -> Detections:
    """No dots, with the reason."""
    return Detections(
        centre_px=np.zeros((0, 2)),
        covariance_px2=np.zeros((0, 2, 2)),
        area_px2=np.zeros(0),
        contrast=np.zeros(0),
        status=status,
    )
