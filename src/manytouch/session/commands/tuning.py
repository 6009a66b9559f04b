"""The numeric parameters of a pipeline by name, to be shown and changed while it runs."""

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any

from manytouch.errors import ManytouchError
from manytouch.pipeline import Pipeline
from manytouch.values import Roi


def parameters_of(pipeline: Pipeline) -> dict[str, int | float]:
    """Every number of every stage, such as "estimate.identity.gate_pitch"."""
    return {name: value for stage in fields(pipeline) for name, value in _numbers(pipeline, stage.name)}


def tune(pipeline: Pipeline, parameter: str, value: float) -> Pipeline:
    """Replace a parameter of a pipeline.

    Raises:
        ManytouchError: there is no such parameter, or the value is invalid.
    """
    known = parameters_of(pipeline)
    if parameter not in known:
        raise ManytouchError(f"there is no parameter {parameter!r}; there are: {', '.join(sorted(known))}")
    if not math.isfinite(value):
        raise ManytouchError(f"{parameter} must be a finite number, not {value}")
    if isinstance(known[parameter], int):
        if value != int(value):
            raise ManytouchError(f"{parameter} must be a whole number, not {value:g}")
        value = int(value)
    changed: Pipeline = _changed(pipeline, parameter.split("."), value)
    return changed


def _numbers(owner: Any, name: str, above: str = "") -> Iterator[tuple[str, int | float]]:
    value, path = getattr(owner, name), f"{above}{name}"
    if is_dataclass(value) and not isinstance(value, Roi):
        for field in fields(value):
            if field.init:
                yield from _numbers(value, field.name, f"{path}.")
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, value


def _changed(owner: Any, path: list[str], value: float) -> Any:
    name, *rest = path
    return replace(owner, **{name: _changed(getattr(owner, name), rest, value) if rest else value})
