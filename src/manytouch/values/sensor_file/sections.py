"""Strict sections of TOML files, and a message that lists all mistakes of a file."""

import difflib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from manytouch.limits import LARGEST_NUMBER

Positive = Annotated[float, Field(ge=1 / LARGEST_NUMBER, le=LARGEST_NUMBER, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST_NUMBER, allow_inf_nan=False)]
Number = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER, allow_inf_nan=False)]
Count = Annotated[int, Field(gt=0, le=10**9)]
MAX_MISTAKES, MAX_CHARACTERS = 20, 240  # of a message, and of each mistake in it
ONE, SEVERAL = "<one>", "<several>"
ONE_OR_LIST = Discriminator(lambda value: SEVERAL if isinstance(value, list) else ONE)
"""Discriminates a number or a text from a list: only mistakes of the matching alternative are reported."""
One, Several = Tag(ONE), Tag(SEVERAL)


class Section(BaseModel):
    """A table of a file; unknown keys and other types are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


class MistakesError(ValueError):
    """Several mistakes that one check has found."""

    def __init__(self, mistakes: Sequence[str]) -> None:
        super().__init__("; ".join(mistakes))
        self.mistakes = tuple(mistakes)


def all_mistakes(
    file: str, error: ValidationError, model: type[BaseModel] | None = None, further: Sequence[str] = ()
) -> str:
    """One sentence that lists the mistakes of a file: all, or the first 20.

    Args:
        file: in words, such as "sensor file s.toml".
        error: its mistakes.
        model: of the whole file, to name the keys that it has; None: they are not named.
        further: mistakes that are listed after these.
    """
    mistakes: list[str] = []
    explained: set[tuple[str, ...]] = set()
    for item in error.errors():
        place = _place(item)
        key, found = ".".join(place), item["input"]
        match item["type"]:
            case "extra_forbidden":
                texts = [f"unknown key {key}{_allowed(model, place, explained)}"]
            case "missing":
                texts = [f"{key} is missing{_expected(model, place)}"]
            case "value_error":
                reason = item["ctx"]["error"]
                whats = reason.mistakes if isinstance(reason, MistakesError) else [str(reason)]
                texts = [f"{key}: {what}" if key else what for what in whats]
            case _:
                shown = repr(found) if len(repr(found)) < 60 else f"{repr(found)[:57]}..."
                message = item["msg"].replace(" after validation", "")
                texts = [f"{key} = {shown}: {message[0].lower()}{message[1:]}"]
        mistakes += texts
    mistakes = [_cut(text) for text in dict.fromkeys([*mistakes, *further])]
    more = len(mistakes) - MAX_MISTAKES
    end = f"; and {more} more" if more > 0 else ""
    return f"{file} is wrong: " + "; ".join(mistakes[:MAX_MISTAKES]) + end


def without_unknown_keys(table: Mapping[str, Any], error: ValidationError) -> dict[str, Any]:
    """A copy of a table without those keys that are reported as unknown."""
    copied = deepcopy(dict(table))
    for item in error.errors():
        if item["type"] == "extra_forbidden":
            inner: Any = copied
            for part in item["loc"][:-1]:
                inner = inner[part]
            inner.pop(item["loc"][-1], None)
    return copied


def _cut(text: str) -> str:
    return text if len(text) <= MAX_CHARACTERS else f"{text[: MAX_CHARACTERS - 3]}..."


def _place(item: ErrorDetails) -> tuple[str, ...]:
    return tuple(str(part) for part in item["loc"] if not _is_inner(part))


def _allowed(model: type[BaseModel] | None, place: tuple[str, ...], explained: set[tuple[str, ...]]) -> str:
    """The key that was probably meant; else, once for each table, those that it has without deviations."""
    known = _fields(model, place[:-1])
    if close := difflib.get_close_matches(place[-1], known, n=1):
        return f", did you mean {close[0]}?"
    if not known or place[:-1] in explained:
        return ""
    explained.add(place[:-1])
    return f" (allowed are {', '.join(name for name in known if '_std' not in name)})"


def _expected(model: type[BaseModel] | None, place: tuple[str, ...]) -> str:
    """What to give for a key that is missing, as far as its type states that."""
    field = _fields(model, place[:-1]).get(place[-1])
    if field is None:
        return ""
    if field.examples:
        return f": give {field.examples[0]}"
    kind = get_origin(field.annotation) or field.annotation
    above = (
        " above 0" if any(getattr(each, "ge", 0) or hasattr(each, "gt") for each in field.metadata) else ""
    )
    words = {int: f"a whole number{above}", float: f"a number{above}", str: "a text"}
    words |= {list: "a list", tuple: "a list of numbers"}
    return f": give {words[kind]}" if kind in words else ""


def _fields(model: type[BaseModel] | None, path: Sequence[str]) -> dict[str, FieldInfo]:
    """Fields of the table at a path, by their names in the file; empty where the model is not known."""
    fields: dict[str, FieldInfo] = {}
    for part in (None, *path):
        if part is not None and not part.isdecimal():
            model = _model_of(fields[part].annotation) if part in fields else None
        if model is None:
            return {}
        fields = {field.alias or name: field for name, field in model.model_fields.items()}
    return fields


def _model_of(annotation: Any) -> type[BaseModel] | None:
    """The only model in a type, such as that in `list[Section] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = [model for each in get_args(annotation) if (model := _model_of(each)) is not None]
    return found[0] if len(found) == 1 else None


def _is_inner(part: Any) -> bool:
    """Whether this part of a location is internal to pydantic and not a key of the file."""
    return part in (ONE, SEVERAL) or str(part).startswith("function-")
