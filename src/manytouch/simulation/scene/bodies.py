"""The bodies of a scene file: their shapes and motions as tables, and what they mean."""

import math
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from manytouch.errors import SourceError
from manytouch.limits import MAX_MESH_BYTES
from manytouch.simulation.fem.contact import indenters
from manytouch.simulation.scene.motion import (
    Body,
    Trajectory,
    concatenate_trajectories,
    press_trajectory,
    require_ramps,
)
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file.sections import NonNegative, Number, Positive, Section

Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
PositivePair = Annotated[list[Positive], Field(min_length=2, max_length=2)]
PositiveTriple = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Row = Annotated[list[Number], Field(min_length=4, max_length=4)]
_USUAL_EDGE_MM = 0.5


class _Shape(Section):
    """A shape; relative paths in it start at the scene's folder."""

    def indenter(self, folder: Path) -> indenters.Indenter:
        raise NotImplementedError

    @property
    def pivot_mm(self) -> float:
        """Height above its lowest point about which it turns."""
        return 0.0


class _Edged(_Shape):
    """A shape with rounded edges."""

    edge_radius_mm: Positive | None = None

    @property
    def widest_edge_mm(self) -> float:
        """Radius of an edge that leaves nothing flat."""
        raise NotImplementedError

    @property
    def edge_mm(self) -> float:
        """The stated radius of the edges, or 0.5 mm, or what is possible if that is less."""
        usual_mm = min(_USUAL_EDGE_MM, self.widest_edge_mm)
        return usual_mm if self.edge_radius_mm is None else self.edge_radius_mm

    @model_validator(mode="after")
    def _has_room_for_its_edges(self) -> Self:
        if self.edge_mm > self.widest_edge_mm:
            raise ValueError(
                f"edge_radius_mm is {self.edge_mm:g}, but of this shape at most {self.widest_edge_mm:g} mm"
            )
        return self


class _Sphere(_Shape):
    kind: Literal["sphere"]
    radius_mm: Positive

    def indenter(self, folder: Path) -> indenters.Indenter:
        return indenters.Sphere(radius_mm=self.radius_mm)

    @property
    def pivot_mm(self) -> float:
        return self.radius_mm


class _Fingertip(_Shape):
    kind: Literal["fingertip"]
    semi_axes_mm: PositiveTriple

    def indenter(self, folder: Path) -> indenters.Indenter:
        x, y, z = self.semi_axes_mm
        return indenters.Fingertip(semi_axes_mm=(x, y, z))

    @property
    def pivot_mm(self) -> float:
        return self.semi_axes_mm[2]


class _RoundPunch(_Edged):
    kind: Literal["round_punch"]
    radius_mm: Positive

    def indenter(self, folder: Path) -> indenters.Indenter:
        return indenters.RoundPunch(radius_mm=self.radius_mm, edge_radius_mm=self.edge_mm)

    @property
    def widest_edge_mm(self) -> float:
        return min(self.radius_mm, 0.5 * indenters.PUNCH_HEIGHT_MM)


class _SquarePunch(_Edged):
    kind: Literal["square_punch"]
    side_mm: PositivePair

    def indenter(self, folder: Path) -> indenters.Indenter:
        x, y = self.side_mm
        return indenters.SquarePunch(side_mm=(x, y), edge_radius_mm=self.edge_mm)

    @property
    def widest_edge_mm(self) -> float:
        return 0.5 * min(*self.side_mm, indenters.PUNCH_HEIGHT_MM)


class _Cylinder(_Edged):
    kind: Literal["cylinder"]
    radius_mm: Positive
    length_mm: Positive

    def indenter(self, folder: Path) -> indenters.Indenter:
        return indenters.LyingCylinder(
            radius_mm=self.radius_mm, length_mm=self.length_mm, edge_radius_mm=self.edge_mm
        )

    @property
    def widest_edge_mm(self) -> float:
        return min(self.radius_mm, 0.5 * self.length_mm)

    @property
    def pivot_mm(self) -> float:
        return self.radius_mm


class _Mesh(_Shape):
    kind: Literal["mesh"]
    file: str
    scale: Positive = 1.0
    edge_radius_mm: Positive = 0.3

    def indenter(self, folder: Path) -> indenters.Indenter:
        corner_mm = self.scale * mesh_corners(folder / self.file)
        middle_mm = 0.5 * (corner_mm.min(axis=0) + corner_mm.max(axis=0))
        corner_mm[:, :2] -= middle_mm[:2]
        return indenters.convex_hull(corner_mm, edge_radius_mm=self.edge_radius_mm)


Shape = Annotated[
    _Sphere | _Fingertip | _RoundPunch | _SquarePunch | _Cylinder | _Mesh, Field(discriminator="kind")
]


def mesh_corners(path: Path) -> np.ndarray:
    """Corners (n, 3) of an .obj file or an .stl file, text or binary, in its own unit.

    Raises:
        SourceError: the file is missing, or has too few corners.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MAX_MESH_BYTES + 1)
    except (OSError, ValueError) as error:
        raise SourceError(f"cannot read the mesh {path}: {error}") from None
    if len(content) > MAX_MESH_BYTES:
        raise SourceError(f"the mesh {path} has more than {MAX_MESH_BYTES // 10**6} MB: simplify it")
    count = int.from_bytes(content[80:84], "little")
    if path.suffix.lower() == ".stl" and len(content) == 84 + 50 * count:
        facet = np.frombuffer(content, dtype=[("numbers", "<f4", 12), ("attribute", "<u2")], offset=84)
        corner = facet["numbers"].reshape(-1, 4, 3)[:, 1:].reshape(-1, 3).astype(np.float64)
    else:
        word = {".stl": "vertex", ".obj": "v"}.get(path.suffix.lower(), "vertex")
        rows = [line.split() for line in content.decode("utf-8", errors="replace").splitlines()]
        try:
            numbers = [[float(text) for text in row[1:4]] for row in rows if row and row[0] == word]
        except ValueError:
            numbers = []
        corner = np.array([row for row in numbers if len(row) == 3]).reshape(-1, 3)
    if len(corner) < 4 or np.linalg.matrix_rank(corner - corner.mean(axis=0), tol=1e-6) < 3:
        raise SourceError(f"{path} is not a mesh of a solid: expected an .stl or .obj file with its corners")
    return corner


class _PressSection(Section):
    """What all motions have in common that press once."""

    depth_mm: Positive
    start_s: NonNegative
    end_s: Positive
    ramp_s: Positive = Field(default=0.25, validate_default=True)

    @field_validator("ramp_s")
    @classmethod
    def _fits(cls, ramp_s: float, info: ValidationInfo) -> float:
        if {"start_s", "end_s"} <= info.data.keys():
            require_ramps(info.data["start_s"], info.data["end_s"], ramp_s)
        return ramp_s


class _Press(_PressSection):
    kind: Literal["press"]
    at_mm: Pair
    turn_deg: Triple = Field(default_factory=lambda: [0.0, 0.0, 0.0])

    def trajectories(self, pivot_mm: float) -> list[Trajectory]:
        return [_pressed(self, _two(self.at_mm), _two(self.at_mm), self.turn_deg, self.turn_deg)]


class _Slide(_PressSection):
    kind: Literal["slide"]
    from_mm: Pair
    to_mm: Pair
    turn_deg: Triple = Field(default_factory=lambda: [0.0, 0.0, 0.0])

    def trajectories(self, pivot_mm: float) -> list[Trajectory]:
        return [_pressed(self, _two(self.from_mm), _two(self.to_mm), self.turn_deg, self.turn_deg)]


class _Roll(_PressSection):
    kind: Literal["roll"]
    at_mm: Pair
    direction_deg: Number
    angle_deg: Number

    def trajectories(self, pivot_mm: float) -> list[Trajectory]:
        """The middle goes as far as the angle's arc is long, from half of it before to half behind at_mm."""
        angle, direction = math.radians(self.angle_deg), math.radians(self.direction_deg)
        ahead = np.array([math.cos(direction), math.sin(direction)])
        half_mm = 0.5 * angle * pivot_mm * ahead
        turn = np.rad2deg(0.5 * angle * np.array([-ahead[1], ahead[0], 0.0])).tolist()
        begin, end = np.array(self.at_mm) - half_mm, np.array(self.at_mm) + half_mm
        return [_pressed(self, _two(begin.tolist()), _two(end.tolist()), [-part for part in turn], turn)]


class _Tap(Section):
    kind: Literal["tap"]
    at_mm: Pair
    depth_mm: Positive
    start_s: NonNegative
    touch_s: Positive = 0.3
    every_s: Positive = 0.6
    times: Annotated[int, Field(gt=0, le=1000)] = 1

    def trajectories(self, pivot_mm: float) -> list[Trajectory]:
        starts = [self.start_s + number * self.every_s for number in range(self.times)]
        at_mm = _two(self.at_mm)
        return [
            press_trajectory(
                start, start + self.touch_s, from_mm=at_mm, depth_mm=self.depth_mm, ramp_s=0.4 * self.touch_s
            )
            for start in starts
        ]


class _CloseIn(_PressSection):
    kind: Literal["close_in"]
    centre_mm: Pair
    direction_deg: Number
    from_distance_mm: Positive
    to_distance_mm: Positive

    def pair(self) -> tuple[Trajectory, Trajectory]:
        """The paths of two bodies on opposite sides of the centre."""
        angle = math.radians(self.direction_deg)
        ahead = np.array([math.cos(angle), math.sin(angle)])
        none = [0.0, 0.0, 0.0]
        sides = []
        for side in (-0.5, 0.5):
            begin, end = (
                _two((np.array(self.centre_mm) + side * apart_mm * ahead).tolist())
                for apart_mm in (self.from_distance_mm, self.to_distance_mm)
            )
            sides.append(_pressed(self, begin, end, none, none))
        return sides[0], sides[1]


class _Path(Section):
    kind: Literal["path"]
    points: Annotated[list[Row], Field(min_length=2, max_length=10_000)]
    turns_deg: Annotated[list[Triple], Field(max_length=10_000)] | None = None

    @field_validator("points")
    @classmethod
    def _increase(cls, points: list[Row]) -> list[Row]:
        if any(later[0] <= earlier[0] for earlier, later in pairwise(points)):
            raise ValueError("the times of points (time_s, x_mm, y_mm, depth_mm) must increase")
        return points

    @field_validator("turns_deg")
    @classmethod
    def _are_as_many(cls, turns_deg: list[Triple] | None, info: ValidationInfo) -> list[Triple] | None:
        points = info.data.get("points")
        if points is not None and turns_deg is not None and len(turns_deg) != len(points):
            raise ValueError(f"{len(turns_deg)} rows are given for {len(points)} points")
        return turns_deg

    def trajectories(self, pivot_mm: float) -> list[Trajectory]:
        rows = np.array(self.points, dtype=np.float64)
        turns = np.zeros((len(rows), 3)) if self.turns_deg is None else np.deg2rad(self.turns_deg)
        return [
            Trajectory(
                time_s=read_only(rows[:, 0].copy()),
                place_mm=read_only(rows[:, 1:].copy()),
                rotation_vector=read_only(np.asarray(turns, dtype=np.float64)),
            )
        ]


Motion = Annotated[_Press | _Slide | _Roll | _Tap | _CloseIn | _Path, Field(discriminator="kind")]


class BodySection(Section):
    """One entry of [[bodies]]."""

    shape: Shape
    friction: NonNegative = 0.0
    motions: Annotated[list[Motion], Field(min_length=1, max_length=1000)]

    @model_validator(mode="after")
    def _moves(self) -> "BodySection":
        if len(self.motions) > 1 and any(isinstance(motion, _CloseIn) for motion in self.motions):
            raise ValueError("close_in moves two bodies of this shape and must be the only motion")
        self._trajectories()
        return self

    def _trajectories(self) -> list[Trajectory]:
        first = self.motions[0]
        if isinstance(first, _CloseIn):
            return list(first.pair())
        trajectories = [
            trajectory
            for motion in self.motions
            if not isinstance(motion, _CloseIn)
            for trajectory in motion.trajectories(self.shape.pivot_mm)
        ]
        return [concatenate_trajectories(trajectories)]

    def depths_mm(self) -> list[tuple[str, float]]:
        """Key and largest depth of each motion."""
        return [
            (f"motions.{number}.points", max(point[3] for point in motion.points))
            if isinstance(motion, _Path)
            else (f"motions.{number}.depth_mm", motion.depth_mm)
            for number, motion in enumerate(self.motions)
        ]

    def bodies(self, folder: Path) -> list[Body]:
        """One body, or two that close in.

        Raises:
            SourceError: a mesh file cannot be read.
        """
        indenter = self.shape.indenter(folder)
        return [
            Body(
                indenter=indenter,
                trajectory=trajectory,
                friction=self.friction,
                pivot_mm=self.shape.pivot_mm,
            )
            for trajectory in self._trajectories()
        ]


def _two(numbers: list[float]) -> tuple[float, float]:
    return float(numbers[0]), float(numbers[1])


def _pressed(
    motion: _PressSection,
    from_mm: tuple[float, float],
    to_mm: tuple[float, float],
    turn_from_deg: list[float],
    turn_to_deg: list[float],
) -> Trajectory:
    begin, end = (tuple(math.radians(part) for part in turn) for turn in (turn_from_deg, turn_to_deg))
    return press_trajectory(
        motion.start_s,
        motion.end_s,
        from_mm=from_mm,
        to_mm=to_mm,
        depth_mm=motion.depth_mm,
        ramp_s=motion.ramp_s,
        turn_from=(begin[0], begin[1], begin[2]),
        turn_to=(end[0], end[1], end[2]),
    )
