"""The exploded picture of the assembly."""

import numpy as np
import pytest

from manytouch.design.parts.casing import CasingChoices, make_parts, screw_places
from manytouch.design.parts.exploded import assembly_layers
from manytouch.design.parts.meshing import make_mesh

CHOICES = CasingChoices(screw_every_mm=80.0)


@pytest.fixture(scope="module")
def made(found):
    parts = make_parts(found.sensor, "TPU", CHOICES)
    return parts, {part.name: make_mesh(part.solid) for part in parts}


def test_layers_are_in_the_order_of_the_assembly_and_fit_each_other(found, made) -> None:
    camera, casing, strip, sheet, clamp, screws = assembly_layers(found.sensor, *made, CHOICES, screw_mm=12)
    size_mm = [
        np.ptp(np.concatenate([part.reshape(-1, 3) for part in layer.corners_mm]), axis=0)
        for layer in (camera, casing, strip, sheet, clamp, screws)
    ]
    assert size_mm[1][:2] == pytest.approx(size_mm[3][:2])
    assert size_mm[3][:2] == pytest.approx(size_mm[4][:2])
    assert np.all(size_mm[2][:2] < size_mm[1][:2])
    assert np.all(size_mm[0][:2] < size_mm[1][:2])
    assert screws.label.startswith(f"{len(screw_places(found.sensor, CHOICES))} screws M3 x 12")


def test_the_markers_of_the_mounted_sheet_are_below(found, made) -> None:
    sheet = assembly_layers(found.sensor, *made, CHOICES, screw_mm=12)[3]
    (corners,) = sheet.corners_mm
    thickness_mm = found.sensor.sheet.thickness_mm
    assert corners[..., 2].min() == pytest.approx(0.0)
    assert corners[..., 2].max() == pytest.approx(thickness_mm)
    depths, counts = np.unique(np.round(corners[..., 2], 3), return_counts=True)
    inside = depths[(depths > 0.0) & (depths < thickness_mm)]
    assert inside == pytest.approx([CHOICES.flush_mm]), "the pockets of the flush markers open downwards"
    assert counts.sum() > 0
