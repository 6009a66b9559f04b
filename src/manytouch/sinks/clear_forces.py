"""Clear forces, which differ from 0 by more than their deviation explains, and how many frames have one."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from manytouch.values import Contact, Sensor

CLEAR_STDS = 2.0
"""A force of fewer standard deviations does not differ from 0; annotated pictures show it grey."""


def is_clear(value: float, std: float) -> bool:
    """Whether a value differs from 0 by more than `CLEAR_STDS` of its standard deviations.

    A value without a known deviation counts as clear.
    """
    return not abs(value) <= CLEAR_STDS * std


class ClearForceCount:
    """Counts frames with contacts by whether one of their normal forces is clear (`is_clear`)."""

    def __init__(self) -> None:
        self._frames = 0
        self._frames_clear = 0
        self._largest_N: tuple[float, float] | None = None

    def add(self, contacts: Iterable[Contact]) -> None:
        """Add the contacts of a frame that touch."""
        forces_N = [(-float(each.force_N[2]), float(each.std("normal_force"))) for each in contacts]
        known_N = [(force, std) for force, std in forces_N if np.isfinite(force) and np.isfinite(std)]
        clear_N = [(force, std) for force, std in known_N if is_clear(force, std)]
        self._frames += bool(known_N)
        self._frames_clear += bool(clear_N)
        self._largest_N = max(
            [*clear_N, *([] if self._largest_N is None else [self._largest_N])], default=None
        )

    def to_dict(self) -> dict[str, Any] | None:
        """The section `forces` of summary.json; None if no contact has a force."""
        if self._frames == 0:
            return None
        force_N, std_N = (None, None) if self._largest_N is None else self._largest_N
        return {
            "frames": self._frames,
            "frames_beyond_two_deviations": self._frames_clear,
            "largest_N": None if force_N is None else round(force_N, 4),
            "largest_std_N": None if std_N is None else round(std_N, 4),
        }

    def sentence(self) -> str | None:
        """The counts and the largest force as a sentence; None if no contact has a force."""
        if self._frames == 0:
            return None
        counted = f"{self._frames_clear} of {self._frames} frames with contacts have one"
        if self._frames == 1:
            counted = f"{self._frames_clear} of 1 frame with contacts has one"
        if self._largest_N is None:
            return f"forces: {counted} beyond two deviations"
        force_N, std_N = self._largest_N
        return f"forces: {counted} beyond two deviations; largest such {force_N:.3g} ± {std_N:.2g} N"

    def warnings(self, sensor: Sensor) -> list[str]:
        """A sentence if there are forces, but none is clear."""
        if self._frames == 0 or self._frames_clear:
            return []
        remedy = "press harder, and calibrate the sensor with known weights (manytouch calibrate sheet)"
        if sensor.is_nominal:
            remedy = (
                "calibrate the sensor (manytouch calibrate rest, then calibrate sheet with known weights)"
            )
        if sensor.sheet is not None and sensor.sheet.boundary == "bonded":
            remedy += (
                "; the force of something wider than the pad is thick cannot be measured well: press it "
                "through a narrower foot"
            )
        return [
            f"no force in the {self._frames} frames with contacts is more than two standard deviations from "
            f"0: use places and times of the contacts, but not their forces, or {remedy}"
        ]
