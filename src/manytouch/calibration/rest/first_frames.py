"""Dots of the first frames of a recording, and the layout that they form."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from manytouch.calibration.rest_dots import RestDots, confirm_rest_dots, merge_rest_dots
from manytouch.calibration.sparse_dots import find_sparse_dots
from manytouch.errors import LayoutError, SourceError
from manytouch.tracking.lattice.arrange import Arrangement, arrange
from manytouch.values import Camera, Detections, Frame, Layout, Polarity, Roi, Sensor
from manytouch.values.arrays import Mask, read_only

if TYPE_CHECKING:
    from manytouch.detection import Appearance

MOST_FRAMES = 24
"""Largest number of first frames in which dots are searched for."""
IN_FRONT_OF_A_SCENE = (
    "The dots are few, or other things are seen between them; those that stay in place on smooth lines are "
    "the markers."
)
_LEAST_DOTS = 4
_REGULAR, _FEW = 0.8, 60
"""If fewer than 60 dots are found, and less than 0.8 of them are in a regular pattern, they may be seen
before a scene (`Layout.is_before_scene`): choices."""
_FEWEST_PICTURES = 8
"""With fewer pictures, dots that stay in place cannot be distinguished from a scene that moves."""
_DISTANT_PX = 1e6
"""Focal length and distance of the camera of a provisional sensor, whose unit of length is one pixel."""
_SMALL_SHARE = 0.6
"""A dot with less than this share of the median area is small."""
_CUT_RADII, _SMALL_CUT_RADII = 0.85, 1.5
"""A dot is cut if its centre is nearer to the border than this many median radii; the second: a small dot."""


def image_size(frames: Sequence[Frame], roi_px: Roi | None = None) -> tuple[int, int]:
    """Width and height of the decoded frames, px.

    Raises:
        SourceError: no frame was decoded, frames differ in size, or the region is outside the image.
    """
    sizes = {each.image.shape[:2] for each in frames if each.image is not None}
    if not sizes:
        raise SourceError(
            f"none of the first {len(frames)} frames could be decoded; a layout needs at least one picture: "
            "check the file with another player"
        )
    if len(sizes) > 1:
        listed = " and ".join(sorted(f"{width} x {height} px" for height, width in sizes))
        raise SourceError(
            f"the frames differ in size ({listed}), but one camera gives one size: process them separately"
        )
    height, width = sizes.pop()
    if roi_px is not None:
        roi_px.require_inside(width, height, "the input")
    return width, height


def find_rest_dots(
    frames: Sequence[Frame],
    roi_px: Roi | None,
    read_spread_frames: Callable[[], Sequence[Frame]] | None = None,
) -> tuple["Appearance", RestDots, tuple[str, ...]]:
    """Appearance and rest positions of the dots of an unknown recording, and warnings.

    Args:
        frames: the first ones.
        roi_px: x, y, width, height of the region of interest.
        read_spread_frames: reads frames that are spread over the whole recording; called only if no regular
            pattern is found in the first frames. None: only those are used.

    Returns:
        The appearance, the dots, and warnings: `IN_FRONT_OF_A_SCENE` if the dots are those that stay in place
        on smooth lines.

    Raises:
        LayoutError: there are no dots.
    """
    from manytouch.detection import survey

    few = frames[:MOST_FRAMES]
    read_pictures = read_spread_frames or (lambda: few)
    try:
        surveyed = survey(few, roi_px=roi_px)
    except LayoutError:
        found = find_sparse_dots(read_pictures(), roi_px)
        if found is None:
            raise
        return _sparse_appearance(*found), found[1], (IN_FRONT_OF_A_SCENE,)
    count = len(surveyed.detections.centre_px)
    if len(few) >= _FEWEST_PICTURES and count < _FEW and surveyed.regular < _REGULAR:
        found = find_sparse_dots(read_pictures(), roi_px)
        if found is not None and 2 * len(found[1].centre_px) > count:
            return _sparse_appearance(*found), found[1], (IN_FRONT_OF_A_SCENE,)
    surveyed_dots = merge_rest_dots([surveyed.detections])
    width, height = image_size(few, roi_px)
    sensor = _sensor_for_search(surveyed_dots, surveyed.appearance, width, height)
    dots_by_size = merge_rest_dots(detect_in_frames(sensor, few, roi_px))
    at_rest = [few[k] for k in dots_by_size.frames]
    is_same_time = surveyed.frame_index in {frame.index for frame in at_rest} or not at_rest
    dots = confirm_rest_dots(dots_by_size, surveyed_dots, is_same_time=is_same_time)
    if not is_same_time:
        dots = _confirmed_at_rest(dots_by_size, dots, at_rest, surveyed.appearance, roi_px)
    return surveyed.appearance, dots, surveyed.notes


def _confirmed_at_rest(
    by_size: RestDots,
    confirmed: RestDots,
    at_rest: Sequence[Frame],
    appearance: "Appearance",
    roi_px: Roi | None,
) -> RestDots:
    """The dots at rest that a survey of the frames at rest confirms, or `confirmed` if these are more.

    The first survey was of a frame in which the sheet moved. Dots that moved by half a spacing from that
    frame to those at rest are not among `confirmed`.
    """
    from manytouch.detection import survey

    try:
        again = survey(at_rest, roi_px=roi_px, known=appearance)
    except LayoutError:
        return confirmed
    known = merge_rest_dots([again.detections])
    if len(known.centre_px) <= len(confirmed.centre_px):
        return confirmed
    return confirm_rest_dots(by_size, known, is_same_time=True)


def _sparse_appearance(polarity: Polarity, dots: RestDots) -> "Appearance":
    from manytouch.detection import Appearance

    radius_px = np.sqrt(dots.area_px2 / np.pi)
    return Appearance(
        polarity=polarity,
        radius_min_px=float(np.quantile(radius_px, 0.05)),
        radius_max_px=float(np.quantile(radius_px, 0.95)),
        contrast=float(np.median(dots.contrast)),
    )


def _sensor_for_search(dots: RestDots, appearance: "Appearance", width_px: int, height_px: int) -> Sensor:
    """A provisional sensor that describes only the dots to search for; one unit of length is one pixel."""
    markers = len(dots.centre_px)
    return Sensor(
        name="provisional",
        camera=Camera(
            width_px=width_px,
            height_px=height_px,
            fx_px=_DISTANT_PX,
            fy_px=_DISTANT_PX,
            cx_px=0.0,
            cy_px=0.0,
            distortion=read_only(np.zeros(5)),
            rotation_vector=read_only(np.zeros(3)),
            translation_mm=read_only(np.array([0.0, 0.0, _DISTANT_PX])),
        ),
        layout=Layout(
            rest_mm=read_only(np.column_stack([dots.centre_px, np.zeros(markers)])),
            row_column=None,
            pitch_mm=read_only(np.ones(2)),
            radius_mm=read_only(np.sqrt(dots.area_px2 / np.pi)),
            polarity=appearance.polarity,
            colour_weights=appearance.colour_weights,
            is_missing=read_only(np.zeros(markers, dtype=bool)),
        ),
    )


def detect_in_frames(sensor: Sensor, frames: Sequence[Frame], roi_px: Roi | None) -> tuple[Detections, ...]:
    """Detect the dots of each frame with the search that later frames use."""
    from manytouch.detection import DotSearch

    search = DotSearch(roi_px=roi_px)
    state = search.start(sensor)
    found = []
    for frame in frames:
        state, detections = search.step(state, frame, None)
        found.append(detections)
    return tuple(found)


def arrange_rest_dots(dots: RestDots, width_px: int, height_px: int, roi_px: Roi | None) -> Arrangement:
    """Arrange rest dots as numbered markers.

    Raises:
        LayoutError: too few dots.
    """
    if len(dots.centre_px) < _LEAST_DOTS:
        raise LayoutError(
            f"only {len(dots.centre_px)} dots were found in the first frames, but a layout needs at least "
            f"{_LEAST_DOTS}: check light and focus, start the recording untouched, or select the region "
            "with the dots by --roi X,Y,W,H"
        )
    return arrange(dots.centre_px, is_cut(dots, width_px, height_px, roi_px))


def is_cut(dots: RestDots, width_px: int, height_px: int, roi_px: Roi | None) -> Mask:
    """(n,) whether the border of the image or of the region of interest cuts the dot."""
    x, y, w, h = roi_px or (0, 0, width_px, height_px)
    radius = np.sqrt(np.median(dots.area_px2) / np.pi)
    centre = dots.centre_px
    inside = np.minimum(centre - [x - 0.5, y - 0.5], [x + w - 0.5, y + h - 0.5] - centre).min(axis=1)
    is_small = dots.area_px2 < _SMALL_SHARE * np.median(dots.area_px2)
    return np.asarray((inside < _CUT_RADII * radius) | ((inside < _SMALL_CUT_RADII * radius) & is_small))
