"""Meshes and STEP files of solids: closed, with the right volume in independent readers."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from manytouch.design.parts.meshing import make_mesh, write_stl
from manytouch.design.parts.printability import open_edges
from manytouch.design.parts.solids import Box, CrossHole, Solid, Taper, block, pins
from manytouch.design.parts.step import write_step

SOLIDS = {
    "block": (Solid(joined=(Box(x_mm=(1.0, 4.0), y_mm=(-2.0, 2.0), z_mm=(0.0, 5.0)),)), 60.0),
    "taper": (Solid(joined=(Taper(lower_mm=(4.0, 2.0), upper_mm=(2.0, 1.0), z_mm=(0.0, 3.0)),)), 14.0),
    "pin": (Solid(joined=(pins(np.array([[3.0, 1.0]]), 2.0, (0.0, 1.5)),)), 6.0 * np.pi),
    "cone": (
        Solid(joined=(pins(np.zeros((1, 2)), 2.0, (0.0, 3.0), upper_radius_mm=1.0),)),
        np.pi * 3.0 / 3.0 * (4.0 + 2.0 + 1.0),
    ),
    "bored": (
        Solid(
            joined=(block((10.0, 10.0), (0.0, 4.0)),),
            removed=(CrossHole(x_mm=0.0, z_mm=2.0, y_mm=(-6.0, 6.0), radius_mm=1.0),),
        ),
        400.0 - 10.0 * np.pi,
    ),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_has_its_volume_as_mesh(name, tmp_path: Path):
    solid, volume = SOLIDS[name]
    mesh = make_mesh(solid)
    assert open_edges(mesh) == 0
    assert mesh.volume_mm3 == pytest.approx(volume, rel=2e-3)
    write_stl(mesh, tmp_path / "solid.stl")
    read = trimesh.load(tmp_path / "solid.stl")
    assert read.is_watertight
    assert read.volume == pytest.approx(volume, rel=2e-3)
    assert read.bounds == pytest.approx(np.array([mesh.vertex_mm.min(axis=0), mesh.vertex_mm.max(axis=0)]))


@pytest.mark.slow
@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_has_its_volume_as_step(name, tmp_path: Path):
    import build123d

    solid, volume = SOLIDS[name]
    write_step(solid, tmp_path / "solid.step")
    read = build123d.import_step(tmp_path / "solid.step")
    assert read.volume == pytest.approx(volume, rel=1e-6)
    box = read.bounding_box()
    assert [*box.min] == pytest.approx(make_mesh(solid).vertex_mm.min(axis=0), abs=0.02)
