"""The parameters of a pipeline by name, to be given before a run and shown and changed during it.

Used by `pipeline_for`, and by `Live` and `Playback` for `Tune` commands of the viewer. A name is the stage
and the path of fields below it, such as "detect.least_share" or "estimate.contact_tracker.bridge_frames". How
surfaces are interpolated has the same names for every method: "interpolation.kind",
"interpolation.iterations", ...

Kinds of a parameter are the members of the union that is its type: of `float | None`, float and NoneType.
"""

import difflib
import math
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, Literal, get_args, get_origin

from manytouch.errors import ManytouchError, require_type
from manytouch.pipeline import Pipeline
from manytouch.values import Roi
from manytouch.values.arrays import plain

ParameterValue = int | float | str | None
"""A number, one of a few words, or None for a parameter that is determined automatically."""

_MOST_NEAR = 4  # names that are proposed for one that does not exist

_ESTIMATE, _INTERPOLATION = "estimate.", "interpolation."


def parameters_of(pipeline: Pipeline) -> dict[str, ParameterValue]:
    """Every number and choice of every stage, not flags and regions; None where determined automatically."""
    return {name: value for name, value, _ in _parameters(pipeline)}


def choices_of(pipeline: Pipeline) -> dict[str, tuple[str, ...]]:
    """The words to choose from, of the parameters that are a choice."""
    words = {name: _words(kinds) for name, _, kinds in _parameters(pipeline)}
    return {name: found for name, found in words.items() if found}


def with_parameter(pipeline: Pipeline, parameter: str, value: ParameterValue) -> Pipeline:
    """Replace a parameter of a pipeline.

    Raises:
        ManytouchError: there is no such parameter, or the value is invalid.
    """
    known = {name: kinds for name, _, kinds in _parameters(pipeline)}
    if parameter not in known:
        raise ManytouchError(_unknown_message(parameter, sorted(known)))
    found = _converted(parameter, value, known[parameter])
    belongs_to_estimator = parameter.startswith(_INTERPOLATION) and pipeline.interpolation is None
    path = (_ESTIMATE if belongs_to_estimator else "") + parameter
    changed: Pipeline = _changed(pipeline, path.split("."), found)
    return changed


def with_parameters(pipeline: Pipeline, parameters: Mapping[str, ParameterValue]) -> Pipeline:
    """Replace several parameters of a pipeline; see `with_parameter`."""
    for name, value in parameters.items():
        pipeline = with_parameter(pipeline, name, value)
    return pipeline


def _unknown_message(parameter: str, known: list[str]) -> str:
    """A sentence with the nearest names: by the whole name, or by its last part in any stage."""
    last = {name: name.rpartition(".")[2] for name in known}
    of_ends = difflib.get_close_matches(
        parameter.rpartition(".")[2], sorted(set(last.values())), n=_MOST_NEAR
    )
    ends = [name for end in of_ends for name in known if last[name] == end]
    near = dict.fromkeys([*difflib.get_close_matches(parameter, known, n=_MOST_NEAR), *ends])
    names = list(near)[:_MOST_NEAR]
    nearest = f"the nearest are {', '.join(names)}; " if names else ""
    return (
        f"there is no parameter {parameter!r}: {nearest}all {len(known)} are in the settings of the "
        "viewer and under parameters in summary.json of a result"
    )


def value_text(value: ParameterValue) -> str:
    """A value of a parameter as text."""
    if value is None:
        return "automatic"
    return value if isinstance(value, str) else f"{value:g}"


def _parameters(pipeline: Pipeline) -> Iterator[tuple[str, ParameterValue, tuple[Any, ...]]]:
    """Name, value and types of each parameter."""
    for stage in fields(pipeline):
        # the type of a stage itself does not matter: only what is below it can be a parameter
        for name, value, kinds in _fields(getattr(pipeline, stage.name), stage.name, (object,)):
            belongs_to_estimator = name.startswith(_ESTIMATE + _INTERPOLATION)
            yield name.removeprefix(_ESTIMATE) if belongs_to_estimator else name, value, kinds


def _fields(
    value: Any, path: str, kinds: tuple[Any, ...]
) -> Iterator[tuple[str, ParameterValue, tuple[Any, ...]]]:
    # a region is chosen as a whole, so that its four numbers are not parameters
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


def _converted(name: str, value: ParameterValue, kinds: tuple[Any, ...]) -> ParameterValue:
    """The value, as one of the types of a parameter."""
    value = plain(value)
    require_type(name, value, (int, float, str, types.NoneType), "a number, a word, or None")
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


def _changed(owner: Any, path: list[str], value: ParameterValue) -> Any:
    name, *rest = path
    return replace(owner, **{name: _changed(getattr(owner, name), rest, value) if rest else value})
