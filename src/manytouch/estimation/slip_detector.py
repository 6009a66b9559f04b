"""Does a contact slide? Its shear over its normal force no longer grows while it moves (Coulomb)."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from manytouch.values import Contact, Contacts, Phase


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SlipState:
    """What is remembered of the contacts, by their ids.

    Attributes:
        ratio: largest shear over normal force so far, fading.
        centre_mm: (2,) where each was, following it slowly.
    """

    ratio: Mapping[int, float] = field(default_factory=lambda: MappingProxyType({}))
    centre_mm: Mapping[int, np.ndarray] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SlipDetector:
    """Sets the slip flag of contacts.

    Attributes:
        least_ratio: shear over normal force below which nothing slips that mechanics could tell.
        saturated: share of the largest ratio so far that still counts as the largest.
        fade: part of the largest ratio that is left a frame later.
        moves_pitch: a contact moves when it is this far from where it was lately, in pitches.
        follow: share by which "lately" follows in a frame.
    """

    least_ratio: float = 0.1
    saturated: float = 0.85
    fade: float = 0.99
    moves_pitch: float = 0.1
    follow: float = 0.3

    def __call__(self, state: SlipState, contacts: Contacts, pitch_mm: float) -> tuple[SlipState, Contacts]:
        """The contacts with their flags; None where the normal force is not known."""
        told: list[Contact] = []
        ratios, centres = {}, {}
        for contact in contacts.contacts:
            ratio = float(np.hypot(*contact.shear_over_E_mm2)) / contact.normal_force_over_E_mm2
            if contact.phase is Phase.END or not np.isfinite(ratio):
                told.append(contact)
                continue
            largest = max(ratio, self.fade * state.ratio.get(contact.id, 0.0))
            lately_mm = state.centre_mm.get(contact.id, contact.centre_mm)
            away_mm = contact.centre_mm - lately_mm
            is_moving = float(np.hypot(*away_mm)) > self.moves_pitch * pitch_mm
            is_full = ratio >= max(self.least_ratio, self.saturated * largest)
            told.append(replace(contact, slip=bool(is_moving and is_full)))
            ratios[contact.id], centres[contact.id] = largest, lately_mm + self.follow * away_mm
        grips = SlipState(ratio=MappingProxyType(ratios), centre_mm=MappingProxyType(centres))
        return grips, replace(contacts, contacts=tuple(told))
