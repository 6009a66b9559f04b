"""The solid of a bonded pad, its mesh refined where bodies touch it."""

import numpy as np
from scipy.spatial.transform import Rotation

from manytouch.simulation.fem.contact.indenters import signed_distance
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import IndenterPath, Loading
from manytouch.simulation.fem.sheet import PadModel, Refinement, pad_model
from manytouch.values import Sheet

ELEMENT_MM, CONTACT_ELEMENT_MM, LAYERS = 2.5, 0.6, 3
"""Against a finer mesh: force within 1.1 %, markers within 0.003 mm (docs/derivations/fem.md)."""
RASTER_MM = 0.25


def rubber(sheet: Sheet) -> NeoHooke:
    """The material of a sheet whose stiffness is known."""
    assert sheet.young_MPa is not None
    assert sheet.poisson is not None
    return NeoHooke(
        young_MPa=sheet.young_MPa, poisson=sheet.poisson, density_kg_m3=sheet.density_kg_m3 or 960.0
    )


def markers_mm(sheet: Sheet) -> float | None:
    """From the bonded face of a pad to its markers; None for a clamped sheet."""
    if sheet.boundary == "clamped":
        return None
    return sheet.thickness_mm - (sheet.marker_depth_mm or 0.0)


def pad_solid(
    sheet: Sheet,
    loading: Loading | None,
    *,
    element_mm: float = ELEMENT_MM,
    contact_element_mm: float = CONTACT_ELEMENT_MM,
    layers: int = LAYERS,
) -> PadModel:
    """A bonded pad, meshed for a loading.

    Args:
        sheet: with its stiffness.
        loading: what touches it; None: nothing.
        element_mm, contact_element_mm: largest width of elements, and of those that a body touches.
        layers: least number of elements through the thickness.
    """
    touches = () if loading is None else loading.touches
    found = [_touched_rectangle(sheet, touch) for touch in touches]
    found += [
        np.array(patch.centre_mm) + 0.5 * np.array([[-1.0], [1.0]]) * np.array(patch.size_mm)
        for patch in (() if loading is None else loading.patches)
    ]
    refined = tuple(
        Refinement(
            low_mm=(float(corners[0, 0]), float(corners[0, 1])),
            high_mm=(float(corners[1, 0]), float(corners[1, 1])),
            element_mm=min(contact_element_mm, element_mm),
        )
        for corners in found
        if corners is not None
    )
    return pad_model(
        (float(sheet.size_mm[0]), float(sheet.size_mm[1])),
        sheet.thickness_mm,
        rubber(sheet),
        marker_depth_mm=sheet.marker_depth_mm or 0.0,
        element_mm=element_mm,
        layers=layers,
        refined=refined,
    )


def _touched_rectangle(sheet: Sheet, touch: IndenterPath) -> np.ndarray | None:
    """Corners (2, 2) of the part of the undeformed face that a body enters anywhere on its way."""
    x_mm, y_mm = (np.arange(-0.5 * size, 0.5 * size + 1e-9, RASTER_MM) for size in sheet.size_mm)
    raster = np.stack(np.meshgrid(x_mm, y_mm, indexing="ij"), axis=-1).reshape(-1, 2)
    place_mm = np.column_stack([raster, np.full(len(raster), sheet.thickness_mm)])
    entered = np.zeros(len(raster), dtype=bool)
    for position_mm, turn in zip(touch.position_mm, touch.rotation_vector, strict=True):
        rotation = Rotation.from_rotvec(turn.copy()).as_matrix()
        entered |= signed_distance(touch.indenter, (place_mm - position_mm) @ rotation)[0] < 0.0
    if not entered.any():
        return None
    return np.array([raster[entered].min(axis=0) - RASTER_MM, raster[entered].max(axis=0) + RASTER_MM])
