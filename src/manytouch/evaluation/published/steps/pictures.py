"""A picture of each step of the paper's method (extra `lab`)."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from manytouch.evaluation.published.steps.collect import PaperSteps
from manytouch.geometry.inverse_distance import plane_of
from manytouch.paper.quads import corner_values
from manytouch.sinks.files.atomic_output import atomic_file
from manytouch.values.images.grey_levels import to_8_bits
from manytouch.values.surface import INVERSE_DISTANCE

DOTS_PER_INCH = 110
WIDE_IN, LONGEST_IN = 9.0, 6.5
KEPT, REFUSED, MARK, PRESENT = "#009E73", "#D55E00", "#D55E00", "#0072B2"
FEW_NUMBERS = 700  # markers up to which every depth is written
WINDOW_DOTS = 2.6  # half the side of the picture of centres, in distances between dots


def draw_steps(steps: PaperSteps, folder: Path) -> list[str]:
    """Draw all steps that the frame reached; returns the names of the files in their order."""
    drawings = [
        ("1-camera.png", _camera),
        ("2-grey.png", _grey),
        ("3-threshold.png", _threshold),
        ("4-opened.png", _opened),
        ("5-contours.png", _contours),
        ("6-centres.png", _centres),
        ("7-identities.png", _identities),
    ]
    if steps.marker is not None:
        drawings += [
            ("8-perimeters.png", _perimeters),
            ("9-padded-grid.png", _padded_grid),
            ("10-surface.png", _surface),
        ]
    for name, draw in drawings:
        draw(steps, folder / name)
    return [name for name, _ in drawings]


@contextmanager
def _figure(path: Path, height_in: float, **layout: Any) -> Iterator[Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDE_IN, min(height_in, LONGEST_IN)), layout="constrained", **layout)
    FigureCanvasAgg(figure)
    yield figure
    with atomic_file(path) as partial, np.errstate(over="ignore", invalid="ignore"):
        figure.savefig(partial, dpi=DOTS_PER_INCH, format="png")


def _height_in(image: np.ndarray, share: float = 1.0) -> float:
    """Height of a figure that shows an image over a share of its width, with a title."""
    return share * WIDE_IN * float(image.shape[0] / image.shape[1]) + 0.45


def _show(axes: Any, image: np.ndarray, title: str) -> None:
    axes.imshow(image, cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
    axes.set_axis_off()
    axes.set_title(title, fontsize=10, loc="left")


def _image8(image: np.ndarray | None) -> np.ndarray:
    """The camera's image in RGB or grey, 8 bits."""
    assert image is not None
    image = to_8_bits(image)
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def _camera(steps: PaperSteps, path: Path) -> None:
    image = _image8(steps.reading.frame.image)
    width, height = steps.view.view.window_px[2:]
    inner = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1], [0, 0]], np.float64)
    outline_px = steps.view.view.image_px(inner)
    with _figure(path, _height_in(image)) as figure:
        axes = figure.add_subplot()
        _show(axes, image, f"camera image, frame {steps.reading.frame.index}, and the area of interest")
        axes.plot(*outline_px.T, color=MARK, linewidth=1.5)


def _grey(steps: PaperSteps, path: Path) -> None:
    grey = steps.stages.grey
    inverted = ", inverted" if steps.view.view.is_dark else ""
    with _figure(path, _height_in(grey)) as figure:
        _show(figure.add_subplot(), grey, f"undistorted, aligned, cropped, grey{inverted}")


def _threshold(steps: PaperSteps, path: Path) -> None:
    stages = steps.stages
    with _figure(path, _height_in(stages.grey, 0.7)) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(7, 3))
        inverted = " in the inverted image" if steps.view.view.is_dark else ""
        _show(left, stages.binary, f"brighter than {stages.level}{inverted}")
        right.hist(stages.grey.ravel(), bins=np.arange(0, 257, 4), color="0.55")
        right.axvline(stages.level, color=MARK)
        right.set_yscale("log")
        right.set_xlabel("grey level")
        right.set_title("pixels per level", fontsize=10, loc="left")


def _opened(steps: PaperSteps, path: Path) -> None:
    stages = steps.stages
    shown = np.repeat(stages.opened[..., None], 3, axis=2)
    removed = (stages.binary > 0) & (stages.opened == 0)
    shown[cv2.dilate(removed.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0] = (213, 94, 0)
    with _figure(path, _height_in(stages.grey)) as figure:
        words = f"opened; {int(removed.sum())} pixels removed, drawn larger in red"
        _show(figure.add_subplot(), shown, words)


def _contours(steps: PaperSteps, path: Path) -> None:
    stages, detect = steps.stages, steps.job.pipeline.detect
    shown = cv2.cvtColor(stages.grey, cv2.COLOR_GRAY2RGB)
    for contour, is_marker in zip(stages.contours, stages.is_marker, strict=True):
        cv2.drawContours(shown, [contour], -1, (0, 220, 140) if is_marker else (255, 90, 0), 2)
    with _figure(path, _height_in(stages.grey, 0.7)) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(7, 3))
        kept = int(stages.is_marker.sum())
        _show(left, shown, f"{kept} contours are markers (green), {len(stages.is_marker) - kept} not (red)")
        if len(stages.area_px2):
            right.hist(stages.area_px2, bins=40, color="0.55")
        right.axvline(steps.view.view.minimum_area_px2, color=MARK)
        largest = getattr(detect, "maximum_area_px2", None)
        if largest is not None:
            right.axvline(largest, color=MARK)
        right.set_xlabel("area (px²), and its limits")
        right.set_title("contours", fontsize=10, loc="left")


def _centres(steps: PaperSteps, path: Path) -> None:
    """A part of the picture around the deepest marker, or around the middle of the image."""
    stages = steps.stages
    midpoint_px = stages.midpoint_px[stages.is_marker]
    middle_px = 0.5 * np.array(stages.grey.shape[::-1], np.float64)
    if len(midpoint_px):
        wanted_px = middle_px
        if steps.marker is not None:
            image_px = steps.view.view.image_px(midpoint_px)
            present_px = steps.reading.grid.position_px[steps.marker]
            if np.isfinite(present_px).all():
                wanted_px = midpoint_px[np.linalg.norm(image_px - present_px, axis=1).argmin()]
        middle_px = midpoint_px[np.linalg.norm(midpoint_px - wanted_px, axis=1).argmin()]
    apart_px = _apart_px(steps)
    half_px = WINDOW_DOTS * apart_px
    with _figure(path, LONGEST_IN) as figure:
        axes = figure.add_subplot()
        _show(axes, stages.grey, "contours and their midpoints, enlarged")
        for contour in stages.contours:
            closed = np.concatenate([contour, contour[:1]])[:, 0]
            axes.plot(*closed.T, color=KEPT, linewidth=1.2)
        axes.plot(*midpoint_px.T, "+", color=MARK, markersize=10, markeredgewidth=1.6)
        for x, y in midpoint_px[(np.abs(midpoint_px - middle_px) < 0.9 * half_px).all(axis=1)]:
            axes.text(x, y + 0.45 * apart_px, f"{x:.2f}, {y:.2f}", color="white", fontsize=7, ha="center")
        axes.set_xlim(middle_px[0] - half_px, middle_px[0] + half_px)
        axes.set_ylim(middle_px[1] + half_px, middle_px[1] - half_px)


def _apart_px(steps: PaperSteps) -> float:
    """About the distance between neighbouring dots."""
    return float(np.sqrt(steps.stages.grey.size / max(int(steps.stages.is_marker.sum()), 1)))


def _identities(steps: PaperSteps, path: Path) -> None:
    """The identities of a part of the image at rest and now, and the whole image with those that are lost."""
    image, grid, rest = _image8(steps.reading.frame.image), steps.reading.grid, steps.rest
    is_lost = ~grid.is_seen & ~steps.estimation.layout.is_missing
    with _figure(path, LONGEST_IN) as figure:
        places = figure.subplot_mosaic(
            "ab;cc" if rest is not None else "c", height_ratios=(1, 1.3) if rest else None
        )
        if rest is not None:
            middle = steps.marker if steps.marker is not None else int(np.flatnonzero(grid.is_seen)[:1].sum())
            centre_px = steps.estimation.rest_px[middle]
            half_px = WINDOW_DOTS * _apart_px(steps)
            for name, reading, words in (
                ("a", rest, f"initial identities, frame {rest.frame.index}"),
                ("b", steps.reading, f"identities in frame {steps.reading.frame.index}"),
            ):
                _show(places[name], _image8(reading.frame.image), words)
                places[name].set_xlim(centre_px[0] - half_px, centre_px[0] + half_px)
                places[name].set_ylim(centre_px[1] + half_px, centre_px[1] - half_px)
                _number(places[name], reading.grid.position_px, centre_px, 0.95 * half_px)
        words = f"frame {steps.reading.frame.index}: {int(is_lost.sum())} without their identity (crosses)"
        _show(
            places["c"], image, words if rest is not None else "no frame showed all markers: none is numbered"
        )
        places["c"].plot(*grid.position_px.T, ".", color=KEPT, markersize=2.5)
        if rest is not None:
            places["c"].plot(*steps.estimation.rest_px[is_lost].T, "x", color=REFUSED, markersize=6)


def _number(axes: Any, position_px: np.ndarray, centre_px: np.ndarray, half_px: float) -> None:
    with np.errstate(invalid="ignore"):
        is_inside = (np.abs(position_px - centre_px) < half_px).all(axis=1)
    for marker in np.flatnonzero(is_inside):
        place = {"ha": "center", "va": "center", "fontsize": 7, "fontweight": "bold"}
        axes.text(*position_px[marker], str(marker), color=PRESENT, **place)


def _perimeters(steps: PaperSteps, path: Path) -> None:
    assert steps.marker is not None
    unit, quads = steps.job.sensor.length_unit, steps.estimation.quads
    cells = [steps.marker]
    if quads.is_corner is not None:
        cells = quads.is_corner[[steps.marker]].indices.tolist()
    before_mm = corner_values(steps.estimation.rest_plane_mm, quads)[cells]
    after_mm = corner_values(steps.plane_mm, quads)[cells]
    with _figure(path, LONGEST_IN) as figure:
        axes = figure.add_subplot()
        axes.plot(*steps.estimation.rest_plane_mm.T, "o", color="0.75", markersize=5, label="markers at rest")
        axes.plot(*steps.plane_mm.T, "o", color=PRESENT, markersize=5, label="markers now")
        for quad_mm, colour, line, words in (
            (before_mm, "0.45", "--", "quad before, AP"),
            (after_mm, MARK, "-", "quad now, BP"),
        ):
            for number, corners in enumerate(quad_mm):
                closed = np.concatenate([corners, corners[:1]])
                axes.plot(*closed.T, line, color=colour, label=words if number == 0 else None)
        for number, corner in enumerate(after_mm[0], start=1):
            axes.annotate(
                str(number), corner, xytext=(5, 5), textcoords="offset points", color=MARK, fontsize=11
            )
        middle_mm = np.nanmean(before_mm, axis=(0, 1))
        reach_mm = 2.2 * steps.estimation.layout.pitch_mm
        axes.set_xlim(middle_mm[0] - reach_mm[0], middle_mm[0] + reach_mm[0])
        axes.set_ylim(middle_mm[1] + reach_mm[1], middle_mm[1] - reach_mm[1])
        axes.set_aspect("equal")
        axes.set_xlabel(f"x ({unit})")
        axes.set_ylabel(f"y ({unit})")
        axes.set_title(
            f"marker {steps.marker}: the quad of its neighbours, corners 1 to 4", fontsize=10, loc="left"
        )
        axes.legend(fontsize=8, loc="upper right")


def _padded_grid(steps: PaperSteps, path: Path) -> None:
    layout = steps.estimation.layout
    rows, columns = layout.shape or (1, 1)
    depth = -steps.reading.surface.displacement_mm[:, 2].reshape(rows, columns)
    with _figure(path, min(LONGEST_IN, 0.82 * WIDE_IN * rows / columns + 0.9)) as figure:
        axes = figure.add_subplot()
        shown = axes.imshow(depth, cmap="cividis")
        axes.plot(
            [0.5, columns - 1.5, columns - 1.5, 0.5, 0.5], [0.5, 0.5, rows - 1.5, rows - 1.5, 0.5], color=MARK
        )
        if rows * columns <= FEW_NUMBERS:
            dark = depth < np.nanmean([np.nanmin(depth), np.nanmax(depth)])
            for row, column in np.ndindex(rows, columns):
                if np.isfinite(depth[row, column]):
                    colour = "white" if dark[row, column] else "black"
                    place = {"ha": "center", "va": "center", "fontsize": 4.5, "color": colour}
                    axes.text(column, row, f"{depth[row, column]:.1f}", **place)
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.yaxis.get_major_locator().set_params(integer=True)
        axes.set_xlabel("column")
        axes.set_ylabel("row")
        axes.set_title(
            "depth of each marker; outside of the red line it is padding; white: not known",
            fontsize=10,
            loc="left",
        )
        figure.colorbar(shown, ax=axes, label=f"depth ({steps.job.sensor.length_unit})", shrink=0.8)


def _surface(steps: PaperSteps, path: Path) -> None:
    unit, layout = steps.job.sensor.length_unit, steps.estimation.layout
    between = steps.reading.surface.interpolation
    plane = plane_of(layout, between if between.kind == "idw" else INVERSE_DISTANCE)
    depth_mm = -steps.reading.surface.displacement_mm[:, 2]
    surface_mm = plane(depth_mm)
    x_mm, y_mm = np.meshgrid(plane.x_mm, plane.y_mm)
    with _figure(path, LONGEST_IN) as figure:
        axes = figure.add_subplot(projection="3d")
        shown = axes.plot_surface(
            x_mm, y_mm, surface_mm, cmap="cividis", rcount=120, ccount=120, antialiased=False, alpha=0.9
        )
        axes.scatter(
            layout.rest_mm[:, 0], layout.rest_mm[:, 1], depth_mm, s=3, color=PRESENT, depthshade=False
        )
        for contact in steps.reading.contacts.touching:
            x, y = contact.centre_mm
            axes.text(
                x, y, 1.08 * contact.depth_mm, f"#{contact.id}  {contact.depth_mm:.2f} {unit}", zorder=9
            )
        axes.set_ylim(float(y_mm.max()), float(y_mm.min()))
        axes.set_box_aspect((np.ptp(x_mm), np.ptp(y_mm), 0.3 * max(np.ptp(x_mm), np.ptp(y_mm))), zoom=1.2)
        axes.view_init(elev=40, azim=-66)
        axes.set_xlabel(f"x ({unit})")
        axes.set_ylabel(f"y ({unit})")
        axes.set_title(
            f"{between.iterations} × {between.iterations} points by inverse distances, and the markers",
            fontsize=10,
            loc="left",
        )
        figure.colorbar(shown, ax=axes, label=f"depth ({unit})", shrink=0.55)
