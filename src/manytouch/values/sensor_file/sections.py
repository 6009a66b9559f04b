"""Strict sections of TOML files, and a message that lists all mistakes of a file."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(gt=0)]
ONE, SEVERAL = "<one>", "<several>"
IsList = Discriminator(lambda value: SEVERAL if isinstance(value, list) else ONE)
"""Discriminates a number from a list, so that only the mistakes of the matching alternative are reported."""
One, Several = Tag(ONE), Tag(SEVERAL)


class Section(BaseModel):
    """A table of a file; unknown keys and other types are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


def all_mistakes(file: str, error: ValidationError) -> str:
    """One sentence that lists every mistake of a file, such as "sensor file s.toml"."""
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
        mistakes.append(text)
    return f"{file} is wrong: " + "; ".join(dict.fromkeys(mistakes))


def _is_inner(part: Any) -> bool:
    """Whether this part of a location is internal to pydantic and not a key of the file."""
    return part in (ONE, SEVERAL) or str(part).startswith("function-")
