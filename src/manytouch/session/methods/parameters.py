"""The parameters of a pipeline by name, to be given before a run and shown and changed during it.

A name is the stage and the field, such as "detect.least_share". How surfaces are interpolated has the same
names for every method: "interpolation.kind", "interpolation.iterations", ...
"""

import math
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, Literal, get_args, get_origin

from manytouch.errors import ManytouchError
from manytouch.pipeline import Pipeline
from manytouch.values import Roi

Value = int | float | str | None
"""A number, one of a few words, or None for a parameter that is determined automatically."""

_ESTIMATE, _INTERPOLATION = "estimate.", "interpolation."


def parameters_of(pipeline: Pipeline) -> dict[str, Value]:
    """Every number and choice of every stage; None where it is determined automatically."""
    return {name: value for name, value, _ in _parameters(pipeline)}


def choices_of(pipeline: Pipeline) -> dict[str, tuple[str, ...]]:
    """The words to choose from, of the parameters that are a choice."""
    words = {name: _words(kinds) for name, _, kinds in _parameters(pipeline)}
    return {name: found for name, found in words.items() if found}


def tune(pipeline: Pipeline, parameter: str, value: Value) -> Pipeline:
    """Replace a parameter of a pipeline.

    Raises:
        ManytouchError: there is no such parameter, or the value is invalid.
    """
    known = {name: kinds for name, _, kinds in _parameters(pipeline)}
    if parameter not in known:
        raise ManytouchError(f"there is no parameter {parameter!r}; there are: {', '.join(sorted(known))}")
    found = _converted(parameter, value, known[parameter])
    is_estimator_s = parameter.startswith(_INTERPOLATION) and pipeline.interpolation is None
    path = (_ESTIMATE if is_estimator_s else "") + parameter
    changed: Pipeline = _changed(pipeline, path.split("."), found)
    return changed


def with_parameters(pipeline: Pipeline, parameters: Mapping[str, Value]) -> Pipeline:
    """Replace several parameters of a pipeline; see `tune`."""
    for name, value in parameters.items():
        pipeline = tune(pipeline, name, value)
    return pipeline


def _parameters(pipeline: Pipeline) -> Iterator[tuple[str, Value, tuple[Any, ...]]]:
    """Name, value and types of each parameter."""
    for stage in fields(pipeline):
        for name, value, kinds in _fields(getattr(pipeline, stage.name), stage.name, (object,)):
            is_estimator_s = name.startswith(_ESTIMATE + _INTERPOLATION)
            yield name.removeprefix(_ESTIMATE) if is_estimator_s else name, value, kinds


def _fields(value: Any, path: str, kinds: tuple[Any, ...]) -> Iterator[tuple[str, Value, tuple[Any, ...]]]:
    if is_dataclass(value) and not isinstance(value, Roi):
        annotations = typing.get_type_hints(type(value))
        for field in fields(value):
            if field.init:
                kind = annotations[field.name]
                found = get_args(kind) if get_origin(kind) in (typing.Union, types.UnionType) else (kind,)
                yield from _fields(getattr(value, field.name), f"{path}.{field.name}", found)
    elif (int in kinds or float in kinds or _words(kinds)) and not isinstance(value, bool):
        yield path, value, kinds


def _words(kinds: tuple[Any, ...]) -> tuple[str, ...]:
    return tuple(word for kind in kinds if get_origin(kind) is Literal for word in get_args(kind))


def _converted(name: str, value: Value, kinds: tuple[Any, ...]) -> Value:
    """The value, as one of the types of a parameter."""
    words, is_number = _words(kinds), int in kinds or float in kinds
    if value is None and type(None) in kinds:
        return None
    if isinstance(value, str) or not is_number:
        if value in words:
            return value
        expected = " or ".join(words) if words else "a number"
        raise ManytouchError(f"{name} must be {expected}, not {value}")
    if value is None or not math.isfinite(value):
        automatic = ", or left automatic" if type(None) in kinds else ""
        raise ManytouchError(f"{name} must be a finite number{automatic}, not {value}")
    if float in kinds:
        return value
    if value != int(value):
        raise ManytouchError(f"{name} must be a whole number, not {value:g}")
    return int(value)


def _changed(owner: Any, path: list[str], value: Value) -> Any:
    name, *rest = path
    return replace(owner, **{name: _changed(getattr(owner, name), rest, value) if rest else value})
