"""Drawings of values in the image, with matplotlib (extra `lab`)."""

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from manytouch.errors import MissingExtraError, require_type
from manytouch.values.arrays import Points2

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from manytouch.values.reading import Reading

MARKER, ARROW, CONTACT = "#56B4E9", "#F0E442", "#D55E00"
LABEL = {"facecolor": "black", "edgecolor": CONTACT, "alpha": 0.75, "pad": 2.0}


def axes_or_new(axes: Any, purpose: str, **figure: Any) -> Any:
    """The given matplotlib axes, or those of a new figure.

    Raises:
        MissingExtraError: matplotlib is not installed.
        ArgumentError: something else was given.
    """
    if find_spec("matplotlib") is None:
        raise MissingExtraError(purpose, "matplotlib", "lab")
    from matplotlib.axes import Axes

    if axes is None:
        from matplotlib import pyplot

        return pyplot.subplots(layout="constrained", **figure)[1]
    require_type("axes", axes, Axes, "matplotlib axes, or None for a new figure")
    return axes


def draw_reading(reading: "Reading", axes: Optional["Axes"], magnification: float) -> "Axes":
    """The camera image with markers, displacements and contacts; see `Reading.draw`."""
    axes = axes_or_new(axes, "a drawing of a reading")
    frame, grid = reading.frame, reading.grid
    if frame.image is not None:
        image = frame.image
        is_grey = image.ndim == 2
        scaled = image if image.dtype == np.uint8 else image / max(float(image.max()), 1.0)
        axes.imshow(scaled if is_grey else scaled[..., ::-1], cmap="gray" if is_grey else None)
    seen_px = grid.position_px[grid.is_seen]
    axes.plot(*seen_px.T, "o", markersize=4, markerfacecolor="none", markeredgecolor=MARKER, label="marker")
    rest_px = _rest_px(reading)
    if rest_px is not None:
        rest_px = rest_px[grid.is_seen]
        moved = magnification * (seen_px - rest_px)
        axes.quiver(
            *rest_px.T,
            *moved.T,
            color=ARROW,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            width=0.002,
            label=f"displacement x{magnification:g}",
        )
    for contact in reading.contacts.touching:
        if np.isfinite(contact.centre_px).all():
            x_px, y_px = contact.centre_px
            axes.plot(x_px, y_px, "+", color=CONTACT, markersize=12, markeredgewidth=2)
            axes.annotate(
                f"{contact.id}",
                (x_px, y_px),
                xytext=(8, 8),
                textcoords="offset points",
                color="white",
                bbox=LABEL,
            )
    axes.set_aspect("equal")
    if frame.image is None and not axes.yaxis_inverted():
        axes.invert_yaxis()
    axes.set(
        xlabel="x (px)", ylabel="y (px)", title=f"frame {frame.index}, {frame.timestamp_ns * 1e-9:.2f} s"
    )
    return axes


def _rest_px(reading: "Reading") -> Points2 | None:
    """Where the markers are at rest in the image, (m, 2): as measured, else from the estimated displacement.

    A reading does not contain the camera: that is fitted to the markers, with the terms of a perspective view
    of a nearly flat sheet.
    """
    surface, grid = reading.surface, reading.grid
    layout = surface.layout
    if layout is not None and layout.rest_px is not None:
        return layout.rest_px
    x, y, z = surface.position_mm.T
    known = grid.is_seen & np.isfinite(surface.displacement_mm).all(axis=1)
    if known.sum() < 12:
        return None
    terms = np.column_stack([x, y, z, x * z, y * z, np.ones_like(x)])
    camera, *_ = np.linalg.lstsq(terms[known], grid.position_px[known], rcond=None)
    x0, y0, z0 = (surface.position_mm - surface.displacement_mm).T
    at_rest = np.column_stack([x0, y0, z0, x0 * z0, y0 * z0, np.ones_like(x)])
    return np.asarray(grid.position_px - (terms - at_rest) @ camera)
