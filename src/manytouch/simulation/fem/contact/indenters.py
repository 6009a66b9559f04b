"""Rigid indenters as values, each a signed-distance function.

The lowest point of each body is the origin of its own frame, and it extends to +z; its position is that of
this point. So a press of depth d at (x, y) has the position (x, y, thickness - d).
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull

from manytouch.compilation import kernel, no_type_check
from manytouch.simulation.fem.contact import distance
from manytouch.values.arrays import Points3, read_only

PUNCH_HEIGHT_MM = 40.0
"""Height of punches where none is given; what is above does not touch."""


def _require_positive(**lengths_mm: float) -> None:
    for name, length_mm in lengths_mm.items():
        if not 0.0 < length_mm < math.inf:
            raise ValueError(f"{name} is {length_mm}, expected a positive length in mm")


def _require_edge(edge_mm: float, limit_mm: float) -> None:
    if not 0.0 < edge_mm <= limit_mm:
        raise ValueError(f"edge_radius_mm is {edge_mm}, expected a length above 0 and at most {limit_mm} mm")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sphere:
    """A ball."""

    radius_mm: float

    def __post_init__(self) -> None:
        _require_positive(radius_mm=self.radius_mm)

    @property
    def distance_parameters(self) -> tuple[int, tuple[float, ...]]:
        """Kind and parameters for `distance.signed_distance`."""
        return distance.SPHERE, (self.radius_mm,)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Fingertip:
    """An ellipsoid with its axes along those of its frame; (7, 10, 6) mm is a finger that lies flat."""

    semi_axes_mm: tuple[float, float, float]

    def __post_init__(self) -> None:
        _require_positive(
            **{f"semi_axes_mm[{axis}]": length for axis, length in enumerate(self.semi_axes_mm)}
        )

    @property
    def distance_parameters(self) -> tuple[int, tuple[float, ...]]:
        """Kind and parameters for `distance.signed_distance`."""
        return distance.ELLIPSOID, self.semi_axes_mm


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoundPunch:
    """An upright cylinder with a flat end, its edge rounded."""

    radius_mm: float
    edge_radius_mm: float = 0.5
    height_mm: float = PUNCH_HEIGHT_MM

    def __post_init__(self) -> None:
        _require_positive(radius_mm=self.radius_mm, height_mm=self.height_mm)
        _require_edge(self.edge_radius_mm, min(self.radius_mm, 0.5 * self.height_mm))

    @property
    def distance_parameters(self) -> tuple[int, tuple[float, ...]]:
        """Kind and parameters for `distance.signed_distance`."""
        half = 0.5 * self.height_mm
        return distance.REVOLVED, (self.radius_mm, half, self.edge_radius_mm, 2.0, half)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LyingCylinder:
    """A cylinder that lies on its side along x of its frame, its ends flat with rounded edges."""

    radius_mm: float
    length_mm: float
    edge_radius_mm: float = 0.5

    def __post_init__(self) -> None:
        _require_positive(radius_mm=self.radius_mm, length_mm=self.length_mm)
        _require_edge(self.edge_radius_mm, min(self.radius_mm, 0.5 * self.length_mm))

    @property
    def distance_parameters(self) -> tuple[int, tuple[float, ...]]:
        """Kind and parameters for `distance.signed_distance`."""
        return distance.REVOLVED, (
            self.radius_mm,
            0.5 * self.length_mm,
            self.edge_radius_mm,
            0.0,
            self.radius_mm,
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SquarePunch:
    """An upright block with a flat rectangular end, all edges rounded."""

    side_mm: tuple[float, float]
    edge_radius_mm: float = 0.5
    height_mm: float = PUNCH_HEIGHT_MM

    def __post_init__(self) -> None:
        _require_positive(side_x_mm=self.side_mm[0], side_y_mm=self.side_mm[1], height_mm=self.height_mm)
        _require_edge(self.edge_radius_mm, 0.5 * min(*self.side_mm, self.height_mm))

    @property
    def distance_parameters(self) -> tuple[int, tuple[float, ...]]:
        """Kind and parameters for `distance.signed_distance`."""
        half = (0.5 * self.side_mm[0], 0.5 * self.side_mm[1], 0.5 * self.height_mm)
        return distance.BOX, (*half, self.edge_radius_mm)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ConvexBody:
    """The points with normal . x <= offset for every face, its edges and corners rounded.

    The distance is exact in front of the faces; between faces it is their soft maximum
    log(sum exp(s d_i)) / s with s = sqrt(2) / edge radius, whose level 0 has that radius where two
    faces meet at a right angle.

    Attributes:
        normal: (k, 3) outward unit normals.
        offset_mm: (k,).
        edge_radius_mm: see above.
    """

    normal: Points3
    offset_mm: Float64[np.ndarray, " k"]
    edge_radius_mm: float = 0.3

    def __post_init__(self) -> None:
        _require_positive(edge_radius_mm=self.edge_radius_mm)

    @property
    def distance_parameters(self) -> tuple[int, tuple[float, ...]]:
        """Kind and parameters for `distance.signed_distance`."""
        faces = np.column_stack([self.normal, self.offset_mm])
        sharpness = math.sqrt(2.0) / self.edge_radius_mm
        return distance.HALF_SPACES, (sharpness, float(len(faces)), *faces.ravel().tolist())


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Ring:
    """A ring of round wire that lies flat.

    Attributes:
        radius_mm: of the centre line of its wire.
        wire_radius_mm: of the wire.
    """

    radius_mm: float
    wire_radius_mm: float

    def __post_init__(self) -> None:
        _require_positive(radius_mm=self.radius_mm, wire_radius_mm=self.wire_radius_mm)
        if not self.wire_radius_mm < self.radius_mm:
            raise ValueError(
                f"wire_radius_mm is {self.wire_radius_mm}, expected less than {self.radius_mm} mm"
            )

    @property
    def distance_parameters(self) -> tuple[int, tuple[float, ...]]:
        """Kind and parameters for `distance.signed_distance`."""
        return distance.TORUS, (self.radius_mm, self.wire_radius_mm)


Indenter = Sphere | Fingertip | RoundPunch | SquarePunch | LyingCylinder | ConvexBody | Ring


def convex_hull(corner_mm: Points3, *, edge_radius_mm: float = 0.3) -> ConvexBody:
    """The convex hull of points (n, 3), moved along z so that its lowest point is at z = 0."""
    faces = np.unique(np.round(ConvexHull(corner_mm).equations, 9), axis=0)
    lift_mm = float(corner_mm[:, 2].min())
    return ConvexBody(
        normal=read_only(np.ascontiguousarray(faces[:, :3])),
        offset_mm=read_only(-faces[:, 3] - lift_mm * faces[:, 2]),
        edge_radius_mm=edge_radius_mm,
    )


def pack(indenters: tuple[Indenter, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Kinds (t,) and parameters (t, longest) of indenters for `distance.signed_distance`."""
    described = [indenter.distance_parameters for indenter in indenters]
    table = np.zeros((len(described), max((len(numbers) for _, numbers in described), default=1)))
    for row, (_, numbers) in zip(table, described, strict=True):
        row[: len(numbers)] = numbers
    return np.array([kind for kind, _ in described], dtype=np.int64), table


def signed_distance(
    indenter: Indenter, point_mm: Points3
) -> tuple[Float64[np.ndarray, " n"], Points3, Float64[np.ndarray, "n 3 3"]]:
    """Signed distances (n,) in mm, gradients (n, 3) and Hessians (n, 3, 3) at points of the indenter's frame.

    Distances are negative inside; gradients point out of the body.
    """
    kind, numbers = pack((indenter,))
    value, gradient = np.empty(len(point_mm)), np.empty((len(point_mm), 3))
    hessian = np.empty((len(point_mm), 3, 3))
    _fill_distances(kind[0], numbers[0], point_mm, value, gradient, hessian)
    return value, gradient, hessian


@kernel()
@no_type_check
def _fill_distances(  # noqa: PLR0917 - compiled
    kind: int,
    numbers: np.ndarray,
    point: np.ndarray,
    value: np.ndarray,
    gradient: np.ndarray,
    hessian: np.ndarray,
) -> None:
    for n in range(point.shape[0]):
        value[n] = distance.signed_distance(kind, numbers, point[n], gradient[n], hessian[n])
