"""Limits of what is read from files, checked before memory is allocated for it.

They are far above what the sensors of docs/how-to.md need, and low enough that a damaged or hostile file is
refused within a second. `docs/limits.md` states them for users.
"""

MAX_SIDE_PX = 32_768
MAX_PIXELS = 2**26
"""Limit of an image or a video frame: 67 million, three times that of a camera of 6000 x 4000 px."""
MAX_IMAGE_BYTES = 2**29
"""Limit of an image file: a colour image of 16 bits and `MAX_PIXELS`, uncompressed, has 400 million."""
MAX_MARKERS = 100_000
MAX_MESSAGE_BYTES = 2**29
"""Limit of one message of a recording, such as a frame or a reading."""
MAX_FRAME_INDEX = 2**31 - 1
"""Number of a frame, which has 32 bits in tables and messages: 2 years at 30 frames per second."""
MAX_FRAME_TIME_NS = 10 * 365 * 86_400 * 10**9
"""Time of a frame of a recording, from its start: 10 years."""
MAX_TOML_BYTES = 4_000_000
MAX_TOML_DEPTH = 8
MAX_TOML_KEYS = 10_000
MAX_TOML_LISTS, MAX_TOML_VALUES = MAX_MARKERS + MAX_TOML_KEYS, 6 * MAX_MARKERS
MAX_TABLE_BYTES = 10_000_000
MAX_PRESSES = 10_000
MAX_SCENE_FRAMES = 1_000_000
MAX_SCENE_BODIES = 200
MAX_SCENE_ELEMENTS = 200_000
MAX_SCENE_KEYFRAMES = 100_000
MAX_MESH_BYTES = 100_000_000
LARGEST_NUMBER = 1e9
"""Absolute value of any number in a sensor or scene file; lengths are not smaller than its inverse."""
MOST_THICKNESSES = 10_000
"""Longest side of a sheet: twenty times that of a film of 0.2 mm over 100 mm."""
MOST_SIDES = 10
"""Thickness of a sheet, in multiples of its shorter side."""
LEAST_HFOV_DEG, MOST_HFOV_DEG = 1.0, 179.0
"""Horizontal field of view of a camera that may be given."""
HIGHEST_FPS = 1e6
"""Frames per second that may be given, and at least the inverse: times are whole nanoseconds in 64 bits."""


def size_mistake(width_px: int, height_px: int) -> str | None:
    """Why images of this size are not read; None if they are."""
    if width_px <= MAX_SIDE_PX and height_px <= MAX_SIDE_PX and width_px * height_px <= MAX_PIXELS:
        return None
    return (
        f"{width_px} x {height_px} px are too many: at most {MAX_SIDE_PX} px per side and "
        f"{MAX_PIXELS // 10**6} million pixels are read"
    )


def sheet_mistake(x_mm: float, y_mm: float, thickness_mm: float) -> str | None:
    """Why no sheet of this outline and thickness is computed; None if it is."""
    least_mm, most_mm = max(x_mm, y_mm) / MOST_THICKNESSES, MOST_SIDES * min(x_mm, y_mm)
    if least_mm <= thickness_mm <= most_mm:
        return None
    return (
        f"a sheet of {x_mm:g} x {y_mm:g} mm that is {thickness_mm:g} mm thick is not computed: its "
        f"longer side has at most {MOST_THICKNESSES} thicknesses, and its thickness is at most {MOST_SIDES} "
        "times its shorter side; check both"
    )
