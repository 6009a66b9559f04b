"""What a designed sensor must satisfy, and the camera and printer that it is built with."""

import math
from dataclasses import dataclass, fields

from manytouch.design.materials import MATERIALS
from manytouch.errors import ManytouchError


class DesignError(ManytouchError):
    """No sensor satisfies the requirements; the message names the one that conflicts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Printer:
    """Limits of a printer.

    Attributes:
        nozzle_mm: width of a printed line.
        bed_mm: largest part along x, y and z.
    """

    nozzle_mm: float = 0.4
    bed_mm: tuple[float, float, float] = (220.0, 220.0, 250.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSpecification:
    """A camera, as specified in its data sheet.

    Attributes:
        width_px, height_px: of its image.
        hfov_deg: horizontal field of view.
        least_focus_mm: shortest distance at which it is in focus.
        fps: frames per second at that size.
    """

    width_px: int = 2560
    height_px: int = 1440
    hfov_deg: float = 63.7
    least_focus_mm: float = 100.0
    fps: float = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirements:
    """What the sensor must do.

    Attributes:
        area_mm: (x, y) that must be touchable.
        deepest_mm: deepest press that must be possible.
        force_N: smallest and largest normal force of a fingertip (1 cm²).
        separation_mm: two-point resolution: distance at which two equal contacts must be found as two.
        camera: below the sheet.
        printer: for its parts.
        marker_height_mm: height of the markers above the sheet; 0 prints them flush, in a second colour.
        material: name of a material of `MATERIALS`; None: any.
        thickness_mm: of the sheet; None: any of `THICKNESSES_MM`.
    """

    area_mm: tuple[float, float] = (100.0, 60.0)
    deepest_mm: float = 10.0
    force_N: tuple[float, float] = (0.1, 10.0)
    separation_mm: float = 8.0
    camera: CameraSpecification = CameraSpecification()
    printer: Printer = Printer()
    marker_height_mm: float = 0.0
    material: str | None = None
    thickness_mm: float | None = None

    def __post_init__(self) -> None:
        wrong = [
            f"{name} = {value}"
            for name, value in _numbers(self)
            if not math.isfinite(value) or value < 0 or (value == 0 and name != "marker_height_mm")
        ]
        if wrong:
            raise DesignError(
                f"these requirements are not positive numbers: {', '.join(wrong)}; give numbers above 0"
            )
        if self.force_N[0] >= self.force_N[1]:
            raise DesignError(
                f"the force range {self.force_N[0]:g} to {self.force_N[1]:g} N is empty: give the smaller "
                "force first"
            )
        if self.camera.hfov_deg >= 170:
            raise DesignError(
                f"a field of view of {self.camera.hfov_deg:g} degrees is too large for a pinhole model: give "
                "less than 170"
            )
        if self.material is not None and self.material not in [item.name for item in MATERIALS]:
            raise DesignError(
                f"the material {self.material!r} is not known; choose one of "
                f"{', '.join(repr(item.name) for item in MATERIALS)}"
            )


def _numbers(value: object, prefix: str = "") -> list[tuple[str, float]]:
    found: list[tuple[str, float]] = []
    for item in fields(value):  # type: ignore[arg-type]
        here = getattr(value, item.name)
        name = f"{prefix}{item.name}"
        if isinstance(here, int | float):
            found.append((name, float(here)))
        elif isinstance(here, tuple):
            found += [(f"{name}[{place}]", float(number)) for place, number in enumerate(here)]
        elif isinstance(here, Printer | CameraSpecification):
            found += _numbers(here, f"{item.name}.")
    return found
