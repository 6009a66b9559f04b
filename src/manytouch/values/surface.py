"""Estimated shape of the sheet."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from manytouch.errors import ManytouchError
from manytouch.values.arrays import Covariances3, Points3, reduced
from manytouch.values.display.text import count_of
from manytouch.values.sensor import Layout
from manytouch.values.status import Status

InterpolationKind = Literal["spline", "idw"]

ITERATIONS, RADIUS_PITCH, POWER = (2, 300), (0.5, 5.0), (0.5, 10.0)
"""Smallest and largest values; the weights of the largest ones take 100 MB."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interpolation:
    """Interpolation of a surface between its markers.

    Attributes:
        kind: "spline": the spline of the sheet where the method estimates one, else cubic splines through the
            markers (`manytouch.geometry.sampling`); "idw": inverse distance weighting, the surface of the
            paper (`manytouch.geometry.inverse_distance`).
        iterations: points of the plane of "idw" along each side ("number of iterations" of the paper).
        search_radius_pitch: largest distance of a marker from a point that it contributes to, in pitches.
        power: of the distance in the weights of "idw" (Table 2: 2).

    Raises:
        ManytouchError: a number is outside its limits.
    """

    kind: InterpolationKind = "spline"
    iterations: int = 100
    search_radius_pitch: float = 1.5
    power: float = 2.0

    def __post_init__(self) -> None:
        numbers = (
            ("the number of iterations", self.iterations, ITERATIONS),
            ("the search radius in pitches", self.search_radius_pitch, RADIUS_PITCH),
            ("the power of the distance", self.power, POWER),
        )
        for words, value, (least, most) in numbers:
            if not least <= value <= most:
                raise ManytouchError(f"{words} is {value:g}: give a number from {least:g} to {most:g}")


SPLINE = Interpolation()
INVERSE_DISTANCE = Interpolation(kind="idw")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetSpline:
    """Displacement of the sheet and the forces on it, as coefficients of cubic B-splines.

    Attributes:
        size_mm, centre_mm: of the rectangle that the spline covers, along x and y.
        elements: number of elements along x and y.
        is_clamped: whether the outline is clamped; otherwise the sheet continues beyond it.
        thickness_mm, poisson: of the sheet; they determine the positions of its faces.
        shear_mm2: the deflection of the camera-side face is b - shear_mm2 lap b.
        tilt_mm2: straight fibres through the sheet are normal to b - tilt_mm2 lap b.
        clamped_end: conditions on a clamped outline; see `geometry.spline.SplinePatch`.
        pretension_over_E_mm, pretension_std_over_E_mm: membrane force per length at rest divided by Young's
            modulus, and its standard deviation; NaN where it is not known.
        thickness_std_mm: standard deviation of the thickness of an assumed sheet; NaN of a known one.
        coefficient_mm: (nodes, 3) of the displacement along x and y and of the bending deflection b, in the
            order of `geometry.spline.SplinePatch`.
        force_over_E_mm2: (nodes, 3) nodal forces on the sheet divided by Young's modulus. Around a contact
            the sum of the normal ones is its normal force.
        young_MPa: None if unknown.
    """

    size_mm: tuple[float, float]
    centre_mm: tuple[float, float]
    elements: tuple[int, int]
    is_clamped: bool
    thickness_mm: float
    poisson: float
    coefficient_mm: Float64[np.ndarray, "nodes 3"]
    force_over_E_mm2: Float64[np.ndarray, "nodes 3"]
    young_MPa: float | None
    shear_mm2: float = 0.0
    tilt_mm2: float = 0.0
    clamped_end: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pretension_over_E_mm: float = float("nan")
    pretension_std_over_E_mm: float = float("nan")
    thickness_std_mm: float = float("nan")

    __reduce__ = reduced

    def __repr__(self) -> str:
        (x_mm, y_mm), (columns, rows) = self.size_mm, self.elements
        return f"SheetSpline({x_mm:g} x {y_mm:g} mm, {columns} x {rows} elements)"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Surface:
    """The camera-side face of the sheet at the markers; `manytouch.sample` evaluates it at any point.

    Sheet frame: z out of the sensor, so a press has displacement z < 0 and depth = -z > 0.
    If the scale of the sensor is unknown, lengths assume a pitch of 1 mm.

    Attributes:
        position_mm: (m, 3) rest position plus displacement.
        displacement_mm: (m, 3) from rest; NaN where unknown.
        covariance_mm2: (m, 3, 3) of the displacement; NaN where unknown.
        spline: shape and forces of the whole sheet, from methods that estimate them; else None.
        layout: the markers at rest; None only where a surface need not be sampled.
        interpolation: how the surface is evaluated between the markers.
        status: `OK`, or why this surface is unreliable.
    """

    position_mm: Points3
    displacement_mm: Points3
    covariance_mm2: Covariances3
    spline: SheetSpline | None = None
    layout: Layout | None = None
    interpolation: Interpolation = SPLINE
    status: Status = Status.OK

    __reduce__ = reduced

    def __repr__(self) -> str:
        depth_mm = -self.displacement_mm[:, 2]
        known = depth_mm[np.isfinite(depth_mm)]
        deepest = f"depth up to {known.max():.2f} mm" if known.size else "depth unknown"
        return f"Surface({count_of(len(depth_mm), 'marker')}, {deepest}, {self.status})"
