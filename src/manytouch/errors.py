"""Everything manytouch raises.

A frame that went wrong is never an exception: it is a `status` in the reading. What raises is a
wrong file, a wrong sensor or a missing device, and its sentence says what was given, what was
expected and what to do.

    ManytouchError
    ├── SourceError        a video, image, folder or device cannot be opened or read
    ├── SensorError        a sensor file is wrong, or does not fit the recording
    ├── LayoutError        no dots, or no usable arrangement of dots, were found
    ├── OutputError        results cannot be written where they were asked for
    └── MissingExtraError  an optional package is needed for what was asked
"""


class ManytouchError(Exception):
    """Base of all errors that a user can cause and mend; the message is one clear sentence."""


class SourceError(ManytouchError):
    """A source of frames cannot be opened or read."""


class SensorError(ManytouchError):
    """A sensor file is wrong, or the sensor does not fit the frames."""


class LayoutError(ManytouchError):
    """No dots, or no usable arrangement of dots, were found."""


class OutputError(ManytouchError):
    """Results cannot be written where they were asked for."""


class MissingExtraError(ManytouchError):
    """An optional package is needed; the message names the extra to install."""

    def __init__(self, purpose: str, package: str, extra: str) -> None:
        super().__init__(
            f"{purpose} needs the package {package}, which is not installed: pip install 'manytouch[{extra}]'"
        )
