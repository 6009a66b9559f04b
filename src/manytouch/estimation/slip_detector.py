"""Detects contacts that slide: they move while shear over normal force no longer increases (Coulomb)."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from manytouch.estimation.frame_interval import remaining
from manytouch.values import Contact, Contacts, Phase


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SlipState:
    """Quantities of the contacts by their ids.

    Attributes:
        ratio: largest ratio of shear to normal force so far, decaying.
        centre_mm: (2,) low-pass filtered centre of each contact.
        is_slipping: the last flag of each contact.
    """

    ratio: Mapping[int, float] = field(default_factory=lambda: MappingProxyType({}))
    centre_mm: Mapping[int, np.ndarray] = field(default_factory=lambda: MappingProxyType({}))
    is_slipping: Mapping[int, bool] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SlipDetector:
    """Sets the slip flag of contacts.

    Attributes:
        min_ratio: least ratio of shear to normal force of a contact that slips.
        saturated_share: a ratio above this share of the largest one so far no longer increases.
        decay_s: time constant with which the largest ratio falls off.
        moving_pitch: a contact moves if its centre is farther than this from the filtered one, in pitches.
        filter_s: time constant with which the filtered centre follows the contact. A contact that slides
            evenly is ahead of it by the way of about this time.
    """

    min_ratio: float = 0.1
    saturated_share: float = 0.85
    decay_s: float = 3.3
    moving_pitch: float = 0.1
    filter_s: float = 0.1

    def __call__(
        self, state: SlipState, contacts: Contacts, pitch_mm: float, *, elapsed_s: float
    ) -> tuple[SlipState, Contacts]:
        """The contacts with slip flags; None where the force is NaN and in the first frame of a contact.

        One that ends keeps its last flag.

        Args:
            state: of the frame before.
            contacts: of this frame.
            pitch_mm: of the layout.
            elapsed_s: time since the frame before.
        """
        kept, share = remaining(elapsed_s, self.decay_s), 1.0 - remaining(elapsed_s, self.filter_s)
        flagged: list[Contact] = []
        ratios, centres, flags = {}, {}, {}
        for contact in contacts.contacts:
            if contact.phase is Phase.END:
                flagged.append(replace(contact, slip=state.is_slipping.get(contact.id)))
                continue
            ratio = float(np.hypot(*contact.shear_over_E_mm2)) / contact.normal_force_over_E_mm2
            if not np.isfinite(ratio):
                flagged.append(contact)
                continue
            largest = max(ratio, kept * state.ratio.get(contact.id, 0.0))
            filtered_mm = state.centre_mm.get(contact.id, contact.centre_mm)
            away_mm = contact.centre_mm - filtered_mm
            is_moving = float(np.hypot(*away_mm)) > self.moving_pitch * pitch_mm
            is_saturated = ratio >= max(self.min_ratio, self.saturated_share * largest)
            if contact.id in state.centre_mm:  # else no motion is known
                flags[contact.id] = bool(is_moving and is_saturated)
            flagged.append(replace(contact, slip=flags.get(contact.id)))
            ratios[contact.id], centres[contact.id] = largest, filtered_mm + share * away_mm
        slip = SlipState(
            ratio=MappingProxyType(ratios),
            centre_mm=MappingProxyType(centres),
            is_slipping=MappingProxyType(flags),
        )
        return slip, replace(contacts, contacts=tuple(flagged))
