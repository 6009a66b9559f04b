"""The sheet, the clamp and the casing."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.design.parts.casing import (
    SCREW_RADIUS_MM,
    CasingChoices,
    clamp,
    ledge_mm,
    screw_places,
    sheet_parts,
)
from manytouch.design.parts.meshing import make_mesh

CHOICES = CasingChoices()


def test_flush_markers_fill_their_holes(found):
    sheet, markers = (make_mesh(part.solid) for part in sheet_parts(found.sensor, "TPU", CHOICES))
    layout, t = found.sensor.layout, found.sensor.sheet.thickness_mm
    dots = len(layout.rest_mm) * np.pi * layout.radius_mm[0] ** 2 * CHOICES.flush_mm
    assert markers.volume_mm3 == pytest.approx(dots, rel=1e-6)
    holes = len(screw_places(found.sensor, CHOICES)) * np.pi * SCREW_RADIUS_MM**2 * t
    plate = np.prod(found.sensor.sheet.size_mm + 2 * CHOICES.flange_mm) * t
    assert sheet.volume_mm3 + markers.volume_mm3 == pytest.approx(plate - holes, rel=1e-6)
    assert markers.vertex_mm[:, 2].max() == pytest.approx(t)


def test_pins_stand_off_the_sheet(found):
    high = replace(found.sensor, layout=replace(found.sensor.layout, height_mm=1.5))
    _, markers = (make_mesh(part.solid) for part in sheet_parts(high, "TPU", CHOICES))
    t = found.sensor.sheet.thickness_mm
    assert [markers.vertex_mm[:, 2].min(), markers.vertex_mm[:, 2].max()] == pytest.approx([t, t + 1.5])


def test_the_sheet_is_turned_over_so_that_the_camera_sees_the_layout(found):
    layout = found.sensor.layout
    alone = np.zeros(len(layout.rest_mm), dtype=bool)
    alone[1:] = True
    _, markers = sheet_parts(replace(found.sensor, layout=replace(layout, is_missing=alone)), "TPU", CHOICES)
    middle = make_mesh(markers.solid).vertex_mm[:, :2].mean(axis=0)
    # camera side up means z towards the camera: x stays, y turns round
    assert middle == pytest.approx(layout.rest_mm[0, :2] * [1.0, -1.0], abs=1e-6)


def test_the_ledge_does_not_hide_the_sheet(found):
    """A ray from any marker at rest to the camera passes inside the ledge."""
    distance = found.sensor.camera.translation_mm[2]
    at_ledge = found.sensor.layout.rest_mm[:, :2] * (
        1 - (CHOICES.ledge_drop_mm + CHOICES.clamp_mm) / distance
    )
    ledge = ledge_mm(found.sensor, CHOICES)
    assert 4.0 < ledge < CHOICES.ledge_mm
    room = found.sensor.sheet.size_mm / 2 - ledge
    assert np.all(np.abs(at_ledge) < room)


def test_the_clamp_leaves_the_outline_free(found):
    mesh = make_mesh(clamp(found.sensor, CHOICES))
    inside = np.abs(mesh.vertex_mm[:, :2]) < found.sensor.sheet.size_mm / 2 - 1e-6
    assert not inside.all(axis=1).any()


def test_screws_stand_evenly_along_the_middle_of_the_flange(found):
    places = screw_places(found.sensor, CHOICES)
    half = (found.sensor.sheet.size_mm + CHOICES.flange_mm) / 2
    on_side = np.isclose(np.abs(places), half)
    assert on_side.any(axis=1).all()
    assert on_side.all(axis=1).sum() == 4
    for axis in (0, 1):
        along = np.sort(places[on_side[:, 1 - axis] & (places[:, 1 - axis] > 0), axis])
        assert np.diff(along) == pytest.approx(np.diff(along)[0])
        assert 0.5 * CHOICES.screw_every_mm < np.diff(along)[0] <= CHOICES.screw_every_mm
