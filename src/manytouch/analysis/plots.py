"""Plots of readings and results on matplotlib axes (extra `lab`)."""

from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from manytouch.analysis.read_results import Results
from manytouch.errors import ManytouchError, SensorError, require_type
from manytouch.sinks.display_grid import display_grid
from manytouch.values import Reading, Sensor
from manytouch.values.display.drawing import CONTACT, LABEL, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

QUANTITIES: dict[str, tuple[str, str | None]] = {
    "depth": ("depth_{0}", "depth_std_{0}"),
    "x": ("x_{0}", "x_std_{0}"),
    "y": ("y_{0}", "y_std_{0}"),
    "normal_force": ("normal_force_N", "force_std_N"),
    "normal_force_over_E": ("normal_force_over_E_{0}2", None),
    "shear_x": ("shear_x_N", "shear_x_std_N"),
    "shear_y": ("shear_y_N", "shear_y_std_N"),
    "torque": ("torque_Nmm", "torque_std_Nmm"),
    "area": ("area_{0}2", "area_std_{0}2"),
}
"""Columns of contacts.csv with their standard deviations, in a given unit of length."""
LEGEND_CONTACTS = 20
BAND_ROOM = 0.5
"""Room for the bands below and above the values, over the range of the values."""
NEWTONS = ("normal_force", "shear_x", "shear_y", "torque")


def plot_surface(reading: Reading, axes: Optional["Axes"] = None, *, unit: str = "mm") -> "Axes":
    """The depth of the sheet as a map in undeformed sheet coordinates, with the contacts.

    Args:
        reading: of one frame.
        axes: to draw on; None: a new figure.
        unit: written at the axes; "pitch" for a sensor of unknown scale (`Sensor.length_unit`).

    Raises:
        SensorError: the surface of the reading has no layout.
        MissingExtraError: matplotlib is not installed.
    """
    require_type(
        "the reading", reading, Reading, "a Reading, such as manytouch.prepare(...).readings() yields"
    )
    axes = axes_or_new(axes, "a plot of the surface")
    layout = reading.surface.layout
    if layout is None:
        raise SensorError("a surface without a layout cannot be drawn: take it from a reading")
    grid = display_grid(layout)
    depth_mm = grid.sampler.depth(reading.surface)
    drawn = axes.pcolormesh(grid.x_mm, grid.y_mm, depth_mm, cmap="cividis", shading="gouraud")
    for contact in reading.contacts.touching:
        for ring in contact.outline or ():
            axes.plot(*np.vstack([ring.point_mm, ring.point_mm[:1]]).T, color=CONTACT)
        axes.plot(*contact.centre_mm, "+", color=CONTACT, markersize=10, markeredgewidth=2)
        axes.annotate(
            f"{contact.id}",
            tuple(contact.centre_mm),
            xytext=(8, 8),
            textcoords="offset points",
            color="white",
            bbox=LABEL,
        )
    axes.figure.colorbar(drawn, ax=axes, label=f"depth ({unit})")
    axes.set_aspect("equal")
    if not axes.yaxis_inverted():
        axes.invert_yaxis()  # y points down, as in the image
    axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", title=f"frame {reading.frame.index}")
    return axes


def plot_contacts(results: Results, axes: Optional["Axes"] = None, *, quantity: str = "depth") -> "Axes":
    """A quantity of each contact over time, with a band of two standard deviations.

    The axis shows the values and half of their range around them; wider bands are clipped.

    Args:
        results: from `read_results`.
        axes: to draw on; None: a new figure.
        quantity: "depth", "x", "y", "normal_force", "normal_force_over_E", "shear_x", "shear_y", "torque" or
            "area".

    Raises:
        ManytouchError: there is no such quantity, or the results are older than it.
        MissingExtraError: matplotlib is not installed.
    """
    require_type("results", results, Results, "what manytouch.read_results returns")
    if quantity not in QUANTITIES:
        raise ManytouchError(f"there is no quantity {quantity!r}: give {' or '.join(QUANTITIES)}")
    value_column, std_column = QUANTITIES[quantity]
    name = value_column.format(results.unit)
    std_name = None if std_column is None else std_column.format(results.unit)
    missing = [each for each in (name, std_name) if each and each not in results.contacts.column_names]
    if missing:
        raise ManytouchError(f"{results.folder} lacks the column {missing[0]}: process the input again")
    axes = axes_or_new(axes, "a plot of contacts")
    column = {
        each: results.contacts[each].to_numpy(zero_copy_only=False) for each in ("contact", "phase", "time_s")
    }
    values = _numbers(results, name)
    deviations = _numbers(results, std_name)
    is_drawn = (column["phase"] != "end") & np.isfinite(values)
    numbers = np.unique(column["contact"][is_drawn])
    has_band = False
    for place, contact in enumerate(numbers):
        rows = is_drawn & (column["contact"] == contact)
        time_s, value, deviation = column["time_s"][rows], values[rows], deviations[rows]
        colour: Any = f"C{place}" if len(numbers) <= 10 else _many_colours()[place % LEGEND_CONTACTS]
        axes.plot(time_s, value, label=f"contact {contact}", color=colour)
        if np.isfinite(deviation).any():
            has_band = True
            axes.fill_between(time_s, value - 2 * deviation, value + 2 * deviation, color=colour, alpha=0.2)
    words, unit = quantity.replace("_", " "), name.rsplit("_", 1)[1]
    title = f"{results.folder.name}{' (bands: 2 standard deviations)' if has_band else ''}"
    if len(numbers):
        axes.set_ylim(*_limits(values[is_drawn]))
    axes.set(xlabel="time (s)", ylabel=f"{words} ({unit})", title=title)
    if not len(numbers):
        reason = _why_empty(results, quantity)
        axes.text(0.5, 0.5, reason, ha="center", va="center", wrap=True, transform=axes.transAxes)
    elif len(numbers) <= LEGEND_CONTACTS:
        axes.legend(ncols=1 + len(numbers) // 8, fontsize="small")
    return axes


def _limits(values: np.ndarray) -> tuple[float, float]:
    """Limits of the axis by the values alone: a band may be wider, and is clipped then."""
    low, high = float(values.min()), float(values.max())
    room = BAND_ROOM * ((high - low) or abs(high) or 1.0)
    return low - room, high + room


def _numbers(results: Results, name: str | None) -> np.ndarray:
    """A column of the contacts as numbers, NaN where empty; all NaN without a name."""
    if name is None:
        return np.full(len(results.contacts), np.nan)
    return np.asarray(results.contacts[name].to_numpy(zero_copy_only=False), np.float64)


def _many_colours() -> np.ndarray:
    from matplotlib import colormaps

    return np.asarray(colormaps["tab20"](np.arange(LEGEND_CONTACTS)))


def _why_empty(results: Results, quantity: str) -> str:
    """Why there is no line to draw."""
    if not len(results.contacts):
        return "no contact was found"
    method = results.summary.get("method", "this method")
    if method != "mechanics":
        return f"the method {method} does not estimate {quantity.replace('_', ' ')}"
    if quantity in NEWTONS:
        return (
            "no force in newtons: the sensor file states no young_MPa,\n"
            "or its mechanics do not fit the frames (see the warnings of process)"
        )
    return f"no contact of this recording has a known {quantity.replace('_', ' ')}"


def plot_layout(sensor: Sensor, axes: Optional["Axes"] = None) -> "Axes":
    """The markers at rest and the outline of the sheet, in sheet coordinates.

    Args:
        sensor: with a layout.
        axes: to draw on; None: a new figure.

    Raises:
        SensorError: the sensor has no layout.
        MissingExtraError: matplotlib is not installed.
    """
    require_type("the sensor", sensor, Sensor, "a Sensor (manytouch.load_sensor reads one)")
    axes = axes_or_new(axes, "a plot of the layout")
    layout, unit = sensor.layout, sensor.length_unit
    if layout is None:
        raise SensorError(f"the sensor {sensor.name!r} has no markers: calibrate rest finds them")
    is_missing = layout.is_missing
    axes.plot(*layout.rest_mm[~is_missing, :2].T, "o", color="0.3", markersize=4, label="marker")
    if is_missing.any():
        axes.plot(*layout.rest_mm[is_missing, :2].T, "x", color=CONTACT, label="missing")
    if sensor.sheet is not None:
        half_x, half_y = sensor.sheet.size_mm / 2
        name = "sheet, assumed" if sensor.sheet.is_assumed else "sheet"
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
        axes.plot(*(corners * (half_x, half_y)).T, color="0.6", label=name)
    axes.set_aspect("equal")
    if not axes.yaxis_inverted():
        axes.invert_yaxis()
    axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", title=sensor.name)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return axes
