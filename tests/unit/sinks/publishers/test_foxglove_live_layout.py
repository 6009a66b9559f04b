"""The layout for Foxglove and Lichtblick: what Lichtblick requires of a file, and topics that are published.

Lichtblick refuses a file by `validateLayoutData` of packages/suite-base/src/util/layout.ts. Settings of
panels are in `IRenderer.ts`, `colorMode.ts`, `Plot/utils/config.ts` and `RawMessagesCommon/types.ts` there.
"""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from manytouch.recording import CALIBRATION, CAMERA, READING, SURFACE
from manytouch.sinks.publishers.foxglove_live import MESH
from manytouch.values.tabular.rows import contact_values

PATH = Path(__file__).parents[4] / "docs" / "foxglove-layout.json"
if not PATH.is_file():
    pytest.skip("the pages come with the repository, not with the wheel", allow_module_level=True)
LAYOUT: dict[str, Any] = json.loads(PATH.read_text(encoding="utf-8"))
PANELS: dict[str, dict[str, Any]] = LAYOUT["configById"]


def leaves(node: Any) -> list[str]:
    return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])


def test_it_has_all_that_lichtblick_requires() -> None:
    assert isinstance(PANELS, dict)
    assert isinstance(LAYOUT["globalVariables"], dict)
    assert isinstance(LAYOUT["playbackConfig"]["speed"], int)
    assert isinstance(LAYOUT["userNodes"], dict)
    assert isinstance(LAYOUT["layout"], dict)


def test_every_panel_is_shown_once_and_of_a_known_type() -> None:
    assert sorted(leaves(LAYOUT["layout"])) == sorted(PANELS)
    assert {name.partition("!")[0] for name in PANELS} <= {"3D", "Image", "Plot", "RawMessages"}


def test_its_topics_and_fields_are_published(contact_of) -> None:
    scene, image = PANELS["3D!surface"], PANELS["Image!camera"]["imageMode"]
    assert set(scene["topics"]) == {SURFACE, MESH}
    assert scene["topics"][SURFACE]["colorMode"] == "colormap"
    assert scene["followMode"] in {"follow-pose", "follow-position", "follow-none"}
    assert (image["imageTopic"], image["calibrationTopic"]) == (CAMERA, CALIBRATION)
    assert PANELS["RawMessages!reading"]["topicPath"] == READING
    (path,) = PANELS["Plot!force"]["paths"]
    found = re.fullmatch(READING + r'\.contacts\[:\]\{(\w+)!="end"\}\.(\w+)', path["value"])
    assert found is not None
    assert set(found.groups()) <= set(contact_values(contact_of(1)))
