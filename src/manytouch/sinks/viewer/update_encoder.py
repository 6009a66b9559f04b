"""Encodes readings as the messages that every client receives (`update_format`).

The head of an update has these keys; numbers that are not known are null.

    kind              "reading"
    number            of the update, which a client acknowledges when it receives it
    frame, time_s     of the reading
    status, remedy    its status, and what to do about it
    is_qualitative    whether depths and forces have no scale, because the sheet is not known
    is_without_sheet  whether a valid frame was estimated without the mechanics of a known sheet
    total             load of all contacts (`derived.total_load`), or null
    milliseconds      computing time of the reading
    contacts          of those that touch: the keys of `_contact`, and `row`: the numbers of every column of
                      contacts.csv, in the order of `recent_contacts.COLUMNS` (the message `recent` has it)
    comparison        null, or `name` and `contacts` of the truth or of a recording: the keys of `_contact`
    image_quality     null, or `focus`, `level` and `clipped` (`image_quality.ImageQuality`)
    pretension        null, or the estimated one (`sensor_description.estimated_pretension`)
    residual_mm       median depth while nothing touches (`image_quality.residual_mm`)
    layers            that can be requested
    latency_ms        from the arrival of the frame until now; null where it has no arrival time
    arrived_ns        of the frame, by the monotonic clock of this machine; null where it has none
    parts             the parts that follow the head

The parts are `depth` (rows, columns) and the requested layer, on the grid of `scene_info`; `markers` (m, 2)
in pixels; `support`, if some markers are not seen: 1 where one is near; `image`, a JPEG, if it is shown.
"""

import time
from collections.abc import Set
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from manytouch.geometry.surface_sampling import sampler_on
from manytouch.sinks.contact_outlines import Polygon, outlines_px
from manytouch.sinks.display_grid import DisplayGrid, grid_corners
from manytouch.sinks.files.sensor_description import estimated_pretension, layout_of, rest_px
from manytouch.sinks.viewer.derived import marker_support, total_load
from manytouch.sinks.viewer.image_quality import ImageQuality, residual_mm
from manytouch.sinks.viewer.recent_contacts import row_of
from manytouch.sinks.viewer.update_format import number, pack
from manytouch.values import (
    ESTIMATES,
    Comparison,
    Contact,
    Contacts,
    Layout,
    Reading,
    Sensor,
    Status,
    Surface,
)
from manytouch.values.images.grey_levels import least_scale, to_8_bits

LONG_SIDE_POINTS = 100
"""Points of the displayed grid along the longer side of the sheet."""
MIN_SHORT_SIDE_POINTS, MAX_SHORT_SIDE_POINTS = 16, 60
"""Points along the shorter side."""
IMAGE_PX, JPEG_QUALITY = 960, 78
MAX_JPEG_BYTES = 200_000
"""Longest JPEG of a camera that is passed on unchanged."""
JPEG_START = b"\xff\xd8"
"""First bytes of a JPEG."""
_CENTRE = [ESTIMATES.index("x"), ESTIMATES.index("y")]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ViewerUpdate:
    """The content of one update.

    Attributes:
        reading: to be shown.
        comparison: shown next to it; None if there is none.
        layers: that the clients display.
        is_image_wanted: whether a client displays the camera image.
    """

    reading: Reading
    comparison: Comparison | None
    layers: Set[str]
    is_image_wanted: bool


class UpdateEncoder:
    """Encodes readings of one sensor, with surfaces on one even grid."""

    def __init__(self, sensor: Sensor) -> None:
        layout = layout_of(sensor)
        self.sensor, self.layout = sensor, layout
        self._grid = viewer_grid(layout)
        self._rest_px = rest_px(sensor)
        self._support = marker_support(layout, self._grid)
        self._image_quality = ImageQuality()
        self._scale: float | None = None

    def scene_info(self) -> dict[str, Any]:
        """What does not change between updates: the sensor, the grid, the markers at rest."""
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
            "has_newtons": sheet is not None and sheet.young_MPa is not None and self.sensor.scale_is_known,
            "assumptions": list(self.sensor.assumptions),
        }

    def __call__(self, update: ViewerUpdate, update_number: int) -> tuple[bytes, float | None]:
        """Encode an update.

        Returns:
            The message, and ms from the arrival of the frame until now (None for files).
        """
        depth = self._grid.sampler.depth(update.reading.surface)
        head, parts = self._head(update, update_number), self._parts(update, depth)
        arrived_ns = update.reading.frame.arrived_ns
        latency_ms = None if arrived_ns is None else (time.monotonic_ns() - arrived_ns) * 1e-6
        head["latency_ms"], head["arrived_ns"] = number(latency_ms, 2), arrived_ns
        return pack(head, parts), latency_ms

    def _head(self, update: ViewerUpdate, update_number: int) -> dict[str, Any]:
        reading, comparison = update.reading, update.comparison
        spline, image = reading.surface.spline, reading.frame.image
        has_pressure = spline is not None and spline.young_MPa is not None
        has_other = comparison is not None and comparison.surface is not None
        return {
            "kind": "reading",
            "number": update_number,
            "frame": reading.frame.index,
            "time_s": number(reading.frame.timestamp_ns * 1e-9),
            "status": reading.status,
            "remedy": reading.status.remedy,
            "is_qualitative": spline is None and (self.sensor.sheet is None or self.sensor.sheet.is_assumed),
            "is_without_sheet": spline is None
            and self.sensor.sheet is not None
            and reading.status is Status.OK,
            "total": total_load(reading.contacts.touching),
            "milliseconds": number(reading.milliseconds, 2),
            "contacts": [
                {**shown, "row": row_of(reading.frame, contact)}
                for shown, contact in zip(
                    self._contacts(reading.contacts, reading.surface), reading.contacts.touching, strict=True
                )
            ],
            "comparison": None
            if comparison is None
            else {
                "name": comparison.name,
                "contacts": self._contacts(comparison.contacts, comparison.surface or reading.surface),
            },
            "image_quality": None if image is None else _rounded(self._image_quality.latest(image)),
            "pretension": _numbers(estimated_pretension(self.sensor, spline)),
            "residual_mm": number(residual_mm(reading)),
            "layers": ["depth", "strain", *has_pressure * ["pressure"], *has_other * ["difference"]],
        }

    def _contacts(self, contacts: Contacts, surface: Surface) -> list[dict[str, Any]]:
        """The contacts that are not over yet, as plain numbers; None where not known."""
        shown_px = outlines_px(self.sensor, surface, contacts.touching)
        return [_contact(contact, shown_px.get(contact.id)) for contact in contacts.touching]

    def _parts(self, update: ViewerUpdate, depth: np.ndarray) -> dict[str, np.ndarray | bytes]:
        reading, image = update.reading, update.reading.frame.image
        parts: dict[str, np.ndarray | bytes] = {
            "depth": depth.astype("<f4"),
            "markers": reading.grid.position_px.astype("<f4"),
        }
        support = self._support(reading.grid.is_seen)
        if not support.all():
            parts["support"] = support.astype(np.uint8)
        for layer in sorted(update.layers & {"strain", "pressure", "difference"}):
            values = self._layer(layer, reading.surface, update.comparison, depth)
            if values is not None:
                parts[layer] = values.astype("<f4")
        if update.is_image_wanted and image is not None:
            parts["image"] = self._jpeg(image, reading.frame.encoded)
        return parts

    def _jpeg(self, image: np.ndarray, encoded: bytes | None) -> bytes:
        """The image as the camera encoded it, if that is a JPEG and not too long, else encoded here."""
        if encoded is not None and len(encoded) <= MAX_JPEG_BYTES and encoded.startswith(JPEG_START):
            return encoded
        self._scale = least_scale(self._scale, image)
        return encode_jpeg(to_8_bits(image, self._scale))

    def _layer(
        self, layer: str, surface: Surface, comparison: Comparison | None, depth: np.ndarray
    ) -> np.ndarray | None:
        if layer == "strain":
            return self._grid.sampler.strain(surface)
        if layer == "pressure" and surface.spline is not None:
            return self._grid.sampler.pressure_kPa(surface)
        if layer == "difference" and comparison is not None and comparison.surface is not None:
            return np.asarray(depth - self._grid.sampler.depth(comparison.surface))
        return None


def viewer_grid(layout: Layout) -> DisplayGrid:
    """A grid over the markers and half a pitch beyond, 100 x 60 points on a sheet of 5 : 3."""
    low, high = grid_corners(layout)
    side = high - low
    count = np.clip(
        np.round(LONG_SIDE_POINTS * side / side.max()), MIN_SHORT_SIDE_POINTS, MAX_SHORT_SIDE_POINTS
    ).astype(int)
    count[int(np.argmax(side))] = LONG_SIDE_POINTS
    x_mm, y_mm = (np.linspace(low[axis], high[axis], count[axis]) for axis in (0, 1))
    return DisplayGrid(x_mm=x_mm, y_mm=y_mm, sampler=sampler_on(layout, x_mm, y_mm))


def encode_jpeg(image: np.ndarray) -> bytes:
    """Encode an image of 8 bits, reduced to the size of a pane."""
    height, width = image.shape[:2]
    if width > IMAGE_PX:
        size, whole = (IMAGE_PX, round(IMAGE_PX * height / width)), width // IMAGE_PX
        if whole > 1:  # by means of whole blocks, which takes a fifth of the time of other means
            image = cv2.resize(image, (width // whole, height // whole), interpolation=cv2.INTER_AREA)
        image = cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
    _, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes()


def _contact(contact: Contact, outline_px: list[Polygon] | None) -> dict[str, Any]:
    x, y = contact.centre_mm
    spread = contact.covariance[np.ix_(_CENTRE, _CENTRE)]
    shear_x, shear_y, force_z = contact.force_N
    return {
        "id": contact.id,
        "x_mm": number(x),
        "y_mm": number(y),
        "px": [number(value, 2) for value in contact.centre_px],
        "centre_covariance_mm2": [number(spread[0, 0], 6), number(spread[0, 1], 6), number(spread[1, 1], 6)],
        "depth_mm": number(contact.depth_mm),
        "depth_std_mm": number(contact.std("depth")),
        "force_N": number(-force_z),
        "force_std_N": number(contact.std("normal_force")),
        "shear_N": [number(shear_x), number(shear_y)],
        "torque_Nmm": number(contact.torque_Nmm),
        "slip": contact.slip,
        "area_mm2": number(contact.area_mm2, 2),
        "half_axes_mm": [number(contact.half_major_mm), number(contact.half_minor_mm)],
        "orientation_rad": number(contact.orientation_rad),
        "shape": None if contact.shape is None else contact.shape.value,
        "shape_probability": number(contact.shape_probability, 3),
        "outline_mm": None
        if contact.outline is None
        else [np.round(ring.point_mm, 3).tolist() for ring in contact.outline],
        "outline_px": None if outline_px is None else [np.round(ring, 2).tolist() for ring in outline_px],
    }


def _numbers(found: dict[str, float | None] | None) -> dict[str, float | None] | None:
    return None if found is None else {name: number(value, 6) for name, value in found.items()}


def _rounded(numbers: dict[str, float]) -> dict[str, float | None]:
    return {name: number(value) for name, value in numbers.items()}
