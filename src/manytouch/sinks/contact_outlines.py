"""Where the outlines of contacts show in the present image."""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.camera import project
from manytouch.geometry.refraction import project_through_window
from manytouch.geometry.surface_sampling import sampler_at
from manytouch.values import Contact, Sensor, Surface
from manytouch.values.arrays import Points2, Points3

Polygon = Float64[np.ndarray, "_ 2"]
"""Corners in px; the last one is joined to the first."""


def outlines_px(sensor: Sensor, surface: Surface, contacts: Iterable[Contact]) -> dict[int, list[Polygon]]:
    """Rings of the outline of each contact with a known region, as pixels of the image, by its id.

    Rings and their corners are in the order of `Contact.outline`, holes included.

    The outline lies on the camera-side face, of a bonded pad on its contact face. Where the displacement of
    the face is unknown, that of the nearest corner with a known one is used; without any, it is at rest.

    Args:
        sensor: its camera and sheet.
        surface: of the same frame, with its layout.
        contacts: their outlines are in undeformed sheet coordinates.

    Returns:
        For each id the corners (n, 2) of each ring, px; no entry where the region is not known.

    Raises:
        SensorError: the camera lies inside the window of a pad or in front of it.
    """
    rings = [(contact.id, ring.point_mm) for contact in contacts for ring in contact.outline or ()]
    if not rings:
        return {}
    rest_mm = np.concatenate([point_mm for _, point_mm in rings])
    sheet = sensor.sheet
    face_z_mm = 0.0 if sheet is None or sheet.marker_depth_mm is None else sheet.marker_depth_mm
    place_mm = np.column_stack([rest_mm, np.full(len(rest_mm), face_z_mm)])
    if surface.layout is not None:
        place_mm += _filled(rest_mm, sampler_at(surface.layout, rest_mm).displacement(surface))
    if sheet is None:
        place_px = project(sensor.camera, place_mm)
    else:
        place_px = project_through_window(sensor.camera, sheet, place_mm)
    shown_px = np.split(place_px, np.cumsum([len(point_mm) for _, point_mm in rings])[:-1])
    found: dict[int, list[Polygon]] = {}
    for (contact_id, _), ring_px in zip(rings, shown_px, strict=True):
        found.setdefault(contact_id, []).append(ring_px)
    return found


def _filled(rest_mm: Points2, moved_mm: Points3) -> Points3:
    """Displacements (n, 3) of points (n, 2), unknown ones replaced by that of the nearest point."""
    is_known = np.isfinite(moved_mm).all(axis=1)
    if is_known.all() or not is_known.any():
        return np.asarray(np.nan_to_num(moved_mm))
    away_mm = np.linalg.norm(rest_mm[~is_known, None] - rest_mm[is_known], axis=2)
    filled: Points3 = moved_mm.copy()
    filled[~is_known] = moved_mm[is_known][away_mm.argmin(axis=1)]
    return filled
