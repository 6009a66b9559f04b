"""What is wrong with a frame, in one word, and what to do about it."""

from enum import StrEnum


class Status(StrEnum):
    """State of one frame after a stage of the pipeline; a `str`, written to files as its value.

    Sources yield a frame without an image where a file or camera has none of the announced size. They cannot
    state why: its status is `DECODE_ERROR`, whatever the cause. `WRONG_SIZE` is the status of an image that
    reaches detection with another size, as frames from Python can.

    Attributes:
        remedy: one sentence about what to do; empty for `OK`.
    """

    OK = "ok"
    DECODE_ERROR = "decode_error"
    WRONG_SIZE = "wrong_size"
    DARK = "dark"
    SATURATED = "saturated"
    BLURRED = "blurred"
    FEW_MARKERS = "few_markers"
    MANY_MARKERS = "many_markers"
    AMBIGUOUS_SHIFT = "ambiguous_shift"
    NOT_CONVERGED = "not_converged"
    REST_DOUBTFUL = "rest_doubtful"

    @property
    def remedy(self) -> str:
        """What to do when frames have this status."""
        return _REMEDY[self]


_REMEDY = {
    Status.OK: "",
    Status.DECODE_ERROR: (
        "No image of the size of the first one: copy or record the input again, or check the camera's cable."
    ),
    Status.WRONG_SIZE: "Give images of the size in the sensor file, and a region of interest inside them.",
    Status.DARK: "Add light, or choose a longer exposure.",
    Status.SATURATED: "Dim the light, or choose a shorter exposure.",
    Status.BLURRED: "Focus the lens, or choose a shorter exposure.",
    Status.FEW_MARKERS: "Remove what hides the markers, light the sheet evenly, and keep it in the image.",
    Status.MANY_MARKERS: "Remove what looks like a marker, or limit the region of interest to the markers.",
    Status.AMBIGUOUS_SHIFT: "Release the sheet until markers are identified again; raise the frame rate.",
    Status.NOT_CONVERGED: "Where this is frequent, check that the sensor file describes this sheet.",
    Status.REST_DOUBTFUL: "Tare while nothing touches the sheet, or record its start and end untouched.",
}
