"""What touches the sheet."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Float64

ESTIMATES = ("x", "y", "depth", "shear_x", "shear_y", "normal_force", "torque", "area")
"""Order of rows and columns of `Contact.covariance`."""


class Phase(StrEnum):
    """Where a contact is in its life; `end` is the first frame without it and carries its last values."""

    START = "start"
    MOVE = "move"
    END = "end"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Contact:
    """One contact in one frame. NaN means not known; it is never 0 by default.

    Attributes:
        id: stays the same while the contact lasts; never used again.
        phase: start, move or end.
        centre_mm: (2,) x, y in undeformed sheet coordinates.
        centre_px: (2,) where it shows in the present image.
        depth_mm: largest depth of the camera-side face within the contact.
        force_N: (3,) of the object on the sheet, x, y, z; a press has z < 0 and normal force = -z.
        torque_Nmm: about the sheet's normal.
        area_mm2: size of the contact.
        covariance: (8, 8) of the estimates in the order of `ESTIMATES`, NaN where not known.
        normal_force_over_E_mm2: normal force over Young's modulus, which needs no stiffness.
        shear_over_E_mm2: (2,) the shear force likewise.
        slip: does it slide over the sheet? None where nobody can tell.
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

    def std(self, estimate: str) -> float:
        """Standard deviation of one of `ESTIMATES`, in its own unit; NaN where not known."""
        place = ESTIMATES.index(estimate)
        return float(np.sqrt(self.covariance[place, place]))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Contacts:
    """All contacts of one frame (may be none), and whether to trust that.

    Attributes:
        contacts: in the order of their ids, with those that end in this frame.
        status: "ok", or why the contacts could not be told in this frame.
    """

    contacts: tuple[Contact, ...] = ()
    status: str = "ok"

    @property
    def touching(self) -> tuple[Contact, ...]:
        """The contacts that are there in this frame, without those that just ended."""
        return tuple(contact for contact in self.contacts if contact.phase is not Phase.END)
