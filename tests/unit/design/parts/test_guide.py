"""Bill of materials and assembly guide."""

import csv
import math
from dataclasses import replace

import pytest

from manytouch.design.choose import design_sensor
from manytouch.design.materials import MATERIALS
from manytouch.design.parts.bill import (
    CAMERAS,
    COLUMNS,
    bill_of_materials,
    camera_type,
    focal_length_mm,
    least_f_number,
    screw_length_mm,
)
from manytouch.design.parts.casing import CasingChoices, make_parts
from manytouch.design.parts.guide import assembly
from manytouch.design.parts.meshing import make_mesh
from manytouch.design.requirements import CameraSpecification, Requirements

CHOICES = CasingChoices(screw_every_mm=80.0)


def test_the_screw_reaches_the_nut(found):
    assert screw_length_mm(found, CHOICES) == 12
    assert screw_length_mm(found, replace(CHOICES, clamp_mm=6.0)) == 16


def test_what_is_bought_has_an_example_and_a_range_of_prices(found):
    parts = make_parts(found.sensor, found.material.name, CHOICES)
    meshes = {part.name: make_mesh(part.solid) for part in parts}
    rows = list(csv.DictReader(bill_of_materials(found, parts, meshes, CHOICES).splitlines()))
    assert tuple(rows[0]) == COLUMNS
    printed = {part.name for part in parts}
    for row in rows:
        if row["item"] in printed:
            assert row["remark"].endswith(".stl")
            continue
        low, high = (float(text) for text in row[COLUMNS[-1]].split("-"))
        assert 0 <= low < high
    items = {row["item"]: row["example"] for row in rows}
    for item in ("camera", "lens", "LED strip", "material of the sheet"):
        assert items[item]


@pytest.mark.parametrize("width_px", [640, 1280, 1920, 2560, 3840, 8000])
def test_the_lens_has_the_field_of_view_and_keeps_the_deepest_press_sharp(found, width_px: int):
    optics = CameraSpecification(width_px=width_px, height_px=width_px * 9 // 16, hfov_deg=58.0)
    other = replace(found, requirements=replace(found.requirements, camera=optics))
    camera, focal_mm = camera_type(other), focal_length_mm(other)
    assert camera.width_px >= width_px or camera == CAMERAS[-1]
    seen_deg = 2 * math.degrees(math.atan(camera.sensor_mm / 2 / focal_mm))
    assert seen_deg == pytest.approx(58.0)
    # similar triangles: the cone from the lens to the image of a near point, cut at the image of the sheet
    aperture_mm = focal_mm / least_f_number(other)
    sheet_mm = float(other.sensor.camera.translation_mm[2])
    near_mm = sheet_mm - other.requirements.deepest_mm
    image_mm, behind_mm = (1 / (1 / focal_mm - 1 / distance) for distance in (sheet_mm, near_mm))
    spread_mm = aperture_mm * (behind_mm - image_mm) / behind_mm
    assert spread_mm == pytest.approx(camera.sensor_mm / width_px, rel=0.06)


def test_a_cast_sheet_is_not_printed():
    stiffest = {material.process: material for material in MATERIALS}  # the last one of each process
    assert set(stiffest) == {"cast", "printed"}
    for material in stiffest.values():
        needed = Requirements(
            area_mm=(40.0, 25.0), thickness_mm=3.0, force_N=(0.05, 0.5), material=material.name
        )
        guide = assembly(design_sensor(needed), CHOICES)
        assert ("Cast the sheet" in guide) == (material.process == "cast")
        assert ("Print `sheet.3mf`" in guide) == (material.process == "printed")
