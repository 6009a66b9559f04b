"""Contacts and markers of a reading as rows of numbers; unknown ones are None."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from manytouch.values.contacts import Contact, Contacts
    from manytouch.values.frame import Frame
    from manytouch.values.reading import Reading


class ArrowTable:
    """Columns that pandas, polars, DuckDB and others take through the Arrow PyCapsule interface.

    `pyarrow.table(rows)`, `polars.DataFrame(rows)`, `pandas.DataFrame.from_arrow(rows)`.

    Attributes:
        columns: values by name, None where unknown.
    """

    def __init__(self, columns: dict[str, Any]) -> None:
        self.columns = columns

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return arrow_stream(self.columns, requested_schema)


def arrow_stream(columns: dict[str, Any], requested_schema: object = None) -> object:
    """A PyCapsule with an ArrowArrayStream of the columns."""
    import pyarrow as pa

    arrays = {name: pa.array(values, _arrow_type(name), from_pandas=True) for name, values in columns.items()}
    table: Any = pa.table(arrays)
    return table.__arrow_c_stream__(requested_schema)


def contact_values_by_column(contacts: "Contacts") -> dict[str, Any]:
    """Values of the contacts, also of those that just ended, by the names of `contact_values`."""
    rows = [contact_values(contact) for contact in contacts.contacts]
    return {name: [row[name] for row in rows] for name in _CONTACT_COLUMNS}


def contact_row(frame: "Frame", contact: "Contact") -> dict[str, Any]:
    """A line of contacts.csv, by the names of its columns: values of the frame and `contact_values`."""
    return {"frame": frame.index, "time_s": frame.timestamp_ns * 1e-9, **contact_values(contact)}


def contact_values(contact: "Contact") -> dict[str, Any]:
    """What is known of a contact alone, by the names of the columns of contacts.csv.

    The names always end in _mm, also where those of the file end in _pitch: 1 mm then stands for one pitch.
    """
    numbers = {
        "x_mm": contact.centre_mm[0],
        "y_mm": contact.centre_mm[1],
        "depth_mm": contact.depth_mm,
        "normal_force_N": -contact.force_N[2],
        "shear_x_N": contact.force_N[0],
        "shear_y_N": contact.force_N[1],
        "torque_Nmm": contact.torque_Nmm,
        "area_mm2": contact.area_mm2,
        "x_px": contact.centre_px[0],
        "y_px": contact.centre_px[1],
        "x_std_mm": contact.std("x"),
        "y_std_mm": contact.std("y"),
        "depth_std_mm": contact.std("depth"),
        "force_std_N": contact.std("normal_force"),
        "shear_x_std_N": contact.std("shear_x"),
        "shear_y_std_N": contact.std("shear_y"),
        "torque_std_Nmm": contact.std("torque"),
        "area_std_mm2": contact.std("area"),
        "normal_force_over_E_mm2": contact.normal_force_over_E_mm2,
        "half_major_mm": contact.half_major_mm,
        "half_minor_mm": contact.half_minor_mm,
        "orientation_rad": contact.orientation_rad,
        "shape_probability": contact.shape_probability,
    }
    return {
        "contact": contact.id,
        "phase": str(contact.phase),
        **{name: known(float(value)) for name, value in numbers.items()},
        "slip": contact.slip,
        "shape": None if contact.shape is None else str(contact.shape),
    }


def marker_values_by_column(reading: "Reading") -> dict[str, Any]:
    """The markers by column, as in markers.parquet, without those that are known to be absent."""
    grid, surface = reading.grid, reading.surface
    layout = surface.layout
    kept = np.flatnonzero(np.ones(len(grid.is_seen), bool) if layout is None else ~layout.is_missing)
    count = len(kept)
    place = None if layout is None or layout.row_column is None else layout.row_column
    position_px = np.where(grid.is_seen[:, None], grid.position_px, np.nan)[kept]
    moved_mm = surface.displacement_mm[kept]
    return {
        "marker": kept,
        "row": [None] * count if place is None else place[kept, 0],
        "column": [None] * count if place is None else place[kept, 1],
        "x_px": position_px[:, 0],
        "y_px": position_px[:, 1],
        "seen": grid.is_seen[kept],
        "dx_mm": moved_mm[:, 0],
        "dy_mm": moved_mm[:, 1],
        "depth_mm": -moved_mm[:, 2],
        "depth_std_mm": np.sqrt(surface.covariance_mm2[kept, 2, 2]),
    }


def reading_dict(reading: "Reading") -> dict[str, Any]:
    """A reading as plain numbers, texts and lists, which `json.dumps` takes."""
    return {
        "frame": reading.frame.index,
        "time_s": reading.frame.timestamp_ns * 1e-9,
        "camera": reading.frame.camera,
        "status": str(reading.status),
        "milliseconds": known(reading.milliseconds),
        "markers_seen": int(reading.grid.is_seen.sum()),
        "markers": len(reading.grid.is_seen),
        "contacts": [
            {
                **contact_values(contact),
                "outline": None
                if contact.outline is None
                else [
                    {"is_hole": ring.is_hole, "points_mm": ring.point_mm.tolist()} for ring in contact.outline
                ],
            }
            for contact in reading.contacts.contacts
        ],
    }


def known(value: float) -> float | None:
    """The number; None if it is unknown."""
    return value if math.isfinite(value) else None


_CONTACT_COLUMNS = (
    *("contact", "phase", "x_mm", "y_mm", "depth_mm", "normal_force_N", "shear_x_N", "shear_y_N"),
    *("torque_Nmm", "area_mm2", "x_px", "y_px", "x_std_mm", "y_std_mm", "depth_std_mm", "force_std_N"),
    *("shear_x_std_N", "shear_y_std_N", "torque_std_Nmm", "area_std_mm2", "normal_force_over_E_mm2"),
    *("half_major_mm", "half_minor_mm", "orientation_rad", "shape_probability", "slip", "shape"),
)


def _arrow_type(name: str) -> Any:
    import pyarrow as pa

    kinds: dict[str, Any] = dict.fromkeys(("contact", "marker", "row", "column"), pa.int64())
    kinds |= dict.fromkeys(("phase", "shape"), pa.string()) | dict.fromkeys(("slip", "seen"), pa.bool_())
    return kinds.get(name, pa.float64())
