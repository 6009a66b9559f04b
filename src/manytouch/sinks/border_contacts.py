"""Contacts along the border of a view that may show only a part of the sheet."""

import numpy as np

from manytouch.values import Reading, Sensor

BORDER_PITCHES = 1.5
"""Contacts so near to the outermost dots, or beyond them, are at the border."""
LEAST_AT_ONCE = 2
LEAST_SHARE = 1.0 / 3.0
"""Of the frames with contacts. Simulated views that cut two to four columns off have up to 0.6, two of four
more than this; whole sheets up to 0.2."""


class BorderContacts:
    """Counts frames of an assumed sheet in which several contacts are at its border at once.

    On sheets with fewer than about seven rows or columns, most of which is border, none are counted.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._is_used, self._inner_mm = False, np.zeros(2)
        if sensor.layout is not None and sensor.sheet is not None:
            outermost_mm = np.abs(sensor.layout.rest_mm[:, :2]).max(axis=0)
            self._inner_mm = outermost_mm - BORDER_PITCHES * sensor.layout.pitch_mm
            is_large = bool((self._inner_mm > 0.5 * outermost_mm).all())
            self._is_used = sensor.sheet.is_assumed and is_large
        self._touched = 0
        self._at_border = 0

    def add(self, reading: Reading) -> None:
        """Add a frame; only frames that the assumed sheet describes count."""
        touching = reading.contacts.touching
        if not self._is_used or reading.surface.spline is None or not touching:
            return
        centre_mm = np.abs([contact.centre_mm for contact in touching])
        self._touched += 1
        self._at_border += int((centre_mm > self._inner_mm).any(axis=1).sum()) >= LEAST_AT_ONCE

    def warnings(self) -> list[str]:
        """A warning if several contacts are at the border in many of the frames with contacts."""
        if self._at_border == 0 or self._at_border < LEAST_SHARE * self._touched:
            return []
        return [
            f"{self._at_border} of {self._touched} frames with contacts have several along the border of the "
            "dots. If the sheet extends beyond the image or the region, these contacts may not exist, as it "
            "is assumed to end one pitch beyond the outermost dots: use --method perimeter, or --sensor with "
            "a file that states the whole sheet"
        ]
