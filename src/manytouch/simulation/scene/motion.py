"""How rigid bodies move on the sheet in time: press, slide, roll, tap, or any path through given points.

Between two waypoints a body goes with the smooth step s^2 (3 - 2 s), so it rests at each of them.
Depth is that of its lowest point below the undeformed touched face; above it depth is negative.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from manytouch.errors import SourceError
from manytouch.limits import MAX_SCENE_KEYFRAMES
from manytouch.simulation.fem.contact.indenters import Indenter
from manytouch.simulation.fem.loading import IndenterPath, Loading
from manytouch.values.arrays import Scalars, read_only

PARKED_MM = 1.0
"""Height above the undeformed face at which a body waits before and after it presses."""
APPROACH_S = 0.1
"""Time from there to the face."""
LEVER_MM = 10.0
"""A turn of 1 rad counts as so much motion where keyframes are chosen; a choice."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Trajectory:
    """Place and orientation of a body over time.

    Attributes:
        time_s: (w,) of the waypoints, increasing; before the first and after the last it rests there.
        place_mm: (w, 3) x, y, depth.
        rotation_vector: (w, 3) of its frame (Rodrigues, rad), sheet_from_indenter.
    """

    time_s: Float64[np.ndarray, " w"]
    place_mm: Float64[np.ndarray, "w 3"]
    rotation_vector: Float64[np.ndarray, "w 3"]

    def at(self, time_s: Scalars) -> tuple[Float64[np.ndarray, "n 3"], Float64[np.ndarray, "n 3"]]:
        """Places (n, 3) x, y, depth and rotation vectors (n, 3) at times."""
        after = np.clip(np.searchsorted(self.time_s, time_s, side="right"), 1, len(self.time_s) - 1)
        begin, end = self.time_s[after - 1], self.time_s[after]
        share = np.clip((time_s - begin) / (end - begin), 0.0, 1.0)
        share = (share**2 * (3.0 - 2.0 * share))[:, None]
        places, turns = (
            waypoint[after - 1] + share * (waypoint[after] - waypoint[after - 1])
            for waypoint in (self.place_mm, self.rotation_vector)
        )
        return places, turns


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Body:
    """A rigid body and its trajectory.

    Attributes:
        indenter: its shape.
        trajectory: where it goes.
        friction: Coulomb's coefficient against the sheet.
        pivot_mm: height above its lowest point of the point about which it turns.
    """

    indenter: Indenter
    trajectory: Trajectory
    friction: float = 0.0
    pivot_mm: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldPress:
    """A time at which a body rests on the sheet.

    Attributes:
        time_s: the middle of the rest.
        x_mm, y_mm: its place.
    """

    time_s: float
    x_mm: float
    y_mm: float


def held_presses(bodies: tuple[Body, ...]) -> tuple[HeldPress, ...]:
    """The times at which bodies rest pressed between waypoints, in order; they may turn about the normal."""
    found = []
    for body in bodies:
        path = body.trajectory
        for before, after in pairwise(range(len(path.time_s))):
            place = path.place_mm[before]
            tilts = path.rotation_vector[[before, after], :2]
            is_same = np.array_equal(place, path.place_mm[after]) and np.array_equal(*tilts)
            if is_same and place[2] > 0.0:
                middle_s = float(path.time_s[before] + path.time_s[after]) / 2
                found.append(HeldPress(time_s=round(middle_s, 6), x_mm=float(place[0]), y_mm=float(place[1])))
    return tuple(sorted(found, key=lambda press: press.time_s))


def require_ramps(start_s: float, end_s: float, ramp_s: float) -> None:
    """Check the times of a press.

    Raises:
        ValueError: the ramps do not fit between start and end.
    """
    if not 0.0 < ramp_s <= 0.5 * (end_s - start_s):
        raise ValueError(
            f"a ramp of {ramp_s:g} s down and another up do not fit between {start_s:g} s and {end_s:g} s"
        )


def press_trajectory(
    start_s: float,
    end_s: float,
    *,
    from_mm: tuple[float, float],
    to_mm: tuple[float, float] | None = None,
    depth_mm: float,
    ramp_s: float,
    turn_from: tuple[float, float, float] = (0.0, 0.0, 0.0),
    turn_to: tuple[float, float, float] | None = None,
) -> Trajectory:
    """Down at a place, on to another and another orientation, up; it meets the flat sheet at start_s.

    Raises:
        ValueError: the ramps do not fit between start and end.
    """
    require_ramps(start_s, end_s, ramp_s)
    to_mm, turn_to = to_mm or from_mm, turn_to or turn_from
    down_s, up_s = start_s + ramp_s, end_s - ramp_s
    times = [start_s - APPROACH_S, start_s, down_s, up_s, end_s, end_s + APPROACH_S]
    depths = [-PARKED_MM, 0.0, depth_mm, depth_mm, 0.0, -PARKED_MM]
    rows = [(*(from_mm if place < 3 else to_mm), depth) for place, depth in enumerate(depths)]
    turns = [turn_from] * 3 + [turn_to] * 3
    kept = [0, 1, 2, 3, 4, 5] if up_s > down_s + 1e-9 else [0, 1, 2, 4, 5]
    return Trajectory(
        time_s=read_only(np.array(times)[kept]),
        place_mm=read_only(np.array(rows)[kept]),
        rotation_vector=read_only(np.array(turns)[kept]),
    )


def concatenate_trajectories(trajectories: list[Trajectory]) -> Trajectory:
    """One trajectory after the other; between them the body moves straight over.

    Raises:
        ValueError: they overlap in time.
    """
    time_s = np.concatenate([each.time_s for each in trajectories])
    if np.any(np.diff(time_s) <= 0.0):
        raise ValueError(
            f"the motions of a body overlap in time: it leaves the sheet for {APPROACH_S:g} s after each and "
            f"comes back in the {APPROACH_S:g} s before the next, so there must be more than "
            f"{2 * APPROACH_S:g} s between the end_s of one and the start_s of the next"
        )
    return Trajectory(
        time_s=read_only(time_s),
        place_mm=read_only(np.concatenate([each.place_mm for each in trajectories])),
        rotation_vector=read_only(np.concatenate([each.rotation_vector for each in trajectories])),
    )


def keyframe_times(bodies: tuple[Body, ...], duration_s: float, *, step_mm: float) -> Scalars:
    """Times (k,), from 0 to the end, at which equilibria are enough.

    All waypoints on the sheet, and between them steps in which nothing near the sheet goes further than
    step_mm.
    """
    waypoints = [body.trajectory.time_s[body.trajectory.place_mm[:, 2] >= 0.0] for body in bodies]
    events = np.unique(np.round(np.clip(np.concatenate([[0.0, duration_s], *waypoints]), 0.0, duration_s), 6))
    times = [0.0]
    for begin, end in pairwise(events):
        line = np.linspace(begin, end, 33)
        travel_mm = max((_farthest_mm(body.trajectory, line) for body in bodies), default=0.0)
        wanted = travel_mm * 32 / step_mm
        if wanted > MAX_SCENE_KEYFRAMES - len(times):
            raise SourceError(
                f"steps of {step_mm:g} mm make more than {MAX_SCENE_KEYFRAMES} equilibria: choose a larger "
                "step_mm, or shorter motions of the bodies"
            )
        parts = max(1, math.ceil(wanted - 1e-9))
        times += (begin + (end - begin) * np.arange(1, parts + 1) / parts).tolist()
    return read_only(np.round(np.array(times), 6))


def _farthest_mm(trajectory: Trajectory, time_s: Scalars) -> float:
    """How far it goes at most from one time to the next; nothing as long as it is in the air."""
    places, turns = trajectory.at(time_s)
    moved_mm = np.linalg.norm(np.diff(places, axis=0), axis=1)
    moved_mm += LEVER_MM * np.linalg.norm(np.diff(turns, axis=0), axis=1)
    return float(moved_mm[np.maximum(places[:-1, 2], places[1:, 2]) > 0.0].max(initial=0.0))


def poses(
    bodies: tuple[Body, ...], time_s: float, *, thickness_mm: float
) -> Iterator[tuple[Body, np.ndarray, np.ndarray]]:
    """Each body, where its frame's origin is at a time (3,) and how it is turned (3,)."""
    if not bodies:
        return
    single = loading(bodies, np.array([time_s]), thickness_mm=thickness_mm)
    for body, touch in zip(bodies, single.touches, strict=True):
        yield body, touch.position_mm[0], touch.rotation_vector[0]


def loading(bodies: tuple[Body, ...], time_s: Scalars, *, thickness_mm: float) -> Loading:
    """The steps of a loading at keyframes, rounded to 0.1 um so that they are the same everywhere."""
    touches = []
    for body in bodies:
        places, turns = body.trajectory.at(time_s)
        arm_mm = np.array([0.0, 0.0, body.pivot_mm])
        position_mm = places * [1.0, 1.0, -1.0] + [0.0, 0.0, thickness_mm] + arm_mm
        position_mm -= Rotation.from_rotvec(turns).apply(arm_mm)
        touches.append(
            IndenterPath(
                indenter=body.indenter,
                position_mm=read_only(np.round(position_mm, 4) + 0.0),
                rotation_vector=read_only(np.round(turns, 6) + 0.0),
                friction=body.friction,
            )
        )
    return Loading(touches=tuple(touches))
