"""Parts: closed, with the right volume in independent readers, printable; patterns in true size."""

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.backends.backend_agg import FigureCanvasAgg
from pypdf import PdfReader

from manytouch.calibration.camera.board import find_board, parse_board
from manytouch.design.choose import design_sensor
from manytouch.design.parts.casing import (
    SCREW_RADIUS_MM,
    CasingChoices,
    clamp,
    ledge_mm,
    make_parts,
    screw_places,
    sheet_parts,
)
from manytouch.design.parts.guide import screw_length_mm
from manytouch.design.parts.meshing import make_mesh, write_stl
from manytouch.design.parts.patterns import A4_MM, MARGIN_MM, board_page, write_board, write_marker_pattern
from manytouch.design.parts.pictures import RISE_DEG, TURN_DEG, render_meshes
from manytouch.design.parts.printability import open_edges, overhang_mm2, printability_warnings
from manytouch.design.parts.solids import Box, CrossHole, Solid, Taper, block, pins
from manytouch.design.parts.step import write_step
from manytouch.design.requirements import Printer, Requirements
from manytouch.design.write import BOARDS, write_design
from manytouch.errors import OutputError
from manytouch.values.sensor_file import load_sensor

POINTS_PER_MM = 72 / 25.4
CHOICES = CasingChoices()
FEW_SCREWS = CasingChoices(screw_every_mm=80.0)


@pytest.fixture(scope="module")
def found():
    return design_sensor(Requirements(area_mm=(40.0, 25.0), thickness_mm=3.0, force_N=(0.1, 5.0)))


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
def test_a_solid_has_its_volume_as_mesh_and_as_step(name, tmp_path: Path):
    solid, volume = SOLIDS[name]
    mesh = make_mesh(solid)
    assert open_edges(mesh) == 0
    assert mesh.volume_mm3 == pytest.approx(volume, rel=2e-3)
    write_stl(mesh, tmp_path / "solid.stl")
    read = trimesh.load(tmp_path / "solid.stl")
    assert read.is_watertight
    assert read.volume == pytest.approx(volume, rel=2e-3)
    assert read.bounds == pytest.approx(np.array([mesh.vertex_mm.min(axis=0), mesh.vertex_mm.max(axis=0)]))
    import build123d

    write_step(solid, tmp_path / "solid.step")
    read = build123d.import_step(tmp_path / "solid.step")
    assert read.volume == pytest.approx(volume, rel=1e-6)
    box = read.bounding_box()
    assert [*box.min] == pytest.approx(mesh.vertex_mm.min(axis=0), abs=0.02)


def test_a_torn_mesh_has_open_edges():
    mesh = make_mesh(SOLIDS["block"][0])
    assert open_edges(replace(mesh, triangle=mesh.triangle[1:])) == 3


def test_a_wide_roof_is_an_overhang_and_a_chamfer_is_not():
    roof = Solid(joined=(block((4.0, 4.0), (0.0, 10.0)), block((40.0, 30.0), (10.0, 12.0))))
    assert overhang_mm2(make_mesh(roof)) == pytest.approx(40.0 * 30.0 - 16.0)
    chamfer = Solid(joined=(Taper(lower_mm=(4.0, 4.0), upper_mm=(24.0, 24.0), z_mm=(0.0, 10.0)),))
    assert overhang_mm2(make_mesh(chamfer)) == 0.0
    steeper = Solid(joined=(Taper(lower_mm=(4.0, 4.0), upper_mm=(24.0, 24.0), z_mm=(0.0, 8.0)),))
    assert overhang_mm2(make_mesh(steeper)) > 0.0


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


def test_the_screw_reaches_the_nut(found):
    assert screw_length_mm(found, CHOICES) == 12
    assert screw_length_mm(found, replace(CHOICES, clamp_mm=6.0)) == 16


def test_patterns_have_their_true_size(found, tmp_path: Path):
    svg, pdf = write_marker_pattern(found.sensor, tmp_path / "markers")
    page = PdfReader(pdf).pages[0]
    size = found.sensor.sheet.size_mm + 2 * MARGIN_MM
    assert [float(page.mediabox.width), float(page.mediabox.height)] == pytest.approx(
        (size * POINTS_PER_MM).tolist(), abs=0.01
    )
    assert f'width="{size[0] * POINTS_PER_MM:.6f}pt"'[:14] in svg.read_text()
    text = page.get_contents().get_data().decode("latin1")
    lines = [
        tuple(map(float, pair))
        for pair in re.findall(r"([\d.]+) ([\d.]+) m\n([\d.]+) ([\d.]+) l", text)
        for pair in [pair]
    ]
    lengths = [np.hypot(x1 - x0, y1 - y0) / POINTS_PER_MM for x0, y0, x1, y1 in lines]
    assert any(abs(length - 50.0) < 0.01 for length in lengths), lengths


def test_markers_are_printed_at_their_positions(found, tmp_path: Path):
    _, pdf = write_marker_pattern(found.sensor, tmp_path / "markers")
    text = PdfReader(pdf).pages[0].get_contents().get_data().decode("latin1")
    layout = found.sensor.layout
    size = found.sensor.sheet.size_mm + 2 * MARGIN_MM
    # every circle is a path of eight curves that starts at its least y
    starts = re.findall(r"([\d.]+) ([\d.]+) m\n(?:[-\d. ]+ c\n){8}", text)
    low = np.array(starts, dtype=float) / POINTS_PER_MM
    place = np.column_stack([low[:, 0] - size[0] / 2, size[1] / 2 - low[:, 1]])
    place[:, 1] += layout.radius_mm[0]
    assert len(place) == len(layout.rest_mm)
    order = np.lexsort(np.round(place, 2).T)
    expected = layout.rest_mm[np.lexsort(np.round(layout.rest_mm[:, :2], 2).T), :2]
    assert place[order] == pytest.approx(expected, abs=0.02)


def test_a_chessboard_has_true_squares_and_fits_the_page(tmp_path: Path):
    _, pdf = write_board(parse_board("chessboard:9x6", 25.0), tmp_path / "board")
    page = PdfReader(pdf).pages[0]
    assert float(page.mediabox.width) == pytest.approx(297.0 * POINTS_PER_MM, abs=0.01)
    text = page.get_contents().get_data().decode("latin1")
    squares = re.findall(
        r"([\d.]+) ([\d.]+) m\n([\d.]+) ([\d.]+) l\n([\d.]+) ([\d.]+) l\n([\d.]+) ([\d.]+) l\nh", text
    )
    corners = np.array(squares, dtype=float).reshape(-1, 4, 2) / POINTS_PER_MM
    sides = np.ptp(corners, axis=1)
    black = np.isclose(sides, 25.0, atol=0.01).all(axis=1).sum()
    assert black == 35
    with pytest.raises(OutputError, match="does not fit an A4 page"):
        write_board(parse_board("chessboard:12x9", 25.0), tmp_path / "board")


@pytest.mark.parametrize("text", BOARDS)
def test_a_printed_board_is_found_and_has_its_size(text: str):
    board = parse_board(text, BOARDS[text])
    figure = board_page(board)
    FigureCanvasAgg(figure)
    dots_per_mm = 6.0
    figure.set_dpi(dots_per_mm * 25.4)
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())[..., 0].copy()
    assert picture.shape[::-1] == pytest.approx(dots_per_mm * np.array(A4_MM), abs=1.5)
    found = find_board(picture, board)
    assert found is not None
    assert len(found.number) == len(board.point_mm)
    place_mm = found.place_px / dots_per_mm
    expected_mm = board.point_mm[found.number, :2]
    turned = place_mm - place_mm.mean(axis=0), expected_mm - expected_mm.mean(axis=0)
    errors = [np.abs(sign * turned[0] - turned[1]).max() for sign in (1.0, -1.0)]
    assert min(errors) < 0.1, "up to half a turn, which boards of squares or circles do not show"


def test_near_parts_hide_far_ones():
    low = make_mesh(Solid(joined=(block((20.0, 20.0), (0.0, 2.0)),)))
    high = make_mesh(Solid(joined=(block((8.0, 8.0), (2.0, 12.0)),)))
    seen = render_meshes([low.corners_mm, high.corners_mm], ["#ff0000", "#0000ff"]).astype(float)
    under = render_meshes([high.corners_mm, low.corners_mm], ["#0000ff", "#ff0000"]).astype(float)
    assert np.mean(np.abs(seen - under).max(axis=2) > 100) < 0.005  # their order does not matter
    is_paper = (seen == 255).all(axis=2)
    red, blue = (seen[..., channel] > 1.3 * seen[..., 2 - channel] for channel in (0, 2))
    assert is_paper[0, 0]
    area = {name: float((chosen & ~is_paper).sum()) for name, chosen in (("red", red), ("blue", blue))}
    turn, rise = np.deg2rad([TURN_DEG, RISE_DEG])
    px_per_mm = (seen.shape[1] - 3) / (20.0 * (np.cos(turn) + np.sin(turn)))
    top = 64.0 * np.sin(rise)
    sides = 8.0 * 10.0 * np.cos(rise) * (np.cos(turn) + np.sin(turn))
    assert area["blue"] == pytest.approx((top + sides) * px_per_mm**2, rel=0.03)
    whole = 400.0 * np.sin(rise) + 20.0 * 2.0 * np.cos(rise) * (np.cos(turn) + np.sin(turn))
    assert 0.5 * whole * px_per_mm**2 < area["red"] < (whole - 64.0 * np.sin(rise)) * px_per_mm**2


def test_black_is_one_path(tmp_path: Path):
    svg, _ = write_board(parse_board("charuco:10x7", 25.0), tmp_path / "board")
    paths = re.findall(r'<path d="([^"]*)"', svg.read_text().partition('<g id="text_')[0])
    closed = [path for path in paths if path.rstrip().endswith("z")]
    _page, black = closed
    assert black.count("M") > 100


def test_a_design_is_written_with_all_its_files(found, tmp_path: Path):
    assert write_design(found, tmp_path, choices=FEW_SCREWS, step=True) == ()
    names = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert names >= {
        *("sensor.toml", "design.md", "assembly.md", "bill_of_materials.csv", "parts.png"),
        *(f"parts/{name}" for name in ("sheet.stl", "markers.stl", "clamp.stl", "casing.stl", "sheet.3mf")),
        *(
            "parts/casing.step",
            "parts/clamp.step",
            "patterns/markers.pdf",
            "patterns/chessboard-9x6.svg",
            "patterns/charuco-10x7.pdf",
        ),
    }
    assert load_sensor(tmp_path / "sensor.toml").layout.shape == found.sensor.layout.shape
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
    import build123d

    casing = next(part for part in make_parts(found.sensor, "TPU", FEW_SCREWS) if part.name == "casing")
    step = build123d.import_step(tmp_path / "parts" / "casing.step")
    assert step.volume == pytest.approx(make_mesh(casing.solid).volume_mm3, rel=1e-4)
