"""Inputs of the compiled loops of the paper's depth."""

from typing import NamedTuple

from manytouch.values.arrays import Floats, Integers


class CellLists(NamedTuple):
    """Cells of a layout and which of them are at each marker; see `PerimeterLaw`.

    Attributes:
        corner: (c, 4) markers.
        rest_perimeter: (c,).
        cell_first, cell: (m + 1,), (k,) cells at each marker.
        first, pair_corner: (m + 1,), (q,) corners of the cells at each marker.
        entry_first, entry: (q + 1,), (p,) cells of each pair of marker and corner.
    """

    corner: Integers
    rest_perimeter: Floats
    cell_first: Integers
    cell: Integers
    first: Integers
    pair_corner: Integers
    entry_first: Integers
    entry: Integers


class Rays(NamedTuple):
    """Rays of the markers at rest.

    Attributes:
        rest: (m, 2) where they meet the plane of the sheet.
        axis: (2,) foot of the camera in that plane.
        distance: of the camera from it.
    """

    rest: Floats
    axis: Floats
    distance: float


class LawErrors(NamedTuple):
    """How far the law deviates from the depth of the sheet.

    Attributes:
        neighbour: (k, m) neighbours of each marker.
        slope, curvature: (k, m) weights of a neighbour's depth minus the marker's own in the two errors.
        noise_factor: factor of the variance that independent noise of the depths adds to slope and curvature,
            which is subtracted.
        spill: multiple of the mean square of all depths (mm²) that is added to what the depths at and around
            a marker show; the sum limits the variance of its error.
        scale_std: relative standard deviation of all depths.
    """

    neighbour: Integers
    slope: Floats
    curvature: Floats
    noise_factor: float
    spill: float
    scale_std: float
