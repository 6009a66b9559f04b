"""Plots of readings and results on matplotlib axes (extra `lab`)."""

from typing import TYPE_CHECKING, Optional

import numpy as np

from manytouch.analysis.read_results import Results
from manytouch.errors import ManytouchError, SensorError, require_type
from manytouch.sinks.surface_grid import surface_grid
from manytouch.values import Reading, Sensor
from manytouch.values.display.drawing import CONTACT, LABEL, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

QUANTITIES = ("depth", "normal_force")


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
    grid = surface_grid(layout)
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

    Args:
        results: from `read_results`.
        axes: to draw on; None: a new figure.
        quantity: "depth" or "normal_force".

    Raises:
        ManytouchError: there is no such quantity.
        MissingExtraError: matplotlib is not installed.
    """
    require_type("results", results, Results, "what manytouch.read_results returns")
    if quantity not in QUANTITIES:
        raise ManytouchError(f"there is no quantity {quantity!r}: give {' or '.join(QUANTITIES)}")
    axes = axes_or_new(axes, "a plot of contacts")
    unit = "N" if quantity == "normal_force" else results.unit
    std = "force_std_N" if quantity == "normal_force" else f"depth_std_{unit}"
    column = {
        name: results.contacts[name].to_numpy(zero_copy_only=False)
        for name in ("contact", "phase", "time_s", f"{quantity}_{unit}", std)
    }
    is_touching = column["phase"] != "end"
    for contact in np.unique(column["contact"]):
        rows = is_touching & (column["contact"] == contact)
        time_s, value, deviation = (column[name][rows] for name in ("time_s", f"{quantity}_{unit}", std))
        (line,) = axes.plot(time_s, value, label=f"contact {contact}")
        axes.fill_between(
            time_s, value - 2 * deviation, value + 2 * deviation, color=line.get_color(), alpha=0.2
        )
    words = quantity.replace("_", " ")
    axes.set(xlabel="time (s)", ylabel=f"{words} ({unit})", title=results.folder.name)
    if 0 < len(axes.lines) <= 12:
        axes.legend()
    return axes


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
