"""Checks of values that come from a recording, before anything is computed with them."""

import types
import typing
from collections.abc import Hashable, Mapping
from dataclasses import is_dataclass
from functools import cache
from typing import Any, Literal, get_args, get_origin

import numpy as np
from jaxtyping import jaxtyped

from manytouch.errors import SourceError
from manytouch.geometry.sheet_face import patch_of
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.limits import LARGEST_NUMBER, MAX_MARKERS, size_mistake
from manytouch.values import Contacts, Detections, Layout, Reading, Sensor, SheetSpline, Surface, TrackedGrid

LEAST_ELEMENTS, MAX_ELEMENTS = 4, 1000
MAX_END_SHARE = 100.0


def require_sensor(sensor: Any) -> Sensor:
    """The value, if it is a sensor that can be used.

    Raises:
        SourceError: a field has a wrong type, shape or value.
    """
    if not isinstance(sensor, Sensor):
        raise SourceError("the recording contains no sensor: it is damaged")
    _require_fields(sensor)
    camera, layout, sheet = sensor.camera, sensor.layout, sensor.sheet
    lengths = [camera.fx_px, camera.fy_px]
    numbers: list[Any] = [camera.distortion, camera.rotation_vector, camera.translation_mm]
    numbers += [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px]
    _require(min(camera.width_px, camera.height_px) > 0, "camera size")
    _require(size_mistake(camera.width_px, camera.height_px) is None, "camera size")
    _require(camera.distortion.size == (4 if camera.model == "fisheye" else 5), "camera.distortion")
    if layout is not None:
        _require_layout(layout)
        lengths += [*layout.pitch_mm, *layout.radius_mm]
        numbers += [layout.rest_mm, layout.height_mm]
    if sheet is not None:
        lengths += [*sheet.size_mm, sheet.thickness_mm]
    is_length = [not (each <= 0 or each >= LARGEST_NUMBER) for each in lengths]  # NaN: no neighbour
    _require(all(is_length), "a length")
    is_number = [bool((np.abs(each) < LARGEST_NUMBER).all()) for each in numbers]
    _require(all(is_number), "a number of camera or layout")
    return sensor


def require_reading(reading: Any, layout: Layout | None) -> Reading:
    """The value, if it is a reading of a sensor with this layout.

    Raises:
        SourceError: a field has a wrong type, shape or value.
    """
    kinds = {"detections": Detections, "grid": TrackedGrid, "surface": Surface, "contacts": Contacts}
    for name, kind in kinds.items():
        _require(isinstance(getattr(reading, name), kind), name)
        _require_fields(getattr(reading, name))
    markers = len(reading.grid.is_seen)
    _require(len(reading.surface.position_mm) == markers, "surface")
    _require(layout is None or len(layout.rest_mm) == markers, "grid")
    _require(np.isfinite(reading.milliseconds), "milliseconds")
    if reading.surface.spline is not None:
        _require_spline(reading.surface.spline)
    return typing.cast(Reading, reading)


def _require_layout(layout: Layout) -> None:
    markers = len(layout.rest_mm)
    _require(0 < markers <= MAX_MARKERS, "layout.rest_mm")
    if layout.row_column is not None:
        columns = int(layout.row_column[:, 1].max()) + 1
        place = np.stack(np.divmod(np.arange(markers), max(columns, 1)), axis=1)
        _require(np.array_equal(layout.row_column, place), "layout.row_column")


def _require_spline(spline: SheetSpline) -> None:
    columns, rows = spline.elements
    is_count = [LEAST_ELEMENTS <= each <= MAX_ELEMENTS for each in (columns, rows)]
    _require(all(is_count), "surface.spline.elements")
    lengths = (*spline.size_mm, spline.thickness_mm)
    _require(all(0 < each < LARGEST_NUMBER for each in lengths), "surface.spline")
    most = (spline.thickness_mm**power for power in (1, 2, 3))
    is_end = [abs(each) <= limit for each, limit in zip(spline.clamped_end, most, strict=True)]
    patch = patch_of(spline)
    _require(all(is_end) and _is_held(patch), "surface.spline.clamped_end")
    _require(len(spline.coefficient_mm) == patch.node_count, "surface.spline.coefficient_mm")


def _is_held(patch: SplinePatch) -> bool:
    """Whether the conditions on the outline determine the outermost coefficients."""
    try:
        shares = [patch.end_shares(axis) for axis in (0, 1)]
    except (np.linalg.LinAlgError, ValueError):
        return False
    return bool((np.abs(shares) <= MAX_END_SHARE).all())


def _require(is_valid: bool | np.bool_, what: str) -> None:
    if not is_valid:
        raise SourceError(f"a recorded value is impossible ({what}): the recording is damaged")


def _require_fields(value: Any) -> None:
    """Check types and shapes of the fields of a dataclass, and of those inside."""
    with jaxtyped("context"):  # one size per name of a dimension
        for name, annotation in _annotations(typing.cast(Hashable, type(value))).items():
            _require(_conforms(getattr(value, name), annotation), f"{type(value).__name__}.{name}")
    for name in _annotations(typing.cast(Hashable, type(value))):
        member = getattr(value, name)
        for each in member if isinstance(member, tuple) else (member,):
            if is_dataclass(each) and not isinstance(each, type):
                _require_fields(each)


@cache
def _annotations(kind: Any) -> dict[str, Any]:
    return typing.get_type_hints(kind)


def _conforms(value: Any, annotation: Any) -> bool:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in (typing.Union, types.UnionType):
        return any(_conforms(value, each) for each in arguments)
    if origin is Literal:
        return isinstance(value, str) and value in arguments
    if origin is tuple:
        return isinstance(value, tuple) and _members_conform(value, arguments)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return isinstance(value, Mapping)
    if annotation in (float, int):
        return isinstance(value, int if annotation is int else int | float) and not isinstance(value, bool)
    return isinstance(value, annotation)


def _members_conform(members: tuple[Any, ...], annotations: tuple[Any, ...]) -> bool:
    kinds = annotations[:1] * len(members) if annotations[-1] is Ellipsis else annotations
    return len(members) == len(kinds) and all(map(_conforms, members, kinds))
