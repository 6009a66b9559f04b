"""Patterns and boards in true size."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from pypdf import PdfReader

from manytouch.calibration.camera.board import find_board, parse_board
from manytouch.design.parts.patterns import A4_MM, MARGIN_MM, board_page, write_board, write_marker_pattern
from manytouch.errors import OutputError

POINTS_PER_MM = 72 / 25.4


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


@pytest.mark.parametrize("side_mm", [4.0, 7.5, 25.0])
def test_texts_of_a_board_do_not_overlap(side_mm: float):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = board_page(parse_board("chessboard:9x6", side_mm))
    canvas = FigureCanvasAgg(figure)
    first, second = (text.get_window_extent(canvas.get_renderer()) for text in figure.axes[0].texts)
    assert not first.overlaps(second)


BOARDS = {"chessboard:9x6": 25.0, "charuco:10x7": 25.0, "circles-asymmetric:4x11": 16.0}


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


def test_black_is_one_path(tmp_path: Path):
    svg, _ = write_board(parse_board("charuco:10x7", 25.0), tmp_path / "board")
    paths = re.findall(r'<path d="([^"]*)"', svg.read_text().partition('<g id="text_')[0])
    closed = [path for path in paths if path.rstrip().endswith("z")]
    _page, black = closed
    assert black.count("M") > 100
