"""How hard each place of the sheet is pressed, where the method knows the forces."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from manytouch.mechanics.patch import PointBasis, SplinePatch
from manytouch.values import SheetSpline

KPA_PER_MPA = 1000.0
Map = Float64[np.ndarray, "ny nx"]
_Key = tuple[tuple[float, float], tuple[float, float], tuple[int, int], bool]


@dataclass(slots=True, eq=False)
class PressureMap:
    """Pressure on an even grid, from the nodal forces of a spline.

    A node's force is spread over the integral of its basis function, so the map's integral is the total
    force, and it is as smooth as the spline.

    Attributes:
        x_mm, y_mm: columns and rows of the grid.
    """

    x_mm: Float64[np.ndarray, " nx"]
    y_mm: Float64[np.ndarray, " ny"]
    _known: dict[_Key, tuple[PointBasis, Float64[np.ndarray, " nodes"]]] = field(default_factory=dict)

    def __call__(self, spline: SheetSpline) -> Map | None:
        """(ny, nx) kPa, positive in compression; None where Young's modulus is not known."""
        if spline.young_MPa is None:
            return None
        basis, area_mm2 = self._basis(spline)
        pressure_MPa = -spline.young_MPa * spline.force_over_E_mm2[:, 2] / area_mm2
        found = basis.field(pressure_MPa[:, None])
        return np.asarray(KPA_PER_MPA * found.reshape(len(self.y_mm), len(self.x_mm)))

    def _basis(self, spline: SheetSpline) -> tuple[PointBasis, Float64[np.ndarray, " nodes"]]:
        key = (spline.size_mm, spline.centre_mm, spline.elements, spline.is_clamped)
        if key not in self._known:
            patch = SplinePatch(
                size_mm=spline.size_mm,
                elements=spline.elements,
                boundary="clamped" if spline.is_clamped else "soft",
                centre_mm=spline.centre_mm,
            )
            place_mm = np.stack(np.meshgrid(self.x_mm, self.y_mm), axis=-1).reshape(-1, 2)
            self._known = {key: (patch.at(place_mm), patch.area_mm2)}
        return self._known[key]
