"""The files of a design."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from manytouch.design.parts import pictures
from manytouch.design.parts.casing import (
    CasingChoices,
    make_parts,
    screw_places,
)
from manytouch.design.parts.meshing import make_mesh
from manytouch.design.write import write_design
from manytouch.values.sensor_file.read import load_sensor

STEP_FILES = {"parts/casing.step", "parts/clamp.step"}
FEW_SCREWS = CasingChoices(screw_every_mm=80.0)


@pytest.mark.parametrize("step", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_design_is_written_with_all_its_files(
    step: bool, found, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(pictures, "SAMPLES_PER_PX", 1.0)
    assert write_design(found, tmp_path, choices=FEW_SCREWS, step=step) == ()
    names = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert names >= {
        *("sensor.toml", "design.md", "assembly.md", "bill_of_materials.csv", "parts.png", "assembly.png"),
        *(f"parts/{name}" for name in ("sheet.stl", "markers.stl", "clamp.stl", "casing.stl", "sheet.3mf")),
        *("patterns/markers.pdf", "patterns/chessboard-9x6.svg", "patterns/charuco-10x7.pdf"),
    }
    assert names & STEP_FILES == (STEP_FILES if step else set())
    assert load_sensor(tmp_path / "sensor.toml").layout.shape == found.sensor.layout.shape
    blue, green, red = np.moveaxis(cv2.imread(str(tmp_path / "assembly.png")).astype(int), -1, 0)
    is_strip, is_board = (red > blue + 60) & (green > blue + 40), (green > red + 15) & (green > blue + 10)
    assert min(is_strip.mean(), is_board.mean()) > 1e-3, "LED strip and camera board are in the picture"
    read = trimesh.load(tmp_path / "parts" / "sheet.3mf")
    assert sorted(read.geometry) == ["markers", "sheet"]
    assert read.units == "millimeter"
    items = {
        row["item"]: row
        for row in csv.DictReader((tmp_path / "bill_of_materials.csv").read_text().splitlines())
    }
    assert items["ball"]["what"] == "16 mm, a marble"
    guide = (tmp_path / "assembly.md").read_text()
    in_order = ["Print `casing.stl`", "calibrate camera", "Lay the sheet on the rim", "calibrate rest"]
    assert sorted(in_order, key=guide.index) == in_order
    assert items["nut"]["count"] == str(len(screw_places(found.sensor, FEW_SCREWS)))
    if not step:
        return
    import build123d

    casing = next(part for part in make_parts(found.sensor, "TPU", FEW_SCREWS) if part.name == "casing")
    casing_step = build123d.import_step(tmp_path / "parts" / "casing.step")
    mesh = make_mesh(casing.solid)
    assert casing_step.volume == pytest.approx(mesh.volume_mm3, rel=1e-4)
    assert [*casing_step.bounding_box().min] == pytest.approx(mesh.vertex_mm.min(axis=0), abs=0.02)
