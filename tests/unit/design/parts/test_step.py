"""STEP files of solids with one primitive of each kind."""

from pathlib import Path

import numpy as np
import pytest

from manytouch.design.parts.meshing import make_mesh
from manytouch.design.parts.solids import CrossHole, Solid, Taper, block, pins
from manytouch.design.parts.step import write_step
from manytouch.errors import OutputError

build123d = pytest.importorskip("build123d")
SOLID = Solid(
    joined=(
        block((20.0, 12.0), (0.0, 3.0)),
        Taper(lower_mm=(12.0, 8.0), upper_mm=(6.0, 4.0), z_mm=(3.0, 6.0)),
        pins(np.array([[-8.0, 0.0], [8.0, 2.0]]), 1.0, (2.0, 7.0), upper_radius_mm=0.5),
    ),
    removed=(CrossHole(x_mm=3.0, z_mm=1.5, y_mm=(-7.0, 7.0), radius_mm=0.8),),
)


def test_a_step_file_has_the_volume_and_the_extent_of_the_mesh(tmp_path: Path) -> None:
    write_step(SOLID, tmp_path / "solid.step")
    step, mesh = build123d.import_step(tmp_path / "solid.step"), make_mesh(SOLID)
    assert step.volume == pytest.approx(mesh.volume_mm3, rel=1e-4)
    assert [*step.bounding_box().min] == pytest.approx(mesh.vertex_mm.min(axis=0), abs=0.02)
    assert [*step.bounding_box().max] == pytest.approx(mesh.vertex_mm.max(axis=0), abs=0.02)


def test_a_folder_that_is_missing_is_an_error_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write"):
        write_step(SOLID, tmp_path / "missing" / "solid.step")
