"""What presses on the sheet, step by step: rigid indenters on trajectories, and pressure patches."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from manytouch.simulation.fem.contact.indenters import Indenter
from manytouch.values.arrays import Points3, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class IndenterPath:
    """One indenter and its way through the steps.

    Attributes:
        indenter: its shape.
        position_mm: (k, 3) of its lowest point (the origin of its frame), sheet frame, per step.
        rotation_vector: (k, 3) of its frame (Rodrigues, rad), sheet_from_indenter.
        friction: Coulomb's coefficient; 0 slides freely.
    """

    indenter: Indenter
    position_mm: Float64[np.ndarray, "k 3"]
    rotation_vector: Float64[np.ndarray, "k 3"]
    friction: float = 0.0

    def __post_init__(self) -> None:
        if self.position_mm.shape != self.rotation_vector.shape:
            raise ValueError(
                f"a touch has {len(self.position_mm)} positions and {len(self.rotation_vector)} rotations"
            )
        if not self.friction >= 0.0:
            raise ValueError(f"friction is {self.friction}, expected 0 or more")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PressurePatch:
    """A dead load on material of the touched face, its direction stays.

    Attributes:
        centre_mm: x, y on the undeformed sheet, the middle of the patch.
        size_mm: extent along x and y.
        outline: spread evenly over an ellipse in that extent or over the rectangle; "dome": over the ellipse
            like the pressure under a soft ball, sqrt(1 - r^2) with r = 1 at its border.
        force_N: (k, 3) total force on the sheet per step; a press has z < 0.
    """

    centre_mm: tuple[float, float]
    size_mm: tuple[float, float]
    outline: Literal["ellipse", "rectangle", "dome"] = "ellipse"
    force_N: Float64[np.ndarray, "k 3"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Loading:
    """Everything that touches the sheet, over the same steps."""

    touches: tuple[IndenterPath, ...] = ()
    patches: tuple[PressurePatch, ...] = ()

    def __post_init__(self) -> None:
        lengths = {len(touch.position_mm) for touch in self.touches}
        lengths |= {len(patch.force_N) for patch in self.patches}
        if len(lengths) != 1:
            raise ValueError(
                f"touches and patches have {sorted(lengths)} steps, expected one and the same number"
            )

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.touches[0].position_mm) if self.touches else len(self.patches[0].force_N)


def press(
    indenter: Indenter,
    *,
    thickness_mm: float,
    path_mm: Points3,
    friction: float = 0.0,
    yaw_rad: Float64[np.ndarray, " k"] | None = None,
) -> IndenterPath:
    """An upright indenter along x, y and depth below the undeformed touched face.

    Args:
        indenter: its shape.
        thickness_mm: of the sheet.
        path_mm: (k, 3) x, y, depth of its lowest point; a negative depth is above the sheet.
        friction: Coulomb's coefficient.
        yaw_rad: (k,) turn about z; none when absent.
    """
    rotation = np.zeros_like(path_mm)
    if yaw_rad is not None:
        rotation[:, 2] = yaw_rad
    position_mm = path_mm * [1.0, 1.0, -1.0] + [0.0, 0.0, thickness_mm]
    return IndenterPath(
        indenter=indenter,
        position_mm=read_only(position_mm),
        rotation_vector=read_only(rotation),
        friction=friction,
    )
