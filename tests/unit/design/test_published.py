"""The design numbers of the paper, against what it prints and what follows from it by hand."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from manytouch.cli import main
from manytouch.design.published import numbers
from manytouch.design.published.numbers import PaperDesign, paper_design
from manytouch.design.published.write import write_numbers


@pytest.fixture(scope="module")
def found() -> PaperDesign:
    return paper_design()


def test_the_camera_is_where_the_paper_has_it_with_the_assumed_field_of_view(found: PaperDesign) -> None:
    off = found.stand_off
    assert off.distance_mm == pytest.approx(116.3)
    assert off.limit == "height"
    assert off.width_mm == pytest.approx(60.0 / math.tan(math.radians(found.hfov_deg) / 2))
    assert off.distance_mm > off.focus_mm == 100.0
    camera = found.design.sensor.camera
    assert camera.translation_mm[2] == 116.3
    assert 1440 * 116.3 / camera.fx_px == pytest.approx(80.0)
    assert found.design.sensor.layout.height_mm == found.design.requirements.marker_height_mm == 1.0
    (camera_reason,) = (one for one in found.design.reasons if "camera" in one.about)
    assert "Assumed: a horizontal field of view of 62.9 degrees" in camera_reason.why


def test_both_readings_of_the_modulus_scale_a_linear_model_by_a_thousand(found: PaperDesign) -> None:
    printed, slip, square_printed, square_slip = found.moduli
    assert (printed.young_MPa, slip.young_MPa) == (0.01, 10.0)
    assert printed.linear_mm == pytest.approx(1000.0 * slip.linear_mm)
    assert printed.depth_mm is None
    assert square_printed.linear_mm > 9000.0
    assert square_slip.linear_mm == pytest.approx(10.1, abs=0.8)  # the slip of the unit
    assert slip.depth_mm < slip.linear_mm  # stretching makes it stiffer
    assert slip.linear_young_MPa * 10.1 == pytest.approx(slip.linear_mm * 10.0)  # depth times modulus
    # the 3-D finite elements of `evaluate --paper` give 3.38 and 2.02 MPa
    assert printed.large_young_MPa == pytest.approx(3.38, rel=0.03)
    assert square_slip.large_young_MPa == pytest.approx(2.02, rel=0.03)


def test_equation_1_as_printed_misses_what_height_does(found: PaperDesign) -> None:
    flush, one, two = found.spacings
    assert flush.printed_mm == flush.corrected_mm
    for spacing in (one, two):
        angle = math.radians(spacing.slope_deg + spacing.turn_deg)
        missed_mm = spacing.height_mm * (math.cos(angle) - math.sin(angle))
        assert spacing.corrected_mm - spacing.printed_mm == pytest.approx(missed_mm)
    assert two.corrected_mm < one.corrected_mm < flush.corrected_mm < 2.0
    assert two.smallest_pitch_mm > flush.smallest_pitch_mm
    assert two.largest_radius_mm < flush.largest_radius_mm < 2.0


def test_the_numbers_are_written_with_the_curve_of_figure_2(found: PaperDesign, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    write_numbers(found, tmp_path)
    rows = list(csv.DictReader((tmp_path / "figure-2.csv").read_text().splitlines()))
    for size in numbers.SIZES_MM:
        mine = [row for row in rows if float(row["size_x_mm"]) == size[0]]
        depth_mm = np.array([float(row["depth_mm"]) for row in mine])
        assert (np.diff(depth_mm) > 0).all()
        assert float(mine[-1]["force_N"]) == 10.0
        assert depth_mm[-1] == pytest.approx(10.1, rel=1e-3)
    text = (tmp_path / "paper.md").read_text(encoding="utf-8")
    assert "116.3 mm" in text
    assert "slip of the unit" in text
    assert (tmp_path / "figure-2.png").stat().st_size > 10_000


def test_the_command_prints_the_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    assert main(["design", "--paper", "--parts", "none", "--out", str(tmp_path / "design")]) == 0
    printed = capsys.readouterr().out
    assert "| 120 x 80 | 0.01 |" in printed
    assert "gap as printed" in printed
    assert {path.name for path in (tmp_path / "design").iterdir()} == {
        "paper.md",
        "figure-2.csv",
        "figure-2.png",
        "sensor.toml",
    }
