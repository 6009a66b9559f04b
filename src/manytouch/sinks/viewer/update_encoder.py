"""A reading as the message that every browser gets."""

import time
from collections.abc import Set
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from manytouch.geometry.surface_sampling import sampler_on
from manytouch.sinks.files.sensor_description import layout_of, rest_px
from manytouch.sinks.surface_grid import SurfaceGrid, grid_corners
from manytouch.sinks.viewer.health import PictureHealth, residual_mm
from manytouch.sinks.viewer.messages import number, pack
from manytouch.values import ESTIMATES, Comparison, Contact, Contacts, Layout, Reading, Sensor, Surface

LONGEST, SHORTEST_OF_LONG = 100, 60  # points of the grid along the longer side, and at most along the shorter
FEWEST = 16
PICTURE_PX, JPEG_QUALITY = 960, 78
LARGEST_JPEG, JPEG_START = 200_000, b"\xff\xd8"  # bytes of a camera's own picture that is sent on as it is
_OF_PLACE = [ESTIMATES.index("x"), ESTIMATES.index("y")]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Shot:
    """What a moment's message is made of: the reading, what it is shown beside, and who looks at what."""

    reading: Reading
    beside: Comparison | None
    layers: Set[str]
    is_image_wanted: bool


class UpdateEncoder:
    """Turns readings of one sensor into messages, on one even grid of points."""

    def __init__(self, sensor: Sensor) -> None:
        layout = layout_of(sensor)
        self.sensor, self.layout = sensor, layout
        self._grid = viewer_grid(layout)
        self._rest_px = rest_px(sensor)
        self._picture = PictureHealth()

    def scenery(self) -> dict[str, Any]:
        """What a browser must know once: the sensor, the grid, the markers at rest."""
        camera, sheet = self.sensor.camera, self.sensor.sheet
        return {
            "sensor": self.sensor.name,
            "unit": self.sensor.length_unit,
            "x_mm": [number(value) for value in self._grid.x_mm],
            "y_mm": [number(value) for value in self._grid.y_mm],
            "image_px": [camera.width_px, camera.height_px],
            "rest_px": [[number(x, 2), number(y, 2)] for x, y in self._rest_px],
            "rest_mm": [[number(x), number(y)] for x, y, _ in self.layout.rest_mm],
            "size_mm": None if sheet is None else [float(side) for side in sheet.size_mm],
            "assumptions": list(self.sensor.assumptions),
        }

    def __call__(self, shot: Shot, number_of_update: int) -> tuple[bytes, float | None]:
        """The message of a shot, and ms from the frame's arrival to it (None for files)."""
        reading, beside = shot.reading, shot.beside
        surface, picture = reading.surface, reading.frame.image
        depth = self._grid.sampler.depth(surface)
        head: dict[str, Any] = {
            "kind": "reading",
            "number": number_of_update,
            "frame": reading.frame.index,
            "time_s": number(reading.frame.timestamp_ns * 1e-9),
            "status": reading.status,
            "milliseconds": number(reading.milliseconds, 2),
            "contacts": contacts_in_numbers(reading.contacts),
            "beside": None
            if beside is None
            else {"name": beside.name, "contacts": contacts_in_numbers(beside.contacts)},
            "picture": None if picture is None else _rounded(self._picture(picture)),
            "residual_mm": number(residual_mm(reading)),
        }
        parts: dict[str, np.ndarray | bytes] = {
            "depth": depth.astype("<f4"),
            "markers": reading.grid.position_px.astype("<f4"),
        }
        for layer in sorted(shot.layers & {"strain", "pressure", "difference"}):
            values = self._layer(layer, surface, beside, depth)
            if values is not None:
                parts[layer] = values.astype("<f4")
        if shot.is_image_wanted and picture is not None:
            encoded = reading.frame.encoded
            is_fit = encoded is not None and len(encoded) <= LARGEST_JPEG and encoded.startswith(JPEG_START)
            parts["image"] = encoded if encoded is not None and is_fit else jpeg(picture)
        spline = surface.spline
        has_pressure = spline is not None and spline.young_MPa is not None
        has_other = beside is not None and beside.surface is not None
        head["layers"] = ["depth", "strain", *has_pressure * ["pressure"], *has_other * ["difference"]]
        arrived_ns = reading.frame.arrived_ns
        latency_ms = None if arrived_ns is None else (time.monotonic_ns() - arrived_ns) * 1e-6
        head["latency_ms"], head["arrived_ns"] = number(latency_ms, 2), arrived_ns
        return pack(head, parts), latency_ms

    def _layer(
        self, layer: str, surface: Surface, beside: Comparison | None, depth: np.ndarray
    ) -> np.ndarray | None:
        if layer == "strain":
            return self._grid.sampler.strain(surface)
        if layer == "pressure":
            return self._grid.sampler.pressure_kPa(surface)
        if layer == "difference" and beside is not None and beside.surface is not None:
            return np.asarray(depth - self._grid.sampler.depth(beside.surface))
        return None


def viewer_grid(layout: Layout) -> SurfaceGrid:
    """A grid over the markers and half a pitch beyond, 100 x 60 points on a sheet of 5 : 3."""
    low, high = grid_corners(layout)
    side = high - low
    count = np.clip(np.round(LONGEST * side / side.max()), FEWEST, SHORTEST_OF_LONG).astype(int)
    count[int(np.argmax(side))] = LONGEST
    x_mm, y_mm = (np.linspace(low[axis], high[axis], count[axis]) for axis in (0, 1))
    return SurfaceGrid(x_mm=x_mm, y_mm=y_mm, sampler=sampler_on(layout, x_mm, y_mm))


def jpeg(picture: np.ndarray) -> bytes:
    """A picture made small enough for a pane."""
    height, width = picture.shape[:2]
    if picture.dtype != np.uint8:
        picture = (picture >> 8).astype(np.uint8)
    if width > PICTURE_PX:
        size = (PICTURE_PX, round(PICTURE_PX * height / width))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes()


def contacts_in_numbers(contacts: Contacts) -> list[dict[str, Any]]:
    """The contacts that touch, as plain numbers; None where not known."""
    return [_contact(contact) for contact in contacts.touching]


def _contact(contact: Contact) -> dict[str, Any]:
    x, y = contact.centre_mm
    spread = contact.covariance[np.ix_(_OF_PLACE, _OF_PLACE)]
    shear_x, shear_y, force_z = contact.force_N
    return {
        "id": contact.id,
        "x_mm": number(x),
        "y_mm": number(y),
        "px": [number(value, 2) for value in contact.centre_px],
        "place_mm2": [number(spread[0, 0], 6), number(spread[0, 1], 6), number(spread[1, 1], 6)],
        "depth_mm": number(contact.depth_mm),
        "depth_std_mm": number(contact.std("depth")),
        "force_N": number(-force_z),
        "force_std_N": number(contact.std("normal_force")),
        "shear_N": [number(shear_x), number(shear_y)],
        "area_mm2": number(contact.area_mm2, 2),
    }


def _rounded(numbers: dict[str, float]) -> dict[str, float | None]:
    return {name: number(value) for name, value in numbers.items()}
