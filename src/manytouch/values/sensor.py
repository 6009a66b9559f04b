"""The sensor: camera, layout of its markers, and sheet."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64, Int64

LengthUnit = Literal["mm", "pitch"]
Polarity = Literal["light", "dark"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Camera:
    """A camera and where it looks from.

    Attributes:
        model: "pinhole" (Brown-Conrady, distortion k1 k2 p1 p2 k3) or "fisheye" (k1..k4), as OpenCV.
        width_px, height_px: size of the image these parameters belong to.
        fx_px, fy_px, cx_px, cy_px: (0, 0) is the centre of the first pixel.
        distortion: (5,) or (4,).
        rotation_vector: (3,) Rodrigues vector of cam_from_sheet, rad.
        translation_mm: (3,) of cam_from_sheet.
    """

    model: Literal["pinhole", "fisheye"] = "pinhole"
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: Float64[np.ndarray, " d"]
    rotation_vector: Float64[np.ndarray, "3"]
    translation_mm: Float64[np.ndarray, "3"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Layout:
    """Where the markers lie when nothing touches, in the order of their numbers.

    Attributes:
        rest_mm: (m, 3) sheet frame, z = 0 on the camera-side face.
        row_column: (m, 2), or None when the layout is no rectangle. marker = row * columns + column.
        pitch_mm: (2,) spacing along x and y (median neighbour distance when there are no rows).
        radius_mm: (m,) of each marker.
        height_mm: how far the tips stand off the camera-side face.
        polarity: are the markers lighter or darker than their ground? "auto": not known before the
            first frames are seen.
        colour_weights: (3,) weights of B, G, R that make markers stand out, or None for plain grey.
        is_missing: (m,) known to be absent; such a marker is never seen.
        rest_px: (m, 2) centres measured at rest (the reference for displacements), or None:
            then the projection of `rest_mm` is the reference.
    """

    rest_mm: Float64[np.ndarray, "m 3"]
    row_column: Int64[np.ndarray, "m 2"] | None
    pitch_mm: Float64[np.ndarray, "2"]
    radius_mm: Float64[np.ndarray, " m"]
    height_mm: float = 0.0
    polarity: Polarity | Literal["auto"]
    colour_weights: Float64[np.ndarray, "3"] | None = None
    is_missing: Bool[np.ndarray, " m"]
    rest_px: Float64[np.ndarray, "m 2"] | None = None

    @property
    def shape(self) -> tuple[int, int] | None:
        """(rows, columns), or None when the layout is no rectangle."""
        if self.row_column is None:
            return None
        rows, columns = self.row_column.max(axis=0) + 1
        return int(rows), int(columns)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sheet:
    """The soft sheet. None means not known; forces are then relative.

    Attributes:
        size_mm: (2,) clamped outline along x and y, centred on the origin.
        thickness_mm: of the sheet without its markers.
        young_MPa, poisson, density_kg_m3: of its material.
        young_std_MPa: deviation of young_MPa, from calibration; None counts as none.
        boundary: how its outline is held.
        pretension_N_per_mm: calibrated, never guessed.
        bending_factor: calibrated factor on the bending stiffness.
        is_assumed: were size and thickness assumed, because nothing said them? Never so in a sensor file.
    """

    size_mm: Float64[np.ndarray, "2"]
    thickness_mm: float
    young_MPa: float | None = None
    young_std_MPa: float | None = None
    poisson: float | None = None
    boundary: Literal["clamped"] = "clamped"
    pretension_N_per_mm: float | None = None
    bending_factor: float | None = None
    density_kg_m3: float | None = None
    is_assumed: bool = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sensor:
    """Camera, layout and sheet, designed or calibrated: the same type.

    Attributes:
        name: for people.
        camera: intrinsics and pose.
        layout: None in a file that holds a camera only.
        sheet: None when not known.
        length_unit: "pitch" when nothing gives the scale: every length named _mm is then in pitches
            (one pitch = the geometric mean of the lattice's two).
        centre_noise_px: noise of a marker's centre, from calibration; None when not measured.
        assumptions: sentences about what had to be assumed; printed and recorded.
        provenance: free keys: who made this, when, from what, residuals.
    """

    name: str
    camera: Camera
    layout: Layout | None = None
    sheet: Sheet | None = None
    length_unit: LengthUnit = "mm"
    centre_noise_px: float | None = None
    assumptions: tuple[str, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)
