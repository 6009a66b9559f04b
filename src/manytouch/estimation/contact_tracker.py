"""Which contact of this frame is which of the last.

Contacts of two frames are paired so that the sum of squared distances is smallest (H. W. Kuhn, "The
Hungarian method for the assignment problem", 1955, doi:10.1002/nav.3800020109), none further than a gate.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from manytouch.errors import SensorError
from manytouch.values import Contact, Contacts, Phase, Sensor
from manytouch.values.arrays import Mask, Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactTrack:
    """A contact that is followed.

    Attributes:
        contact: as it was last seen; its id is -1 while it waits to be confirmed.
        seen: frames in which it was seen so far.
        unseen: frames since it was last seen.
    """

    contact: Contact
    seen: int
    unseen: int = 0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactTrackerState:
    """What is remembered between frames.

    Attributes:
        lives: contacts that last, and those that wait to be confirmed.
        next_id: the first identity that was never given.
        gate_mm: how far a contact may move in a frame.
    """

    lives: tuple[ContactTrack, ...] = ()
    next_id: int = 0
    gate_mm: float

    @property
    def held(self) -> tuple[Contact, ...]:
        """The contacts that were there in the last frame."""
        return tuple(life.contact for life in self.lives if life.contact.id >= 0)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactTracker:
    """Gives contacts identities that stay, and phases.

    Attributes:
        gate_pitch: a contact moves by less than this from frame to frame, in pitches of the layout.
        confirm_frames: it must be found in this many frames in a row before it starts.
        bridge_frames: it may be missing for this many frames without ending, if something is still there.
        absorbed: but it ends at once, having become one with another, when the other has come at least this
            share of the way to where their forces meet, and has at least this share of its force more.
    """

    gate_pitch: float = 2.0
    confirm_frames: int = 2
    bridge_frames: int = 2
    absorbed: float = 0.5

    def start(self, sensor: Sensor) -> ContactTrackerState:
        """Nothing touches yet.

        Raises:
            SensorError: the sensor has no layout, so there is no pitch to measure the gate by.
        """
        if sensor.layout is None:
            raise SensorError(
                f"sensor {sensor.name!r} has no [markers]: contacts are followed in pitches of its layout; "
                "run `manytouch calibrate rest` first"
            )
        return ContactTrackerState(gate_mm=self.gate_pitch * float(np.sqrt(np.prod(sensor.layout.pitch_mm))))

    def step(
        self,
        state: ContactTrackerState,
        found: Sequence[Contact],
        *,
        is_firm: Sequence[bool] | None = None,
        is_there: Callable[[Points2], Mask] | None = None,
        status: str = "ok",
    ) -> tuple[ContactTrackerState, Contacts]:
        """Names the contacts of the next frame.

        Args:
            state: of the frame before.
            found: the frame's contacts; their ids and phases do not matter.
            is_firm: which of them are clear enough to begin a contact; the others only continue one.
                None: all.
            is_there: tells of sheet coordinates (k, 2) in mm whether something may still press there.
                A contact that is not found ends at once where this says no. None: it may be anywhere.
            status: of the frame; unless it is "ok" no contact ends for not being found, up to
                ten times `bridge_frames`.

        Returns:
            The new state, and the contacts in the order of their ids: those that touch, with phase start
            or move, and those that end in this frame, with their last values.
        """
        firm = [True] * len(found) if is_firm is None else list(is_firm)
        partner = self._partners(state, found)
        next_id = state.next_id
        lives: list[ContactTrack] = []
        told: list[Contact] = []
        for index, life in enumerate(state.lives):
            if index in partner:
                grown = ContactTrack(
                    contact=replace(found[partner[index]], id=life.contact.id), seen=life.seen + 1
                )
                grown, next_id = self._confirmed(grown, next_id)
            elif life.contact.id < 0:
                continue
            elif not self._may_last(life, is_there, status) or self._is_absorbed(state, life, found, partner):
                told.append(replace(life.contact, phase=Phase.END))
                continue
            else:
                grown = replace(life, contact=_older(life.contact, life.unseen), unseen=life.unseen + 1)
            lives.append(grown)
        taken = set(partner.values())
        for place, contact in enumerate(found):
            if place not in taken and firm[place]:
                born, next_id = self._confirmed(
                    ContactTrack(contact=replace(contact, id=-1), seen=1), next_id
                )
                lives.append(born)
        told += [life.contact for life in lives if life.contact.id >= 0]
        told.sort(key=lambda contact: contact.id)
        kept = ContactTrackerState(lives=tuple(lives), next_id=next_id, gate_mm=state.gate_mm)
        return kept, Contacts(contacts=tuple(told), status=status)

    def _partners(self, state: ContactTrackerState, found: Sequence[Contact]) -> dict[int, int]:
        """Place in `found` of each life that goes on."""
        if not state.lives or not found:
            return {}
        before = np.array([life.contact.centre_mm for life in state.lives])
        now = np.array([contact.centre_mm for contact in found])
        distance = np.linalg.norm(before[:, None] - now, axis=-1)
        gate = state.gate_mm * (1.0 + np.array([life.unseen for life in state.lives]))[:, None]
        waits = np.array([life.contact.id < 0 for life in state.lives])[:, None]
        # A pair beyond the gate must cost more than any set of allowed ones that it could save.
        far = (len(before) + len(now)) * 2.0
        cost = np.where(distance <= gate, (distance / gate) ** 2 + 0.5 * waits, far)
        rows, columns = linear_sum_assignment(cost)
        return {int(r): int(c) for r, c in zip(rows, columns, strict=True) if distance[r, c] <= gate[r, 0]}

    def _confirmed(self, life: ContactTrack, next_id: int) -> tuple[ContactTrack, int]:
        """The life with an identity once it has been seen often enough."""
        contact = life.contact
        if contact.id >= 0:
            return replace(life, contact=replace(contact, phase=Phase.MOVE)), next_id
        if life.seen < self.confirm_frames:
            return life, next_id
        return replace(life, contact=replace(contact, id=next_id, phase=Phase.START)), next_id + 1

    def _may_last(self, life: ContactTrack, is_there: Callable[[Points2], Mask] | None, status: str) -> bool:
        """May a contact that was not found in this frame still be there?"""
        if status != "ok":
            return life.unseen < 10 * self.bridge_frames
        if life.unseen >= self.bridge_frames:
            return False
        return is_there is None or bool(is_there(life.contact.centre_mm[None, :])[0])

    def _is_absorbed(
        self,
        state: ContactTrackerState,
        life: ContactTrack,
        found: Sequence[Contact],
        partner: dict[int, int],
    ) -> bool:
        """Has a contact that was not found become one with another, which has its force now?"""
        lost, lost_mm2 = life.contact, life.contact.normal_force_over_E_mm2
        for index, place in partner.items():
            before, now = state.lives[index].contact, found[place]
            before_mm2, now_mm2 = before.normal_force_over_E_mm2, now.normal_force_over_E_mm2
            way_mm = (lost.centre_mm - before.centre_mm) * lost_mm2 / (lost_mm2 + before_mm2)
            come = float((now.centre_mm - before.centre_mm) @ way_mm) / max(float(way_mm @ way_mm), 1e-12)
            near = float(np.linalg.norm(now.centre_mm - lost.centre_mm)) <= state.gate_mm
            # comparisons with a force that is not known are False
            if near and come >= self.absorbed and now_mm2 - before_mm2 >= self.absorbed * lost_mm2:
                return True
        return False


def _older(contact: Contact, unseen: int) -> Contact:
    """The contact in a frame that does not show it: the last values, trusted less each time."""
    growth = ((unseen + 2.0) / (unseen + 1.0)) ** 2
    covariance = growth * contact.covariance
    covariance.flags.writeable = False
    return replace(contact, phase=Phase.MOVE, covariance=covariance)
