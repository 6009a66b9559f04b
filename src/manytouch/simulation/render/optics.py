"""What the camera and the print add to a picture: defocus, motion, flicker, compression, dust, bad dots."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float64

from manytouch.simulation.render.discs import Look, Spot
from manytouch.values import Camera, Layout, Sheet
from manytouch.values.arrays import Image, Points2, Points3, Scalars, read_only


@dataclass(frozen=True, slots=True, kw_only=True)
class ImagingSettings:
    """How the camera takes its pictures.

    Attributes:
        blur_px: standard deviation of the point spread in focus, lens and pixel together.
        aperture_mm: diameter of the lens's opening; 0 is a pinhole, sharp at any distance.
        focus_mm: distance in focus along the optical axis; the sheet's middle where not given.
        exposure_s: how long the shutter is open; what moves is smeared. Pictures belong to its middle.
        flicker: relative swing of the light.
        flicker_Hz: how often it swings.
        jpeg_quality: 1 to 100 as in JPEG files; None keeps every level.
    """

    blur_px: float = 0.8
    aperture_mm: float = 0.0
    focus_mm: float | None = None
    exposure_s: float = 0.0
    flicker: float = 0.0
    flicker_Hz: float = 0.0
    jpeg_quality: int | None = None

    def blurs_px(self, camera: Camera, point_mm: Points3) -> Scalars:
        """Standard deviation (n,) of the point spread for points of the sheet frame.

        A point at distance z is spread over a disc of diameter A f |1 / z - 1 / focus| (thin lens, image
        plane at f in px); the deviation of a uniform disc is a quarter of its diameter.
        """
        rotation, _ = cv2.Rodrigues(camera.rotation_vector)
        distance_mm = point_mm @ rotation[2] + camera.translation_mm[2]
        focus_mm = camera.translation_mm[2] if self.focus_mm is None else self.focus_mm
        spread_px = self.aperture_mm * camera.fx_px * np.abs(1.0 / distance_mm - 1.0 / focus_mm)
        return np.asarray(np.hypot(self.blur_px, spread_px / 4.0))

    def lit(self, look: Look, time_s: float) -> Look:
        """The look at a time."""
        if self.flicker == 0.0:
            return look
        swing = self.flicker * np.sin(2.0 * np.pi * self.flicker_Hz * time_s)
        return replace(look, gain=look.gain * float(1.0 + swing))

    def compressed(self, image: Image) -> tuple[Image, bytes | None]:
        """The picture as it comes out of the camera, and the bytes that it sends."""
        if self.jpeg_quality is None:
            return image, None
        _, code = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self.jpeg_quality])
        decoded = cv2.imdecode(code, cv2.IMREAD_UNCHANGED)
        return read_only(np.asarray(decoded)), code.tobytes()


IN_FOCUS = ImagingSettings()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Faults:
    """What is wrong with the sheet, and not in its sensor file.

    Attributes:
        is_printed: (m,) which markers are there at all.
        cut: (m, 3) the part of each that is printed, as `render_discs` takes it.
        dust_mm: (d, 2) specks on the camera-side face, of the dots' brightness.
        dust_radius_mm: (d,).
        shadow: share of the light that a body takes from the sheet under it, 0 for an opaque sheet.
    """

    is_printed: Bool[np.ndarray, " m"]
    cut: Float64[np.ndarray, "m 3"]
    dust_mm: Float64[np.ndarray, "d 2"]
    dust_radius_mm: Float64[np.ndarray, " d"]
    shadow: float = 0.0


def draw_faults(
    layout: Layout,
    sheet: Sheet,
    *,
    missing: int = 0,
    half_printed: int = 0,
    dust: int = 0,
    shadow: float = 0.0,
    seed: int = 0,
) -> Faults:
    """Faults of these numbers at random places, in addition to markers that the layout states to be missing.

    The same for the same seed. `missing` and `half_printed` are at most the markers that the layout has.
    """
    chance = np.random.default_rng([seed, 0xFA])
    count = len(layout.rest_mm)
    is_printed = ~layout.is_missing
    order = chance.permutation(np.flatnonzero(is_printed))
    is_printed[order[:missing]] = False
    angle = chance.uniform(0.0, 2.0 * np.pi, count)
    half = order[missing : missing + half_printed]
    cut = np.tile([0.0, 0.0, np.inf], (count, 1))
    cut[half] = np.column_stack(
        [np.cos(angle[half]), np.sin(angle[half]), chance.uniform(-0.4, 0.4, len(half))]
    )
    return Faults(
        is_printed=read_only(is_printed),
        cut=read_only(cut),
        dust_mm=read_only(chance.uniform(-0.5, 0.5, (dust, 2)) * sheet.size_mm),
        dust_radius_mm=read_only(0.3 * float(layout.radius_mm.mean()) * chance.uniform(0.2, 1.0, dust)),
        shadow=shadow,
    )


def shadows(amount: float, centre_px: Points2, radius_px: Scalars) -> tuple[Spot, ...]:
    """Soft shadows under bodies; none where they take no light."""
    if amount == 0.0:
        return ()
    return tuple(
        Spot(centre_px=(float(x), float(y)), radius_px=float(radius), amount=amount)
        for (x, y), radius in zip(centre_px, radius_px, strict=True)
    )
