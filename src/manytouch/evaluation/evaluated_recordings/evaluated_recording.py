"""One recording as a method estimated it, or its ground truth: the same value for both. NaN: not given."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.errors import ManytouchError
from manytouch.values import LengthUnit
from manytouch.values.arrays import Counts, Points2, Scalars, read_only


class EvaluationError(ManytouchError):
    """Results and truth cannot be read, or do not belong together."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactRows:
    """The contacts that touch, of all frames, one row each. NaN: a value that the method does not give.

    Fields named `_mm` and `_mm2` are in pitches if `EvaluatedRecording.unit` is "pitch".

    Attributes:
        frame: (n,) number of the frame, ascending.
        id: (n,) identity of the contact.
        centre_mm, centre_std_mm: (n, 2) x, y of its force centroid in undeformed coordinates.
        depth_mm, depth_std_mm: (n,) largest depth within the contact.
        normal_force_N, normal_force_std_N: (n,) positive in compression.
        shear_N, shear_std_N: (n, 2) along x and y, of the object on the sheet.
        torque_Nmm, torque_std_Nmm: (n,) about z, which points out of the sheet: positive from x towards y.
        area_mm2, area_std_mm2: (n,) of the region.
        half_axes_mm: (n, 2) of the uniform ellipse with its second moments, the major one first.
        orientation_rad: (n,) angle of the major axis from x towards y, in (-pi/2, pi/2].
    """

    frame: Counts
    id: Counts
    centre_mm: Points2
    centre_std_mm: Points2
    depth_mm: Scalars
    depth_std_mm: Scalars
    normal_force_N: Scalars
    normal_force_std_N: Scalars
    shear_N: Points2
    shear_std_N: Points2
    torque_Nmm: Scalars
    torque_std_Nmm: Scalars
    area_mm2: Scalars
    area_std_mm2: Scalars
    half_axes_mm: Points2
    orientation_rad: Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EvaluatedRecording:
    """One recording, as a method estimated it or its truth: f frames, m markers.

    Fields named `_mm` are in pitches if `unit` is "pitch". NaN: a value that the method does not give.

    Attributes:
        name: shown in messages and reports: of the folder, or of the case.
        method: which method it comes from; empty for a truth.
        unit: of lengths, "mm" or "pitch".
        frame: (f,) numbers of its frames, ascending.
        status: of each frame.
        milliseconds: (f,) from the decoded frame to the finished reading.
        marker: (m,) numbers of its markers, ascending.
        place: (m, 2) where they lie at rest.
        place_unit: of `place`: "mm", "pitch" (from the middle), "column" (columns and rows) or "px".
        centre_px, centre_std_px: (f, m, 2) x, y of the markers' images; NaN where not seen.
        depth_mm, depth_std_mm: (f, m) at the markers.
        contacts: those that touch.
    """

    name: str
    method: str
    unit: LengthUnit
    frame: Int64[np.ndarray, " f"]
    status: tuple[str, ...]
    milliseconds: Float64[np.ndarray, " f"]
    marker: Int64[np.ndarray, " m"]
    place: Float64[np.ndarray, "m 2"]
    place_unit: str
    centre_px: Float64[np.ndarray, "f m 2"]
    centre_std_px: Float64[np.ndarray, "f m 2"]
    depth_mm: Float64[np.ndarray, "f m"]
    depth_std_mm: Float64[np.ndarray, "f m"]
    contacts: ContactRows


REGION_COLUMNS = ("torque", "torque_std", "area", "area_std", "half_major", "half_minor", "orientation")
"""Columns that tables written by others may lack."""


def contact_rows(columns: dict[str, np.ndarray]) -> ContactRows:
    """Rows from the columns of contacts.csv without their units, in the order of their frames.

    Args:
        columns: (n,) each: frame, id, x, y, depth, normal_force, shear_x, shear_y; their standard deviations
            x_std, y_std, depth_std, force_std (of the normal force, named as in contacts.csv), shear_x_std,
            shear_y_std; and those of `REGION_COLUMNS`, which may be absent.
    """
    order = np.lexsort((columns["id"], columns["frame"]))
    unknown = np.full(len(order), np.nan)
    column = {name: columns.get(name, unknown)[order] for name in (*columns, *REGION_COLUMNS)}

    def several(*names: str) -> np.ndarray:
        return read_only(np.column_stack([column[name] for name in names]).astype(np.float64))

    def single(name: str) -> np.ndarray:
        return read_only(column[name].astype(np.float64))

    return ContactRows(
        frame=read_only(column["frame"].astype(np.int64)),
        id=read_only(column["id"].astype(np.int64)),
        centre_mm=several("x", "y"),
        centre_std_mm=several("x_std", "y_std"),
        depth_mm=single("depth"),
        depth_std_mm=single("depth_std"),
        normal_force_N=single("normal_force"),
        normal_force_std_N=single("force_std"),
        shear_N=several("shear_x", "shear_y"),
        shear_std_N=several("shear_x_std", "shear_y_std"),
        torque_Nmm=single("torque"),
        torque_std_Nmm=single("torque_std"),
        area_mm2=single("area"),
        area_std_mm2=single("area_std"),
        half_axes_mm=several("half_major", "half_minor"),
        orientation_rad=single("orientation"),
    )


def subset(rows: ContactRows, chosen: np.ndarray) -> ContactRows:
    """Some of the rows, by mask or by index."""
    return ContactRows(
        **{name: read_only(getattr(rows, name)[chosen]) for name in ContactRows.__dataclass_fields__}
    )


def display_name(folder: Path) -> str:
    """How a folder is called in messages and reports: by its name; a folder `truth` also by its parent's."""
    path = folder.resolve()
    return f"{path.parent.name}/{path.name}" if path.name == "truth" else path.name
