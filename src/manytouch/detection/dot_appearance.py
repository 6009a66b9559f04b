"""Appearance of the dots of a sensor: size, polarity, colour and contrast, as a search needs them."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.errors import SensorError
from manytouch.geometry.camera import cam_from_sheet
from manytouch.values import Camera, Polarity, Sensor
from manytouch.values.arrays import Scalars

GREY_OF_BGR = np.array([0.114, 0.587, 0.299])  # ITU-R BT.601, as OpenCV converts
IRREGULAR = 1.6  # largest against smallest radius from where on one scale does not fit all


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Appearance:
    """Appearance of dots.

    Attributes:
        polarity: whether dots are lighter or darker than their background.
        radius_min_px, radius_max_px: range of the radii of discs as large as the dots.
        colour_weights: (3,) of B, G, R, sum of magnitudes 1, that make dots stand out (as `polarity`
            states); None for plain grey.
        contrast: typical contrast, grey levels of 255; NaN when not known.
    """

    polarity: Polarity
    radius_min_px: float
    radius_max_px: float
    colour_weights: Float64[np.ndarray, "3"] | None = None
    contrast: float = float("nan")

    def __post_init__(self) -> None:
        if not 0.0 < self.radius_min_px <= self.radius_max_px:
            raise SensorError(
                f"the dots' radii range from {self.radius_min_px:.3g} to {self.radius_max_px:.3g} px, "
                "but must be positive and ordered: check the markers' radius and the camera"
            )

    @property
    def is_irregular(self) -> bool:
        """Whether the sizes differ so much that several scales must be searched."""
        return self.radius_max_px > IRREGULAR * self.radius_min_px

    def weights(self, channels: int) -> Float64[np.ndarray, " channels"]:
        """Signed weights of an image's channels that make dots light."""
        sign = 1.0 if self.polarity == "light" else -1.0
        if channels == 1:
            return np.array([sign])
        return sign * (GREY_OF_BGR if self.colour_weights is None else self.colour_weights)


def radius_in_image(camera: Camera, point_mm: Float64[np.ndarray, "n 3"], radius_mm: Scalars) -> Scalars:
    """Radius (n,) in pixels of the disc as large as the image of each dot, lens distortion left out."""
    rotation, translation = cam_from_sheet(camera)
    in_cam = point_mm @ rotation.T + translation
    distance = np.linalg.norm(in_cam, axis=1)
    depth = np.maximum(np.abs(in_cam[:, 2]), 1e-6 * distance)
    slant = np.abs(in_cam @ rotation[:, 2]) / distance
    focal_px = np.sqrt(camera.fx_px * camera.fy_px)
    # area = pi r^2 f^2 (n . p) / z^3 of a small disc with normal n at p; a fisheye: f^2 (n . p) / |p|^3
    if camera.model == "fisheye":
        return np.asarray(focal_px * radius_mm * np.sqrt(slant) / distance)
    return np.asarray(focal_px * radius_mm * np.sqrt(slant * distance / depth**3))


def expected_appearance(sensor: Sensor) -> Appearance:
    """Appearance of the dots of a sensor at rest, from its camera and layout.

    Raises:
        SensorError: the sensor has no markers, or none has a size in the image.
    """
    layout = sensor.layout
    if layout is None:
        raise SensorError(
            f"the sensor '{sensor.name}' has no markers: give a sensor file with a [markers] table"
        )
    if layout.polarity == "auto":
        raise SensorError(
            f"the sensor '{sensor.name}' does not state whether its markers are light or dark: set polarity "
            "to light or dark, or let `manytouch calibrate rest` determine it"
        )
    radius = radius_in_image(sensor.camera, layout.rest_mm, layout.radius_mm)[~layout.is_missing]
    radius = radius[np.isfinite(radius) & (radius > 0)]
    if len(radius) == 0:
        raise SensorError(
            f"no marker of the sensor '{sensor.name}' has a size in the image: check radius_mm and the camera"
        )
    return Appearance(
        polarity=layout.polarity,
        radius_min_px=float(np.quantile(radius, 0.02)),
        radius_max_px=float(np.quantile(radius, 0.98)),
        colour_weights=layout.colour_weights,
    )
