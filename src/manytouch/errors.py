"""All errors that manytouch raises.

Trouble with a single frame is not an error: it is the `status` of its reading. An error means a wrong file,
a wrong sensor, a missing device or a missing package; its message states what was given, what was expected
and what to do.

    ManytouchError
    ├── SourceError        a video, image, folder or device cannot be opened or read
    ├── SensorError        a sensor file is wrong, or does not match the recording
    ├── LayoutError        no dots, or no usable arrangement of dots, were found
    ├── OutputError        results cannot be written to the requested place
    ├── ContactError       a contact cannot be simulated on the sheet
    ├── ArgumentError      an argument of a function has a wrong type; also a TypeError
    └── MissingExtraError  an optional package that the request needs is not installed
"""

import re

_USER = re.compile(r"(?<=://)[^/?#\n]*@")
_UNCODED_USER = re.compile(r"(?<=://)[^\s/?#:@\[\]]*:(?!\d*(?:[/?#,\s'\"]|$))\S*@")
"""User and password with a /, ? or # that is not written as %2F, %3F or %23: no port follows the colon."""
_ADDRESS = re.compile(r"(?<=://)\S+")
_SECRET = re.compile(
    r"(?i)((?<![a-z0-9])(?:pass|passwd|password|passphrase|pwd|psw|pw|pin|loginpas|token|secret|sig|signature|"
    r"key|apikey|auth|credential)=)(?!&|$)(?:(?!&|#|_[a-z]+=|,\w+://|['\"]).)+"
)
"""A parameter of an address, by names that network cameras and stores of objects use; its value ends before
the next one, which some cameras separate by _, or the next address."""


class ManytouchError(Exception):
    """Base of all errors that users can cause and correct; the message is one sentence."""


class SourceError(ManytouchError):
    """A source of frames cannot be opened or read."""


class SensorError(ManytouchError):
    """A sensor file is wrong, or the sensor does not match the frames."""


class LayoutError(ManytouchError):
    """No dots, or no usable arrangement of dots, were found."""


class OutputError(ManytouchError):
    """Results cannot be written to the requested place."""


class ContactError(ManytouchError):
    """A contact cannot be simulated on the sheet."""


class MissingExtraError(ManytouchError):
    """A package is not installed; the message names the extra that contains it, None: no extra."""

    def __init__(self, purpose: str, package: str, extra: str | None = None) -> None:
        requirement = "manytouch" if extra is None else f"'manytouch[{extra}]'"
        super().__init__(
            f"{purpose} requires the package {package}, which is not installed: run pip install {requirement}"
        )


class ArgumentError(ManytouchError, TypeError):
    """An argument of a function has a type that the function does not take."""


def require_type(what: str, value: object, types: type | tuple[type, ...], expected: str) -> None:
    """Check the type of an argument.

    Args:
        what: the argument in words, such as "the sensor".
        value: the argument.
        types: that are accepted.
        expected: what to give instead, such as "a Sensor (manytouch.load_sensor reads one)".

    Raises:
        ArgumentError: the value has another type.
    """
    if not isinstance(value, types):
        raise ArgumentError(f"{what} is of type {type(value).__name__}: give {expected}")


def without_password(text: str) -> str:
    """A text whose addresses lack user and password, to be shown and stored.

    Values of parameters that are named as passwords and keys are, such as `pwd`, are replaced by `***`.
    """
    without_user = _UNCODED_USER.sub("", _USER.sub("", text))
    return _ADDRESS.sub(lambda address: _SECRET.sub(r"\1***", address[0]), without_user)
