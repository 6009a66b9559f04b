"""Inputs of the compiled surface at the markers."""

from typing import NamedTuple

from manytouch.estimation.perimeter.law_inputs import CellLists, LawErrors, Rays
from manytouch.geometry.plane_table import PlaneNodes
from manytouch.values.arrays import Floats, Integers


class InterpolationRule(NamedTuple):
    """Neighbours and parameters of the interpolation; see `MarkerInterpolation`.

    Attributes:
        neighbour, distance: (m, k) neighbours of each marker, and their distances in mm.
        spread: factor of the variance among the neighbours.
        floor: least standard deviation of an interpolated displacement, mm.
        unknown_std: standard deviation where no neighbour is known, mm.
        rounds: largest number of rounds.
    """

    neighbour: Integers
    distance: Floats
    spread: float
    floor: float
    unknown_std: float
    rounds: int


class MotionSearch(NamedTuple):
    """Hypotheses and parameters of the search; see `RigidMotionEstimator`.

    Attributes:
        pairs: (n, 2) markers that define a motion each.
        weight: (m,) of the markers.
        share: of the weight that must fit.
        voters: approximate number of markers on which motions are compared.
        rounds: of the refinement.
    """

    pairs: Integers
    weight: Floats
    share: float
    voters: int
    rounds: int


class SurfaceInputs(NamedTuple):
    """What the surface needs of sensor and parameters; a kernel takes it and its parts as plain tuples.

    Attributes:
        rest: (m, 3) markers in the sheet frame, mm.
        nodes: from pixels to the plane of the sheet.
        plane_from_px: (m, 2, 2) derivative of positions in the plane by those in the image, mm per px.
        interpolation: of markers that are not seen.
        search: for the motion of the view.
        rays, cells, errors: of the paper's law.
        least: fewest markers that make a surface.
    """

    rest: Floats
    nodes: PlaneNodes
    plane_from_px: Floats
    interpolation: InterpolationRule
    search: MotionSearch
    rays: Rays
    cells: CellLists
    errors: LawErrors
    least: int
