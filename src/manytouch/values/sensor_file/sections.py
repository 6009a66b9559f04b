"""Strict sections of TOML files, and a message that lists all mistakes of a file."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError

from manytouch.limits import LARGEST_NUMBER

Positive = Annotated[float, Field(ge=1 / LARGEST_NUMBER, le=LARGEST_NUMBER, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST_NUMBER, allow_inf_nan=False)]
Number = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER, allow_inf_nan=False)]
Count = Annotated[int, Field(gt=0, le=10**9)]
MAX_MISTAKES, MAX_CHARACTERS = 20, 180  # of a message, and of each mistake in it
ONE, SEVERAL = "<one>", "<several>"
ONE_OR_LIST = Discriminator(lambda value: SEVERAL if isinstance(value, list) else ONE)
"""Discriminates a number or a text from a list: only mistakes of the matching alternative are reported."""
One, Several = Tag(ONE), Tag(SEVERAL)


class Section(BaseModel):
    """A table of a file; unknown keys and other types are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


def all_mistakes(file: str, error: ValidationError) -> str:
    """One sentence that lists the mistakes of a file, such as "sensor file s.toml": all, or the first 20."""
    mistakes = []
    for item in error.errors():
        key = ".".join(str(part) for part in item["loc"] if not _is_inner(part))
        found = item["input"]
        match item["type"]:
            case "extra_forbidden":
                text = f"unknown key {key}"
            case "missing":
                text = f"{key} is missing"
            case "value_error":
                message = item["msg"].removeprefix("Value error, ")
                text = f"{key}: {message}" if key else message
            case _:
                shown = repr(found) if len(repr(found)) < 60 else f"{repr(found)[:57]}..."
                message = item["msg"].replace(" after validation", "")
                text = f"{key} = {shown}: {message[0].lower()}{message[1:]}"
        mistakes.append(text if len(text) <= MAX_CHARACTERS else f"{text[: MAX_CHARACTERS - 3]}...")
    mistakes = list(dict.fromkeys(mistakes))
    more = len(mistakes) - MAX_MISTAKES
    end = f"; and {more} more" if more > 0 else ""
    return f"{file} is wrong: " + "; ".join(mistakes[:MAX_MISTAKES]) + end


def _is_inner(part: Any) -> bool:
    """Whether this part of a location is internal to pydantic and not a key of the file."""
    return part in (ONE, SEVERAL) or str(part).startswith("function-")
