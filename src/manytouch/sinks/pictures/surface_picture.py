"""Figures of the surface in three dimensions, next to the annotated camera image (extra `lab`)."""

from collections.abc import Collection
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manytouch.errors import MissingExtraError
from manytouch.sinks.display_grid import display_grid
from manytouch.sinks.files.atomic_output import atomic_file
from manytouch.sinks.files.sensor_description import layout_of
from manytouch.sinks.pictures.annotate import Annotator
from manytouch.values import Contact, Reading, Sensor

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 110
TALL_INCHES, SURFACE_INCHES = 6.2, 8.4
HEIGHT_TO_WIDTH, MOST_STRETCH = 0.26, 12.0
MARK = "#D55E00"


class SurfacePicture:
    """Draws the surface of single readings of one sensor."""

    def __init__(self, sensor: Sensor) -> None:
        """Raises MissingExtraError when matplotlib is not installed."""
        if find_spec("matplotlib") is None:
            raise MissingExtraError("a picture of the surface", "matplotlib", "lab")
        self._sensor = sensor
        self._grid = display_grid(layout_of(sensor))
        self._annotate = Annotator(sensor)

    def save(self, reading: Reading, path: Path) -> Path:
        """Draw a reading into a file: PNG, PDF or SVG, by its suffix."""
        figure = self.figure(reading)
        # matplotlib projects masked points too, whose values are not initialised.
        with atomic_file(path) as partial, np.errstate(over="ignore", invalid="ignore"):
            figure.savefig(partial, dpi=DOTS_PER_INCH)
        return path

    def figure(self, reading: Reading) -> "Figure":
        """The annotated camera image, and the surface next to it."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        seen = self._annotate(reading)[..., ::-1]
        wide = 0.86 * TALL_INCHES * seen.shape[1] / seen.shape[0]
        figure = Figure(figsize=(wide + SURFACE_INCHES, TALL_INCHES))
        FigureCanvasAgg(figure)
        share, inch = wide / (wide + SURFACE_INCHES), 1.0 / (wide + SURFACE_INCHES)
        left = figure.add_axes((0.1 * inch, 0.03, share, 0.86))
        left.imshow(seen, interpolation="lanczos")
        left.set_axis_off()
        left.set_title("camera image", fontsize=11)
        width = (SURFACE_INCHES - 1.9) * inch
        right = figure.add_axes((share + 0.3 * inch, 0.03, width, 0.86), projection="3d")
        scale = figure.add_axes((1.0 - 1.05 * inch, 0.2, 0.16 * inch, 0.5))
        self._draw_surface(figure, (right, scale), reading)
        frame = f"frame {reading.frame.index}, {reading.frame.timestamp_ns * 1e-9:.2f} s"
        figure.suptitle(f"{self._sensor.name}, {frame}", x=0.1 * inch, ha="left", fontsize=13, y=0.975)
        return figure

    def _draw_surface(self, figure: "Figure", places: tuple[Any, Any], reading: Reading) -> None:
        from matplotlib.colors import Normalize
        from matplotlib.ticker import MaxNLocator

        axes, scale = places
        unit = self._sensor.length_unit
        depth = self._grid.sampler.depth(reading.surface)
        x_mm, y_mm = np.meshgrid(self._grid.x_mm, self._grid.y_mm)
        shallowest, deepest = float(np.nanmin(depth, initial=0.0)), float(np.nanmax(depth, initial=0.0))
        top = max(deepest, 1e-3 * float(np.ptp(x_mm)))
        surface = axes.plot_surface(
            x_mm,
            y_mm,
            depth,
            cmap="cividis",
            norm=Normalize(shallowest, top),
            rcount=150,
            ccount=150,
            linewidth=0.0,
            antialiased=False,
        )
        self._draw_contacts(axes, reading.contacts.touching, top)
        stretch = self._shape(axes, x_mm, y_mm, (shallowest, top))
        axes.set_xlabel(f"x ({unit})")
        axes.set_ylabel(f"y ({unit})")
        axes.zaxis.set_major_locator(MaxNLocator(3))
        axes.set_zlabel(f"depth ({unit})")
        axes.set_title(f"depth, positive when pressed, magnified {stretch:.1f} times", fontsize=11)
        figure.colorbar(surface, cax=scale).set_label(f"depth ({unit})")

    def _shape(self, axes: Any, x_mm: np.ndarray, y_mm: np.ndarray, extent_mm: tuple[float, float]) -> float:
        """Set view and proportions, row 0 at the back as in the image; returns the magnification."""
        wide, long = float(np.ptp(x_mm)), float(np.ptp(y_mm))
        high = extent_mm[1] - extent_mm[0]
        axes.set_xlim(float(x_mm.min()), float(x_mm.max()))
        axes.set_ylim(float(y_mm.max()), float(y_mm.min()))
        axes.set_zlim(extent_mm[0], extent_mm[1])
        largest = max(wide, long)
        height = float(np.clip(MOST_STRETCH * high / largest, 0.2 * HEIGHT_TO_WIDTH, HEIGHT_TO_WIDTH))
        axes.set_box_aspect((wide / largest, long / largest, height), zoom=1.05)
        axes.view_init(elev=42, azim=-68)
        return height * largest / high

    def _draw_contacts(self, axes: Any, contacts: tuple[Contact, ...], top: float) -> None:
        for contact in contacts:
            x, y = contact.centre_mm
            depth = contact.depth_mm if np.isfinite(contact.depth_mm) else top
            head = depth + 0.3 * top
            axes.plot([x, x], [y, y], [depth, head], color=MARK, linewidth=1.6, zorder=20)
            axes.scatter([x], [y], [depth], color=MARK, edgecolors="white", zorder=21, depthshade=False)
            words = f"#{contact.id}  {self._annotate.depth_text(contact)}"
            label = axes.text(x, y, head, words, ha="center", va="bottom", fontsize=9, zorder=22)
            label.set_bbox({"facecolor": "white", "edgecolor": MARK, "alpha": 0.85, "pad": 1.5})


class SelectedFrames:
    """A sink that draws the surface at selected frames into `picture-000060.png`, ..."""

    def __init__(self, folder: Path, sensor: Sensor, frames: Collection[int]) -> None:
        """Select the frames.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        self._picture = SurfacePicture(sensor)
        self._folder, self._frames = folder, frozenset(frames)

    def write(self, reading: Reading) -> None:
        """Draw a frame if it was selected."""
        if reading.frame.index in self._frames and reading.frame.image is not None:
            self._picture.save(reading, self._folder / f"picture-{reading.frame.index:06d}.png")
            self._frames -= {reading.frame.index}

    def close(self) -> None:
        """Nothing to complete: every file is complete when it is written."""

    @property
    def missing(self) -> list[int]:
        """Selected frames that have not been drawn."""
        return sorted(self._frames)


class BusiestFrame:
    """A sink that keeps the frame with the most contacts, and of several such the deepest."""

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._rank = (-1, 0.0)
        self.reading: Reading | None = None

    def write(self, reading: Reading) -> None:
        """Compare a frame with the one kept."""
        touching = reading.contacts.touching
        depths = [contact.depth_mm for contact in touching if np.isfinite(contact.depth_mm)]
        rank = (len(touching), sum(depths))
        if rank > self._rank:
            self._rank, self.reading = rank, reading

    def close(self) -> None:
        """Nothing to complete: the frame is drawn on request."""

    def draw(self, path: Path) -> Path | None:
        """Draw the frame; None if there was none.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        return None if self.reading is None else SurfacePicture(self._sensor).save(self.reading, path)
