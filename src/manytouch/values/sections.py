"""What the TOML files of this package share: strict sections, and mistakes told all at once."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(gt=0)]


class Section(BaseModel):
    """A table of a file: no other keys, no other types."""

    model_config = ConfigDict(extra="forbid", strict=True)


def all_mistakes(file: str, error: ValidationError) -> str:
    """One sentence that names every mistake of a file ("sensor file s.toml")."""
    mistakes = []
    for item in error.errors():
        key = ".".join(str(part) for part in item["loc"] if not str(part).startswith("function-"))
        found = item["input"]
        match item["type"]:
            case "extra_forbidden":
                text = f"unknown key {key}"
            case "missing":
                text = f"{key} is missing"
            case "value_error":
                text = f"{key or 'file'}: {item['msg'].removeprefix('Value error, ')}"
            case _:
                shown = repr(found) if len(repr(found)) < 60 else f"{repr(found)[:57]}..."
                message = item["msg"]
                text = f"{key} = {shown}: {message[0].lower()}{message[1:]}"
        mistakes.append(text)
    return f"{file} is wrong: " + "; ".join(dict.fromkeys(mistakes))
