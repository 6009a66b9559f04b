"""Identities and phases of contacts over frames.

Contacts of two frames are paired so that the sum of squared distances is smallest (H. W. Kuhn, "The
Hungarian method for the assignment problem", 1955, doi:10.1002/nav.3800020109), and only within a gate.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.optimize import linear_sum_assignment

from manytouch.errors import SensorError
from manytouch.estimation.frame_interval import USUAL_S
from manytouch.values import Contact, Contacts, Phase, Sensor, Status
from manytouch.values.arrays import Mask, Points2, Scalars

_UNUSABLE_FRAMES = 10  # a choice: a frame that is not ok is no evidence that a contact has ended


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactTrack:
    """A contact that is followed over frames.

    Attributes:
        contact: in the last frame that showed it; its id is -1 until it is confirmed.
        given: id with which the contact was found in that frame; -1 without one.
        seen: number of frames that showed it.
        unseen: number of frames since the last of these.
        age_s: time since the first of them.
    """

    contact: Contact
    seen: int
    unseen: int = 0
    given: int = -1
    age_s: float = 0.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactTrackerState:
    """What a tracker keeps between frames.

    Attributes:
        tracks: of contacts that are confirmed or wait for it.
        next_id: the next identity.
        gate_mm: largest distance that a contact moves in a frame.
    """

    tracks: tuple[ContactTrack, ...] = ()
    next_id: int = 0
    gate_mm: float

    @property
    def touching(self) -> tuple[Contact, ...]:
        """The confirmed contacts of the last frame."""
        return tuple(track.contact for track in self.tracks if track.contact.id >= 0)

    @property
    def touching_s(self) -> Scalars:
        """(k,) for how long there has been each of these."""
        return np.array([track.age_s for track in self.tracks if track.contact.id >= 0], dtype=np.float64)


def nowhere(place_mm: Points2) -> Mask:
    """(k,) that nothing loads the sheet at places (k, 2)."""
    return np.zeros(len(place_mm), dtype=np.bool_)


State = TypeVar("State")


def with_tracks_of(started: State, before: State) -> State:
    """The state of an estimator, with the contact tracks of another one of the same type.

    Tracks are found wherever they are within the state.
    """
    if isinstance(started, ContactTrackerState) and isinstance(before, ContactTrackerState):
        return replace(started, tracks=before.tracks, next_id=before.next_id)
    if type(started) is not type(before) or not is_dataclass(started) or isinstance(started, type):
        return started
    present = {field.name: getattr(started, field.name) for field in fields(started) if field.init}
    taken = {name: with_tracks_of(value, getattr(before, name)) for name, value in present.items()}
    changed = {name: value for name, value in taken.items() if value is not present[name]}
    return replace(started, **changed) if changed else started


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactTracker:
    """Assigns lasting identities and phases to contacts.

    Attributes:
        gate_pitch: largest distance that a contact moves from frame to frame, in pitches of the layout.
        gate_stds: this many standard deviations of its centre are added to that distance.
        confirm_frames: a contact starts when it was found in this many frames in a row.
        bridge_frames: a contact that is not found lasts for this many frames if something still loads the
            sheet there; ten times as many of frames whose status is not "ok", whatever loads the sheet.
        absorbed: a contact that is not found ends at once if another one has become one with it: the other
            has moved at least this share of the way to the centre of their forces, and extends to the place
            of the contact that is not found or has gained at least this share of its force.
    """

    gate_pitch: float = 2.0
    gate_stds: float = 0.0
    confirm_frames: int = 2
    bridge_frames: int = 2
    absorbed: float = 0.5

    def start(self, sensor: Sensor) -> ContactTrackerState:
        """The state without contacts.

        Raises:
            SensorError: the sensor has no layout, so that the gate has no unit.
        """
        if sensor.layout is None:
            raise SensorError(
                f"sensor {sensor.name!r} has no [markers], but the distances of contacts are in pitches; "
                "run `manytouch calibrate rest` first"
            )
        return ContactTrackerState(gate_mm=self.gate_pitch * float(np.sqrt(np.prod(sensor.layout.pitch_mm))))

    def step(
        self,
        state: ContactTrackerState,
        found: Sequence[Contact],
        *,
        may_start: Sequence[bool] | None = None,
        is_loaded: Callable[[Contact], bool] | None = None,
        status: Status = Status.OK,
        elapsed_s: float = USUAL_S,
    ) -> tuple[ContactTrackerState, Contacts]:
        """Identifies the contacts of the next frame.

        Args:
            state: of the frame before.
            found: contacts of the frame; their phases are ignored. An id that is not -1, of another tracker,
                continues the contact that was found with it in the last frame.
            may_start: which of them are clear enough to start a contact; the others only continue one.
                None: all.
            is_loaded: of a contact of an earlier frame, whether something may still load the sheet there. A
                contact that is not found ends at once if this is False. None: always True. It is called only
                if the status is "ok".
            status: of the frame; unless it is "ok" no contact ends because it is not found, for up to
                ten times `bridge_frames`.
            elapsed_s: time since the frame before.

        Returns:
            The new state, and the contacts in the order of their ids: those that touch, with phase start
            or move, and those that end in this frame, with their last values.
        """
        allowed = [True] * len(found) if may_start is None else list(may_start)
        partner = self._assign(state, found)
        next_id = state.next_id
        tracks: list[ContactTrack] = []
        reported: list[Contact] = []
        for index, before in enumerate(state.tracks):
            track = replace(before, age_s=before.age_s + elapsed_s)
            if index in partner:
                now = found[partner[index]]
                continued = replace(
                    track,
                    contact=replace(now, id=track.contact.id),
                    seen=track.seen + 1,
                    unseen=0,
                    given=now.id,
                )
                continued, next_id = self._confirm(continued, next_id)
            elif track.contact.id < 0:
                continue
            elif not self._may_last(track, is_loaded, status) or self._is_absorbed(
                state, track, found, partner
            ):
                reported.append(replace(track.contact, phase=Phase.END))
                continue
            else:
                kept = _kept(track.contact, track.unseen, status)
                continued = replace(track, contact=kept, unseen=track.unseen + 1)
            tracks.append(continued)
        assigned = set(partner.values())
        for number, contact in enumerate(found):
            if number not in assigned and allowed[number]:
                track = ContactTrack(contact=replace(contact, id=-1), seen=1, given=contact.id)
                new, next_id = self._confirm(track, next_id)
                tracks.append(new)
        reported += [track.contact for track in tracks if track.contact.id >= 0]
        reported.sort(key=lambda contact: contact.id)
        after = ContactTrackerState(tracks=tuple(tracks), next_id=next_id, gate_mm=state.gate_mm)
        return after, Contacts(contacts=tuple(reported), status=status)

    def _assign(self, state: ContactTrackerState, found: Sequence[Contact]) -> dict[int, int]:
        """Index in `found` for the index of each track that continues."""
        if not state.tracks or not found:
            return {}
        number = {contact.id: index for index, contact in enumerate(found) if contact.id >= 0}
        known = {
            index: number[track.given] for index, track in enumerate(state.tracks) if track.given in number
        }
        before = np.array([track.contact.centre_mm for track in state.tracks])
        now = np.array([contact.centre_mm for contact in found])
        distance = np.linalg.norm(before[:, None] - now, axis=-1)
        distance[list(known)] = np.inf
        distance[:, list(known.values())] = np.inf
        gate = state.gate_mm * (1.0 + np.array([track.unseen for track in state.tracks]))[:, None]
        if self.gate_stds > 0.0:
            tracked = np.array([_centre_variance_mm2(track.contact) for track in state.tracks])
            seen = np.array([_centre_variance_mm2(contact) for contact in found])
            gate = gate + self.gate_stds * np.sqrt(np.nan_to_num(tracked[:, None] + seen))
        else:
            gate = np.broadcast_to(gate, distance.shape)
        waits = np.array([track.contact.id < 0 for track in state.tracks])[:, None]
        # A pair beyond the gate must cost more than all allowed pairs that it could replace.
        far = (len(before) + len(now)) * 2.0
        cost = np.where(distance <= gate, (distance / gate) ** 2 + 0.5 * waits, far)
        rows, columns = linear_sum_assignment(cost)
        pairs = zip(rows, columns, strict=True)
        return known | {int(r): int(c) for r, c in pairs if distance[r, c] <= gate[r, c]}

    def _confirm(self, track: ContactTrack, next_id: int) -> tuple[ContactTrack, int]:
        """The track, with an identity if it was seen often enough, and the next identity."""
        contact = track.contact
        if contact.id >= 0:
            return replace(track, contact=replace(contact, phase=Phase.MOVE)), next_id
        if track.seen < self.confirm_frames:
            return track, next_id
        return replace(track, contact=replace(contact, id=next_id, phase=Phase.START)), next_id + 1

    def _may_last(
        self, track: ContactTrack, is_loaded: Callable[[Contact], bool] | None, status: Status
    ) -> bool:
        """Whether a contact that was not found in this frame can still be there."""
        if status is not Status.OK:
            return track.unseen < _UNUSABLE_FRAMES * self.bridge_frames
        if track.unseen >= self.bridge_frames:
            return False
        return is_loaded is None or is_loaded(track.contact)

    def _is_absorbed(
        self,
        state: ContactTrackerState,
        track: ContactTrack,
        found: Sequence[Contact],
        partner: dict[int, int],
    ) -> bool:
        """Whether a contact that was not found has become one with another, which now has its force."""
        lost, lost_mm2 = track.contact, track.contact.normal_force_over_E_mm2
        for index, number in partner.items():
            before, now = state.tracks[index].contact, found[number]
            before_mm2, now_mm2 = before.normal_force_over_E_mm2, now.normal_force_over_E_mm2
            way_mm = (lost.centre_mm - before.centre_mm) * lost_mm2 / (lost_mm2 + before_mm2)
            moved = float((now.centre_mm - before.centre_mm) @ way_mm) / max(float(way_mm @ way_mm), 1e-12)
            away_mm = float(np.linalg.norm(now.centre_mm - lost.centre_mm))
            # comparisons with an unknown force or extent (NaN) are False
            has_it = now_mm2 - before_mm2 >= self.absorbed * lost_mm2 or away_mm <= now.half_major_mm
            if away_mm <= state.gate_mm and moved >= self.absorbed and has_it:
                return True
        return False


def _centre_variance_mm2(contact: Contact) -> float:
    """Mean variance of the centre along an axis."""
    return 0.5 * (contact.std("x") ** 2 + contact.std("y") ** 2)


def _kept(contact: Contact, unseen: int, status: Status) -> Contact:
    """The contact in a frame that does not show it: the last values with an increased covariance.

    A frame that is "ok" and does not show a contact shows that it has become weaker: depth, forces and area
    are anything between 0 and their last values, whose mean squared difference from these is a third of
    their square.
    """
    growth = ((unseen + 2.0) / (unseen + 1.0)) ** 2
    covariance = growth * contact.covariance
    if status is Status.OK:
        shear_x_N, shear_y_N, press_N = *contact.force_N[:2], contact.normal_force_N
        weaker = (contact.depth_mm, shear_x_N, shear_y_N, press_N, contact.torque_Nmm, contact.area_mm2)
        last = np.nan_to_num([0.0, 0.0, *weaker])  # in the order of ESTIMATES
        covariance += np.outer(last, last) / 3.0
    covariance.flags.writeable = False
    return replace(contact, phase=Phase.MOVE, covariance=covariance)
