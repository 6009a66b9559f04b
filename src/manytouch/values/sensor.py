"""The sensor: camera, layout of its markers, and sheet."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64, Int64

from manytouch.values.arrays import reduced
from manytouch.values.display.html import facts_table
from manytouch.values.images.roi import Roi

LengthUnit = Literal["mm", "pitch"]
Polarity = Literal["light", "dark"]
Boundary = Literal["clamped", "bonded"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Camera:
    """Intrinsic parameters and pose of a camera.

    Attributes:
        model: "pinhole" (Brown-Conrady, distortion k1 k2 p1 p2 k3) or "fisheye" (k1..k4), as OpenCV.
        width_px, height_px: size of the image that these parameters are for.
        fx_px, fy_px, cx_px, cy_px: focal lengths and principal point, from the centre of the first pixel.
        distortion: (5,) or (4,) coefficients of the model.
        rotation_vector: (3,) Rodrigues vector of cam_from_sheet, rad.
        translation_mm: (3,) of cam_from_sheet.
        fx_std_px, fy_std_px, cx_std_px, cy_std_px, distortion_std, rotation_vector_std, translation_std_mm:
            standard deviations, in the shape of what they belong to. None: not stated; see
            `values.sensor_file.default_std`.
        views: the cameras, where several look at the sheet. Size and pixels are then those of their pictures
            in a row, all other parameters those of the first.
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
    fx_std_px: float | None = None
    fy_std_px: float | None = None
    cx_std_px: float | None = None
    cy_std_px: float | None = None
    distortion_std: Float64[np.ndarray, " d"] | None = None
    rotation_vector_std: Float64[np.ndarray, "3"] | None = None
    translation_std_mm: Float64[np.ndarray, "3"] | None = None
    views: tuple["View", ...] = ()

    __reduce__ = reduced

    def __repr__(self) -> str:
        if self.views:
            return f"Camera({len(self.views)} views, {self.width_px} x {self.height_px} px)"
        x_mm, y_mm, z_mm = self.translation_mm
        return (
            f"Camera({self.model}, {self.width_px} x {self.height_px} px, focal length {self.fx_px:.1f} px, "
            f"sheet at ({x_mm:.1f}, {y_mm:.1f}, {z_mm:.1f}) mm)"
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class View:
    """One of several cameras that look at one sheet. Its picture is a part of the frame.

    Attributes:
        name: of the view.
        left_px: column of the frame in which its picture begins; it begins in row 0.
        camera: in pixels of its own picture; its pose is in the frame of the sheet.
    """

    name: str
    left_px: int
    camera: Camera

    @property
    def roi_px(self) -> Roi:
        """Its part of the frame."""
        return Roi(self.left_px, 0, self.camera.width_px, self.camera.height_px)

    @property
    def in_frame(self) -> Camera:
        """The camera in pixels of the frame."""
        return replace(self.camera, cx_px=self.camera.cx_px + self.left_px)

    def to_frame(self, place_px: Float64[np.ndarray, "*n 2"]) -> Float64[np.ndarray, "*n 2"]:
        """Pixels of the frame from those of the picture."""
        return np.asarray(place_px + np.array([self.left_px, 0.0]))


def camera_of_views(cameras: Mapping[str, Camera]) -> Camera:
    """Several cameras on one sheet as one, their pictures in a row from left to right.

    Args:
        cameras: at least one, by the name of its view.
    """
    views, left_px = [], 0
    for name, camera in cameras.items():
        views.append(View(name=name, left_px=left_px, camera=camera))
        left_px += camera.width_px
    height_px = max(camera.height_px for camera in cameras.values())
    return replace(views[0].camera, width_px=left_px, height_px=height_px, views=tuple(views))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Layout:
    """Rest positions and properties of the markers, in the order of their numbers.

    Attributes:
        rest_mm: (m, 3) sheet frame, z = 0 on the camera-side face; of a pad, on the plane of its markers.
        row_column: (m, 2) with marker = row * columns + column; None if the layout is not a lattice.
        pitch_mm: (2,) pitch along x and y (median neighbour distance if the layout is not a lattice).
        radius_mm: (m,) of each marker.
        height_mm: height of the marker tips above the camera-side face.
        polarity: whether the markers are lighter or darker than their background; "auto": to be found in
            the first frames.
        colour_weights: (3,) weights of B, G, R with the best contrast of the markers; None: plain grey.
        is_missing: (m,) whether the marker is known to be absent; such a marker is never seen.
        is_before_scene: whether other things are seen between the markers, as through a transparent skin: a
            marker whose area has changed is then measured together with them.
        rest_px: (m, 2) centres measured at rest (the reference of displacements); None: the reference is the
            projection of `rest_mm`.
        rest_radius_px: (m,) radius of a disc of the area of each dot, measured at rest; NaN where it was not
            seen. None: not measured.
    """

    rest_mm: Float64[np.ndarray, "m 3"]
    row_column: Int64[np.ndarray, "m 2"] | None
    pitch_mm: Float64[np.ndarray, "2"]
    radius_mm: Float64[np.ndarray, " m"]
    height_mm: float = 0.0
    polarity: Polarity | Literal["auto"]
    colour_weights: Float64[np.ndarray, "3"] | None = None
    is_missing: Bool[np.ndarray, " m"]
    is_before_scene: bool = False
    rest_px: Float64[np.ndarray, "m 2"] | None = None
    rest_radius_px: Float64[np.ndarray, " m"] | None = None

    __reduce__ = reduced

    @property
    def shape(self) -> tuple[int, int] | None:
        """(rows, columns); None if the layout is not a lattice."""
        if self.row_column is None:
            return None
        rows, columns = self.row_column.max(axis=0) + 1
        return int(rows), int(columns)

    def __repr__(self) -> str:
        count = f"{len(self.rest_mm)}" if self.shape is None else f"{self.shape[0]} x {self.shape[1]}"
        x_mm, y_mm = self.pitch_mm
        missing = int(self.is_missing.sum())
        return f"Layout({count} {self.polarity} markers, pitch {x_mm:.4g} x {y_mm:.4g} mm, {missing} missing)"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sheet:
    """The soft sheet. None means unknown; forces are relative if the stiffness is unknown.

    Attributes:
        size_mm: (2,) clamped outline along x and y, or outline of a bonded pad.
        thickness_mm: of the sheet without its markers.
        young_MPa, poisson, density_kg_m3: of its material.
        boundary: "clamped": held at its outline; "bonded": a pad on a rigid window, seen through it.
        pretension_N_per_mm: from calibration; never assumed.
        bending_factor: bending stiffness over that of a homogeneous plate, from calibration.
        marker_depth_mm: of a bonded pad, from its contact face to its markers.
        window_mm: thickness of the window; None: the window does not refract.
        window_index, pad_index: refractive indices.
        ..._std_...: standard deviation of the value named like it without `std`; `outline_std_mm` is that of
            each side of the outline. None: not stated; see `values.sensor_file.default_std`.
        is_assumed: whether size and thickness are assumptions; never true in a sensor file.
    """

    size_mm: Float64[np.ndarray, "2"]
    thickness_mm: float
    young_MPa: float | None = None
    poisson: float | None = None
    boundary: Boundary = "clamped"
    pretension_N_per_mm: float | None = None
    bending_factor: float | None = None
    density_kg_m3: float | None = None
    marker_depth_mm: float | None = None
    window_mm: float | None = None
    window_index: float | None = None
    pad_index: float | None = None
    outline_std_mm: float | None = None
    thickness_std_mm: float | None = None
    young_std_MPa: float | None = None
    poisson_std: float | None = None
    pretension_std_N_per_mm: float | None = None
    bending_factor_std: float | None = None
    density_std_kg_m3: float | None = None
    marker_depth_std_mm: float | None = None
    window_std_mm: float | None = None
    window_index_std: float | None = None
    pad_index_std: float | None = None
    is_assumed: bool = False

    __reduce__ = reduced

    @property
    def states_pretension(self) -> bool:
        """Whether the pretension over E is known; without E only a pretension of 0 states it."""
        tension = self.pretension_N_per_mm
        return tension is not None and (self.young_MPa is not None or tension == 0.0)

    def __repr__(self) -> str:
        x_mm, y_mm = self.size_mm
        stiffness = "E unknown" if self.young_MPa is None else f"E {self.young_MPa:g} MPa"
        assumed = ", assumed" if self.is_assumed else ""
        return f"Sheet({x_mm:g} x {y_mm:g} x {self.thickness_mm:g} mm, {stiffness}, {self.boundary}{assumed})"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sensor:
    """Camera, layout and sheet; one type for designed and calibrated sensors.

    Attributes:
        name: shown in messages and results.
        camera: intrinsics and pose.
        layout: None if only the camera is known.
        sheet: None if unknown.
        scale_is_known: false if nothing gives the scale. The pitch (geometric mean of the lattice's two) is
            then assumed to be 1 mm, so that every length in mm is also a number of pitches.
        centre_noise_px: noise of a marker's centre, from calibration; None if not measured.
        rest_is_doubtful: whether the reference positions may be those of a touched sheet.
        assumptions: sentences on what had to be assumed; printed and recorded.
        provenance: free keys: who made this, when, from what, residuals.
    """

    name: str
    camera: Camera
    layout: Layout | None = None
    sheet: Sheet | None = None
    scale_is_known: bool = True
    centre_noise_px: float | None = None
    rest_is_doubtful: bool = False
    assumptions: tuple[str, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)

    @property
    def is_nominal(self) -> bool:
        """Whether it describes a kind of sensor, and not one device: `nominal = true` in its provenance."""
        return self.provenance.get("nominal") is True

    @property
    def shape_is_nominal(self) -> bool:
        """Whether thickness and outline of its sheet are those of a kind of sensor, calibrated or not."""
        return self.is_nominal or self.provenance.get("nominal_shape") is True

    @property
    def rest_frames(self) -> int | None:
        """Number of frames of the recording whose mean the rest positions are; None if it is not known."""
        count, still = self.provenance.get("rest_frames"), self.provenance.get("still_frames")
        found = len(still) if count is None and isinstance(still, list | tuple) else count
        return found if isinstance(found, int) and found > 0 else None

    @property
    def length_unit(self) -> LengthUnit:
        """The unit that writers name in columns and labels: "mm", or "pitch" if the scale is unknown."""
        return "mm" if self.scale_is_known else "pitch"

    def __repr__(self) -> str:
        scale = "" if self.scale_is_known else ", scale unknown"
        return f"Sensor({self.name!r}, {self.camera}, {self.layout}, {self.sheet}{scale})"

    def _repr_html_(self) -> str:
        scale = "known" if self.scale_is_known else "unknown: lengths are in pitches"
        parts = (("camera", self.camera), ("markers", self.layout), ("sheet", self.sheet), ("scale", scale))
        assumed = (("assumed", sentence) for sentence in self.assumptions)
        return facts_table(f"Sensor {self.name}", (*parts, *assumed))
