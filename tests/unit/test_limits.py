"""The documentation states each limit of what is read."""

from pathlib import Path

import pytest

from manytouch import limits

PAGE = Path(__file__).parents[2] / "docs" / "limits.md"
STATED = {
    "MAX_SIDE_PX": "{0} px per side",
    "MAX_PIXELS": "{millions} million pixels",
    "MAX_IMAGE_BYTES": "| image file | {millions} MB |",
    "MAX_MARKERS": "{0} markers",
    "MAX_FRAME_INDEX": "| number of a frame | {0},",
    "MAX_FRAME_TIME_NS": "| time of a frame of a recording | less than {years} years from its start |",
    "MAX_MESSAGE_BYTES": "| {millions} MB, as stated in the file and decompressed |",
    "MAX_TOML_BYTES": "| sensor and scene file (TOML) | {millions} MB",
    "MAX_TOML_DEPTH": "nested {0} deep",
    "MAX_TOML_KEYS": "{0} keys",
    "MAX_TOML_LISTS": "{0} lists",
    "MAX_TOML_VALUES": "{0} values in lists",
    "MAX_TABLE_BYTES": "| table of presses (CSV) | {millions} MB",
    "MAX_PRESSES": "{0} presses",
    "MAX_SCENE_FRAMES": "| scene | {0} frames",
    "MAX_SCENE_BODIES": "{0} bodies",
    "MAX_SCENE_ELEMENTS": "{0} finite elements",
    "MAX_SCENE_KEYFRAMES": "{0} equilibria",
    "MAX_MESH_BYTES": "| mesh of a scene | {millions} MB |",
    "MOST_THICKNESSES": "| `[sheet]` | sides of at most {0} thicknesses",
    "MOST_SIDES": "a thickness of at most {0} times the shorter side",
    "LEAST_HFOV_DEG": "| horizontal field of view (`--hfov-deg`) | {0} to",
    "MOST_HFOV_DEG": "to {0} degrees",
    "HIGHEST_FPS": "| 1e-{zeros} to 1e{zeros} frames per second",
    "LARGEST_NUMBER": "numbers between -1e{zeros} and 1e{zeros}",
}


def test_every_limit_is_stated() -> None:
    assert {name for name in vars(limits) if name.isupper()} == set(STATED)


@pytest.mark.skipif(not PAGE.is_file(), reason="the documentation is not installed")
@pytest.mark.parametrize("name", STATED)
def test_the_documentation_states_the_limit(name: str) -> None:
    value = int(getattr(limits, name))
    words = STATED[name].format(
        f"{value:,}".replace(",", " ") if value >= 10_000 else value,
        millions=value // 10**6,
        years=value // (365 * 86_400 * 10**9),
        zeros=len(str(value)) - 1,
    )
    assert words in PAGE.read_text(encoding="utf-8")
