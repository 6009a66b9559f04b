"""Measurement of the clamp line: the edge of the illuminated sheet, or of a bonded pad, in the image.

Beyond the outermost markers the image is sampled along lines normal to each side, in mm on the sheet. The
first brightness step that extends along most of a side is the clamp line of that side; ledge and casing lie
behind it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float64

from manytouch.geometry.camera import project
from manytouch.geometry.refraction import project_through_window
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.mechanics.shell.shell import Shell
from manytouch.values import Camera, Frame, Layout, Sheet
from manytouch.values.arrays import Points2, Scalars
from manytouch.values.images.grey_levels import level_scale
from manytouch.values.sensor_file.assumed_sheet import ASSUMED_POISSON

SIDES = ("left", "right", "top", "bottom")
MOST_FRAMES = 10
LINES = 81
"""Along each side."""
CLEAR_RADII = 1.4
"""Distance from the outermost markers, in radii, below which their own edges would be found."""
STEP_SHARE = 0.1
"""Brightness is averaged over this share of the pitch on both sides of a point."""
LEAST_GREY = 5.0
LEAST_SHARE = 0.7
"""Share of the lines that must show the step."""
NOISES = 6.0
NEAR_MM = 10.0
MOVED_MM = 1.0
ODD_MM = 1.0
_FORCE_OVER_E_MM2 = 1e-3
_LONGEST_MM = 4.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ClampLine:
    """Measured edge of the sheet.

    Attributes:
        side_mm: (4,) x of left and right, y of top and bottom side in the markers' frame; NaN if it is
            not visible.
    """

    side_mm: Float64[np.ndarray, "4"]

    @property
    def unseen(self) -> tuple[str, ...]:
        """Sides that are not visible in the image."""
        return tuple(
            side for side, place in zip(SIDES, self.side_mm.tolist(), strict=True) if not np.isfinite(place)
        )

    @property
    def size_mm(self) -> Float64[np.ndarray, "2"]:
        """(2,) extent along x and y; NaN if a side is not visible."""
        return np.asarray(self.side_mm[1::2] - self.side_mm[::2])

    @property
    def middle_mm(self) -> Float64[np.ndarray, "2"]:
        """(2,) middle of the outline in the markers' frame; NaN if a side is not visible."""
        return np.asarray(0.5 * (self.side_mm[1::2] + self.side_mm[::2]))


def clamp_line(
    camera: Camera, layout: Layout, frames: Sequence[Frame], pad: Sheet | None = None
) -> ClampLine:
    """Measure the edge of the sheet beyond each outermost row and column of markers.

    Args:
        camera: with the pose of the sheet.
        layout: of the markers.
        frames: of the untouched sheet.
        pad: a bonded pad, whose contact face is seen through its window.
    """
    image = _mean_grey(frames)
    pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
    step_mm = float(camera.translation_mm[2]) / float(np.sqrt(camera.fx_px * camera.fy_px))
    low, high = layout.rest_mm[:, :2].min(axis=0), layout.rest_mm[:, :2].max(axis=0)
    clear_mm = CLEAR_RADII * float(layout.radius_mm.max())
    found = np.full(4, np.nan)
    for number in range(4):
        axis, outward = number // 2, (-1.0, 1.0)[number % 2]
        begin_mm = (low, high)[number % 2][axis] + outward * clear_mm
        along = np.linspace(low[1 - axis], high[1 - axis], LINES)
        away = np.arange(0.0, 3.0 * pitch_mm, step_mm)
        place = np.empty((LINES, len(away), 2))
        place[..., axis], place[..., 1 - axis] = begin_mm + outward * away, along[:, None]
        grey = _read(image, camera, place, pad)
        away_mm = _first_step(grey, away, window=max(2, round(STEP_SHARE * pitch_mm / step_mm)))
        found[number] = begin_mm + outward * away_mm
    return ClampLine(side_mm=found)


def describe(seen: ClampLine, sheet: Sheet | None) -> str:
    """One line: position of the clamp line, its origin, and the effect of an error on forces."""
    where = "" if np.isnan(seen.size_mm).any() else f"{seen.size_mm[0]:.1f} x {seen.size_mm[1]:.1f} mm"
    if sheet is not None and sheet.boundary == "bonded":
        given = f"{sheet.size_mm[0]:.1f} x {sheet.size_mm[1]:.1f} mm"
        sides = "all sides" if not seen.unseen else "no side" if len(seen.unseen) == 4 else "not all sides"
        missing = f" ({', '.join(seen.unseen)} missing)" if 0 < len(seen.unseen) < 4 else ""
        return f"outline of the pad: visible on {sides}{missing}; {given} is used"
    if sheet is None:
        return f"clamp line: the sheet ends at {where or 'no side'} in the image; its thickness is not known"
    change = (
        f"an error of {MOVED_MM:g} mm changes forces {NEAR_MM:g} mm from it by "
        f"{100 * abs(force_change(sheet)):.0f} %"
    )
    given = f"{sheet.size_mm[0]:g} x {sheet.size_mm[1]:g} mm"
    if where:
        return f"clamp line: the sheet ends at {where} in the image and at {given} in [sheet]; {change}"
    sides = "no side" if len(seen.unseen) == 4 else f"not all sides ({', '.join(seen.unseen)} missing)"
    return f"clamp line: visible on {sides}, so [sheet] is used, {given}; {change}"


def clamp_warnings(seen: ClampLine, sheet: Sheet | None) -> list[str]:
    """A warning if the measured clamp line differs from the outline in the sensor file."""
    if sheet is None:
        return []
    half = 0.5 * np.repeat(np.asarray(sheet.size_mm, dtype=np.float64), 2) * [-1.0, 1.0, -1.0, 1.0]
    off = seen.side_mm - half
    far = [number for number in range(4) if abs(off[number]) > ODD_MM]
    if not far:
        return []
    remedy = (
        "if the pad ends there, correct size_mm and offset_mm; if that is the edge of the light or of the "
        "frame around it, leave them"
        if sheet.boundary == "bonded"
        else "if it is clamped there, correct size_mm and offset_mm"
    )
    sides = ", ".join(f"{SIDES[number]} at {seen.side_mm[number]:.1f} mm" for number in far)
    return [
        f"the edge of the illuminated sheet differs from [sheet] ({sides}, from the centre of the sheet): "
        f"{remedy}"
    ]


def force_change(sheet: Sheet) -> float:
    """Relative error of a force `NEAR_MM` from the clamp line if that is wrong by `MOVED_MM`.

    Depth is measured; the force follows from the stiffness of the shell at that place.
    """
    size = np.asarray(sheet.size_mm, dtype=np.float64)
    nearer = _compliance_mm(sheet, size, NEAR_MM)
    farther = _compliance_mm(sheet, size + np.array([2.0 * MOVED_MM, 0.0]), NEAR_MM + MOVED_MM)
    return farther / nearer - 1.0


def _compliance_mm(sheet: Sheet, size_mm: np.ndarray, from_clamp_mm: float) -> float:
    """Depth under a small force at a distance from the centre of the right side, mm."""
    elements = np.maximum(np.round(size_mm / min(_LONGEST_MM, sheet.thickness_mm + 1.0)), 8)
    patch = SplinePatch(
        size_mm=(float(size_mm[0]), float(size_mm[1])),
        elements=(int(elements[0]), int(elements[1])),
        boundary="clamped",
    )
    shell = Shell(
        patch=patch,
        thickness_mm=sheet.thickness_mm,
        poisson=ASSUMED_POISSON if sheet.poisson is None else sheet.poisson,
        bending_factor=sheet.bending_factor or 1.0,
    )
    at = np.array([[max(0.5 * size_mm[0] - from_clamp_mm, 0.0), 0.0]])
    load = shell.patch.load(at, np.array([[0.0, 0.0, -_FORCE_OVER_E_MM2]]))
    shape = equilibrium(shell, load).coefficient_mm
    return -float(Face(shell=shell, point_mm=at).displacement(shape)[0, 2])


def _mean_grey(frames: Sequence[Frame]) -> np.ndarray:
    """(h, w) mean of the first images in grey levels of 255, as float32."""
    images = [frame.image for frame in frames if frame.image is not None][:MOST_FRAMES]
    total = np.mean([np.asarray(image, dtype=np.float32) * level_scale(image) for image in images], axis=0)
    return np.asarray(total if total.ndim == 2 else total.mean(axis=2), dtype=np.float32)


def _read(image: np.ndarray, camera: Camera, place_mm: np.ndarray, pad: Sheet | None) -> np.ndarray:
    """Grey levels at (..., 2) places of the sheet or of the contact face of a pad; NaN outside the image."""
    z_mm = 0.0 if pad is None else pad.marker_depth_mm or 0.0
    flat = np.column_stack([place_mm.reshape(-1, 2), np.full(place_mm[..., 0].size, z_mm)])
    where: Points2 = project(camera, flat) if pad is None else project_through_window(camera, pad, flat)
    x, y = (where[:, axis].reshape(place_mm.shape[:-1]).astype(np.float32) for axis in (0, 1))
    return cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=np.nan)


def _first_step(grey: np.ndarray, away: Scalars, window: int) -> float:
    """Distance at which most lines (n, k) first change their brightness; NaN if none does."""
    whole = np.isfinite(grey).mean(axis=0) > LEAST_SHARE
    reach = len(away) if whole.all() else int(np.argmin(whole))
    if reach < 3 * window:
        return float("nan")
    total = np.cumsum(np.pad(grey[:, :reach], ((0, 0), (1, 0))), axis=1)
    mean = (total[:, window:] - total[:, :-window]) / window
    change = mean[:, window:] - mean[:, :-window]
    typical = np.nanmedian(change, axis=0)
    noise = 1.4826 * float(np.median(np.abs(typical - np.median(typical))))
    agree = (change * np.sign(typical) > 0.5 * np.abs(typical)).mean(axis=0)
    size = np.where(agree > LEAST_SHARE, np.abs(typical), 0.0)
    is_step = size > max(LEAST_GREY, NOISES * noise)
    if not is_step.any():
        return float("nan")
    first = int(np.argmax(is_step))
    last = first + int(np.argmin(np.append(is_step[first:], False)))
    peak = first + int(np.argmax(size[first:last]))
    near = slice(max(peak - window, 0), peak + window + 1)
    middle = float(np.average(np.arange(len(size))[near], weights=np.abs(typical[near])))
    return float(np.interp(middle + window - 0.5, np.arange(len(away)), away))
