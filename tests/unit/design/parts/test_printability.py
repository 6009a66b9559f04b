"""Checks whether parts can be printed."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.design.parts.casing import (
    CasingChoices,
    make_parts,
)
from manytouch.design.parts.meshing import make_mesh
from manytouch.design.parts.printability import open_edges, overhang_mm2, printability_warnings
from manytouch.design.parts.solids import Solid, Taper, block
from manytouch.design.requirements import Printer

CHOICES = CasingChoices()


def test_a_torn_mesh_has_open_edges():
    mesh = make_mesh(Solid(joined=(block((3.0, 4.0), (0.0, 5.0)),)))
    assert open_edges(replace(mesh, triangle=mesh.triangle[1:])) == 3


def test_a_wide_roof_is_an_overhang_and_a_chamfer_is_not():
    roof = Solid(joined=(block((4.0, 4.0), (0.0, 10.0)), block((40.0, 30.0), (10.0, 12.0))))
    assert overhang_mm2(make_mesh(roof)) == pytest.approx(40.0 * 30.0 - 16.0)
    chamfer = Solid(joined=(Taper(lower_mm=(4.0, 4.0), upper_mm=(24.0, 24.0), z_mm=(0.0, 10.0)),))
    assert overhang_mm2(make_mesh(chamfer)) == 0.0
    steeper = Solid(joined=(Taper(lower_mm=(4.0, 4.0), upper_mm=(24.0, 24.0), z_mm=(0.0, 8.0)),))
    assert overhang_mm2(make_mesh(steeper)) > 0.0


def test_all_parts_can_be_printed_and_screwed_together(found):
    parts = make_parts(found.sensor, "TPU", CHOICES)
    meshes = {part.name: make_mesh(part.solid) for part in parts}
    assert printability_warnings(found.sensor, Printer(), CHOICES, meshes) == ()
    tall = np.ptp(meshes["casing"].vertex_mm[:, 2])
    assert tall == pytest.approx(found.sensor.camera.translation_mm[2] + CHOICES.board_depth_mm)
    against = " ".join(
        printability_warnings(
            found.sensor, Printer(nozzle_mm=1.2, bed_mm=(50.0, 50.0, 50.0)), CHOICES, meshes
        )
    )
    assert "larger than the bed of the printer" in against
    assert "thinner than three lines" in against
    assert "narrower than two lines" in against
