"""Contacts of one frame."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Float64

from manytouch.errors import ManytouchError
from manytouch.values.arrays import Points2, reduced
from manytouch.values.display.html import columns_table
from manytouch.values.display.text import count_of, with_std
from manytouch.values.status import Status

ESTIMATES = ("x", "y", "depth", "shear_x", "shear_y", "normal_force", "torque", "area")
"""Names for `Contact.std`, and the order of rows and columns of `Contact.covariance`."""
SHOWN = 4  # contacts in the text of `Contacts`


class Phase(StrEnum):
    """Phase of a contact track; `end` is the first frame without the contact and repeats its last values."""

    START = "start"
    MOVE = "move"
    END = "end"


class ContactShape(StrEnum):
    """Shape of the pressure of a contact, as far as the markers distinguish it."""

    POINT = "point"
    LINE = "line"
    PATCH = "patch"
    RING = "ring"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OutlineRing:
    """A closed polygon of the outline of a contact's region.

    Attributes:
        point_mm: (k, 2) corners x, y in undeformed sheet coordinates; the last one is joined to the first.
            Counter-clockwise from x to y around a region, clockwise around a hole.
        is_hole: whether the polygon is the border of a hole in the region.
    """

    point_mm: Points2
    is_hole: bool = False

    __reduce__ = reduced

    def __repr__(self) -> str:
        return f"OutlineRing({count_of(len(self.point_mm), 'corner')}{', hole' if self.is_hole else ''})"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Contact:
    """One contact in one frame. NaN means unknown; no estimate is 0 by default.

    Lengths are always in mm. Where the scale is not known, 1 mm stands for one pitch, and names of columns in
    files end in _pitch instead.

    Attributes:
        id: identity, constant while the contact lasts and never reused.
        phase: start, move or end.
        centre_mm: (2,) x, y in undeformed sheet coordinates.
        centre_px: (2,) the centre in the present image.
        depth_mm: largest depth of the camera-side face within the contact.
        force_N: (3,) of the object on the sheet, x, y, z; a press has z < 0 and normal force = -z.
        torque_Nmm: about the sheet's normal.
        area_mm2: area of the contact's region, the smallest set that carries 95 % of its normal force after
            smoothing at half a pitch; of a flat rigid face its footprint.
        covariance: (8, 8) of the estimates in the order of `ESTIMATES`, NaN where unknown.
        normal_force_over_E_mm2: normal force divided by Young's modulus; does not depend on the stiffness.
        shear_over_E_mm2: shear force x, y divided by Young's modulus.
        slip: whether it slides over the sheet; None if unknown.
        half_major_mm, half_minor_mm: half axes of the ellipse under uniform pressure that has the second
            moments of the contact's pressure.
        orientation_rad: angle of the major axis from x towards y, in (-pi/2, pi/2].
        shape: the most probable shape of the pressure; None if unknown.
        shape_probability: of that shape.
        outline: of the contact's region; None if unknown.
    """

    id: int
    phase: Phase
    centre_mm: Float64[np.ndarray, "2"]
    centre_px: Float64[np.ndarray, "2"]
    depth_mm: float
    force_N: Float64[np.ndarray, "3"]
    torque_Nmm: float
    area_mm2: float
    covariance: Float64[np.ndarray, "8 8"]
    normal_force_over_E_mm2: float = float("nan")
    shear_over_E_mm2: tuple[float, float] = (float("nan"), float("nan"))
    slip: bool | None = None
    half_major_mm: float = float("nan")
    half_minor_mm: float = float("nan")
    orientation_rad: float = float("nan")
    shape: ContactShape | None = None
    shape_probability: float = float("nan")
    outline: tuple[OutlineRing, ...] | None = None

    __reduce__ = reduced

    @property
    def normal_force_N(self) -> float:
        """Normal force, positive in compression: -z of `force_N`; NaN if unknown."""
        return -float(self.force_N[2])

    def std(self, estimate: str) -> float:
        """Standard deviation of an estimate, in its own unit; NaN if unknown.

        Args:
            estimate: "x", "y", "depth", "shear_x", "shear_y", "normal_force", "torque" or "area"; what the
                name of a column adds, such as `_N`, is not part of it.

        Raises:
            ManytouchError: there is no such estimate.
        """
        if estimate not in ESTIMATES:
            names = ", ".join(ESTIMATES)
            raise ManytouchError(f"a contact has no estimate {estimate!r}: give one of {names}")
        index = ESTIMATES.index(estimate)
        return float(np.sqrt(self.covariance[index, index]))

    def __repr__(self) -> str:
        x_mm, y_mm = self.centre_mm
        return (
            f"Contact({self.id}, {self.phase}, at ({x_mm:.2f}, {y_mm:.2f}) mm, depth {self.depth_mm:.2f} mm, "
            f"normal force {self.normal_force_N:.3g} N)"
        )

    def _repr_html_(self) -> str:
        return Contacts(contacts=(self,))._repr_html_()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Contacts:
    """All contacts of one frame (may be none), and the status of their estimation.

    pandas, polars and others take it as a table, `polars.DataFrame(contacts)`, with the columns of
    contacts.csv but `frame` and `time_s`. Their names end in _mm also where those of the file end in _pitch:
    1 mm then stands for one pitch.

    Attributes:
        contacts: in the order of their ids, including those that end in this frame.
        status: `OK`, or why the contacts of this frame could not be estimated.
    """

    contacts: tuple[Contact, ...] = ()
    status: Status = Status.OK

    @property
    def touching(self) -> tuple[Contact, ...]:
        """The contacts that are present in this frame, without those that just ended."""
        return tuple(contact for contact in self.contacts if contact.phase is not Phase.END)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        from manytouch.values.tabular.rows import arrow_stream, contact_values_by_column

        return arrow_stream(contact_values_by_column(self), requested_schema)

    def __repr__(self) -> str:
        shown = [_in_short(contact) for contact in self.touching[:SHOWN]]
        more = len(self.touching) - len(shown)
        listed = "; ".join([*shown, f"{more} more"] if more else shown)
        head = f"{count_of(len(self.touching), 'contact')}, {self.status}"
        return f"Contacts({head}: {listed})" if listed else f"Contacts({head})"

    def _repr_html_(self) -> str:
        header = ("contact", "phase", "x (mm)", "y (mm)", "depth (mm)", "normal force (N)")
        return columns_table(header, (_cells(contact) for contact in self.contacts))


def _in_short(contact: Contact) -> str:
    """Depth and normal force of a contact."""
    depth = with_std(contact.depth_mm, contact.std("depth"))
    force = contact.normal_force_N
    newtons = f", {with_std(force, contact.std('normal_force'), 3)} N" if math.isfinite(force) else ""
    return f"{contact.id}: depth {depth} mm{newtons}"


def _cells(contact: Contact) -> tuple[str, ...]:
    """What a row of a table shows of a contact."""
    x_mm, y_mm = (float(value) for value in contact.centre_mm)
    return (
        *(str(contact.id), contact.phase.value),
        *(with_std(x_mm, contact.std("x")), with_std(y_mm, contact.std("y"))),
        with_std(contact.depth_mm, contact.std("depth")),
        with_std(contact.normal_force_N, contact.std("normal_force"), 3),
    )
