"""Solved states of the sheet as a scene, interpolated between the equilibria.

Displacements and the forces of a contact run through the keyframes as monotone cubics in time (Fritsch
and Butland 1984, doi:10.1137/0905021), component by component: nothing overshoots, and a keyframe is
reproduced
exactly. A contact starts and ends with zero force at the adjacent keyframes without it, unless it reaches
the first or last
keyframe of the scene. A body that only grazes the face is no contact (`GRAZING_SHARE`).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float32, Float64

from manytouch.simulation.scene.deformation import (
    Deformation,
    TrueContact,
    contact_from_row,
    row_from_contact,
)
from manytouch.simulation.scene.moving_sheet import PointMotion
from manytouch.values.arrays import Points2, Points3, read_only

GRAZING_SHARE = 0.01
"""A body touches a face that it does not press below its place at rest with more than this share of its
largest normal force. A neighbour that squeezes a pad raises the face around it by some micrometres; a body
that stands at the face then has a thousandth of its force, which nothing shows."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactEpisode:
    """One touch from the keyframe before it to the keyframe after it.

    Attributes:
        first: its first keyframe; zero force there and in its last one, unless it reaches the first or last
            keyframe of the scene.
        table: (n, 12) force, torque, area, centre, depth, region and moments at its keyframes.
        grazing_N: normal force up to which the body only grazes the face where this is not below its rest.
    """

    first: int
    grazing_N: float
    table: Float64[np.ndarray, "n 12"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SolidScene:
    """A sheet that was solved at keyframes.

    Attributes:
        name: display name; also the source name `sim:NAME`.
        time_s: (k,) of the keyframes, increasing from 0; the last one is the end of a cycle.
        states: one for each.
        seed: of the image noise.
        duration_s: total; the keyframes repeat.
    """

    name: str
    time_s: Float64[np.ndarray, " k"]
    states: tuple[Deformation, ...]
    seed: int = 0
    duration_s: float
    _faces_mm: Float32[np.ndarray, "k a b 3"] = field(init=False, repr=False)
    _contact_faces_mm: Float32[np.ndarray, "k a b 3"] = field(init=False, repr=False)
    _episodes: tuple[ContactEpisode, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if len(self.states) != len(self.time_s):
            raise ValueError(f"there are {len(self.states)} states for {len(self.time_s)} keyframes")
        faces_mm = np.stack([state.face_mm for state in self.states])
        is_pad = any(state.contact_face_mm is not None for state in self.states)
        touched_mm = np.stack([state.touched.face_mm for state in self.states]) if is_pad else faces_mm
        object.__setattr__(self, "_faces_mm", faces_mm)
        object.__setattr__(self, "_contact_faces_mm", touched_mm)
        object.__setattr__(self, "_episodes", _episodes(self.states))

    def with_duration(self, duration_s: float) -> "SolidScene":
        """This scene, cut or repeated to another duration."""
        return replace(self, duration_s=duration_s)

    def face(self, time_s: float) -> Deformation:
        """The camera-side face at a time, without contacts."""
        return self._deformation(self._faces_mm, time_s)

    def contact_face(self, time_s: float) -> Deformation:
        """The contact face of a pad at a time, without contacts; of a clamped sheet its camera-side face."""
        return self._deformation(self._contact_faces_mm, time_s)

    def motion_of(self, place_mm: Points2, height_mm: float = 0.0) -> PointMotion:
        """See `MovingSheet`: points off the face stay on its normal."""
        place_mm = np.ascontiguousarray(place_mm)

        def displacement_mm(time_s: float) -> Points3:
            return self.face(time_s).moved_mm(place_mm, height_mm)

        return displacement_mm

    def contact_face_motion_of(self, place_mm: Points2) -> PointMotion:
        """See `MovingSheet`."""
        place_mm = np.ascontiguousarray(place_mm)

        def displacement_mm(time_s: float) -> Points3:
            return self.contact_face(time_s).displacement_mm(place_mm)

        return displacement_mm

    def contacts(self, time_s: float) -> dict[int, TrueContact]:
        """Contacts at a time, by an id that is never used again."""
        number, local_s = self._local(time_s)
        found = {}
        for id_, episode in enumerate(self._episodes):
            span_s = self.time_s[episode.first : episode.first + len(episode.table)]
            if span_s[0] <= local_s <= span_s[-1]:
                row = monotone(span_s, episode.table, local_s)
                if _is_touching(-row[2], row[7], episode.grazing_N):
                    found[number * len(self._episodes) + id_] = contact_from_row(row)
        return found

    @property
    def touch_count(self) -> int:
        """Touches of one round."""
        return len(self._episodes)

    def _deformation(self, faces_mm: Float32[np.ndarray, "k a b 3"], time_s: float) -> Deformation:
        """A face between the keyframes, on the grid of the states."""
        _, local_s = self._local(time_s)
        face_mm = read_only(monotone(self.time_s, faces_mm, local_s))
        return replace(self.states[0], face_mm=face_mm, contact_face_mm=None, contacts=(), status="ok")

    def _local(self, time_s: float) -> tuple[int, float]:
        """The round, and the time in it."""
        number, local_s = divmod(max(time_s, 0.0), float(self.time_s[-1]))
        return int(number), local_s


def monotone(time_s: np.ndarray, value: np.ndarray, at_s: float) -> np.ndarray:
    """Values (k, ...) at rising times, between them at one time; at rest before and after all of them."""
    if len(time_s) == 1:
        return np.asarray(value[0]).copy()
    place = int(np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(time_s) - 2))
    width = float(time_s[place + 1] - time_s[place])
    share = min(max((at_s - float(time_s[place])) / width, 0.0), 1.0)
    begin, end = value[place], value[place + 1]
    if share == 0.0:
        return np.asarray(begin).copy()
    out = begin + np.asarray(share**2 * (3.0 - 2.0 * share), dtype=value.dtype) * (end - begin)
    for at, weight in ((place, share * (1.0 - share) ** 2), (place + 1, share**2 * (share - 1.0))):
        out += np.asarray(weight * width, dtype=value.dtype) * _slope(time_s, value, at)
    return np.asarray(out)


def _slope(time_s: np.ndarray, value: np.ndarray, at: int) -> np.ndarray:
    """Change per second at a keyframe: the weighted harmonic mean of both sides, none at the ends."""
    if at in {0, len(time_s) - 1}:
        return np.zeros_like(value[at])
    before, after = float(time_s[at] - time_s[at - 1]), float(time_s[at + 1] - time_s[at])
    left, right = (value[at] - value[at - 1]) / before, (value[at + 1] - value[at]) / after
    share = (before + 2.0 * after) / (3.0 * (before + after))
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = left * right / (share * right + (1.0 - share) * left)
    return np.where(left * right > 0.0, mean, 0.0).astype(value.dtype)


def _episodes(states: tuple[Deformation, ...]) -> tuple[ContactEpisode, ...]:
    """Each touch of each body, in the order of their beginnings."""
    found = []
    bodies = max((len(state.contacts) for state in states), default=0)
    for body in range(bodies):
        contacts = [state.contacts[body] if body < len(state.contacts) else None for state in states]
        normal_N = [0.0 if contact is None else contact.normal_force_N for contact in contacts]
        grazing_N = GRAZING_SHARE * float(np.abs(normal_N).max())
        depth_mm = [np.nan if contact is None else contact.depth_mm for contact in contacts]
        pairs = zip(normal_N, depth_mm, strict=True)
        touches = np.array([_is_touching(*pair, grazing_N) for pair in pairs])
        edge = np.flatnonzero(np.diff(np.concatenate([[False], touches, [False]]).astype(np.int8)))
        for begin, end in edge.reshape(-1, 2):
            rows = [row_from_contact(contact) for contact in contacts[begin:end] if contact is not None]
            if begin > 0:
                rows.insert(0, _fading(rows[0], states[begin - 1]))
            if end < len(states):
                rows.append(_fading(rows[-1], states[end]))
            episode = ContactEpisode(first=max(int(begin) - 1, 0), table=np.array(rows), grazing_N=grazing_N)
            found.append((int(begin), body, episode))
    return tuple(episode for _, _, episode in sorted(found, key=lambda item: item[:2]))


def _is_touching(normal_N: float, depth_mm: float, grazing_N: float) -> bool:
    """Whether a body passes on a normal force; where the face is not pressed in, more than a grazing one."""
    return bool(abs(normal_N) > (0.0 if depth_mm > 0.0 else grazing_N))


def _fading(row: list[float], state: Deformation) -> list[float]:
    """A contact where it begins or ends: no force, its last place, as deep as the sheet is there."""
    centre_mm = np.array([row[5:7]])
    depth_mm = -float(state.touched.displacement_mm(centre_mm)[0, 2])
    return [0.0, 0.0, 0.0, 0.0, 0.0, *row[5:7], depth_mm, *row[8:]]
