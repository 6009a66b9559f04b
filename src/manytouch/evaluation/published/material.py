"""Table 1 and Figure 2: how deep 10 N on 1 cm^2 press a clamped sheet of 3 mm, and for which modulus.

The shape depends on force over modulus alone, so one way of growing force on a sheet of E = 1 MPa
answers for all moduli; its beginning is the linear answer.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.simulation.fem.cache import StateCache
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import Loading, PressurePatch
from manytouch.simulation.fem.sheet import SheetModel
from manytouch.simulation.fem.state import SheetState
from manytouch.values.arrays import Scalars, read_only

FORCE_N, SIDE_MM, THICKNESS_MM, POISSON, DENSITY_KG_M3 = 10.0, 10.0, 3.0, 0.45, 960.0
PRINTED_MPA, PRINTED_DEPTH_MM = 0.01, 10.1
SHEETS_MM = ((120.0, 80.0), (160.0, 100.0), (70.0, 70.0), (75.0, 75.0))
FORCE_OVER_E_MM2 = (0.001, 0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0)
ENOUGH_MM = 10.6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Deflection:
    """A clamped sheet under a pressed square of 1 cm^2 in its middle.

    Attributes:
        size_mm: of the sheet.
        force_over_E_mm2: (k,) force over Young's modulus, from almost nothing.
        depth_mm: (k,) largest depth of the camera-side face.
    """

    size_mm: tuple[float, float]
    force_over_E_mm2: Float64[np.ndarray, " k"]
    depth_mm: Scalars

    @property
    def linear_mm_per_mm2(self) -> float:
        """Depth per force over modulus for small forces."""
        return float(self.depth_mm[0] / self.force_over_E_mm2[0])

    def linear_depth_mm(self, young_MPa: float) -> float:
        """Depth of 10 N if small forces could be scaled up."""
        return self.linear_mm_per_mm2 * FORCE_N / young_MPa

    def depth_of_10_N_mm(self, young_MPa: float) -> float:
        """Depth of 10 N with large deflection; NaN beyond what was solved."""
        ratio_mm2 = FORCE_N / young_MPa
        if ratio_mm2 > self.force_over_E_mm2[-1]:
            return float("nan")
        return float(np.interp(ratio_mm2, self.force_over_E_mm2, self.depth_mm))

    @property
    def linear_young_MPa(self) -> float:
        """The modulus with which a linear model gives the printed depth."""
        return self.linear_mm_per_mm2 * FORCE_N / PRINTED_DEPTH_MM

    @property
    def young_MPa(self) -> float:
        """The modulus with which large deflection gives the printed depth."""
        return FORCE_N / float(np.interp(PRINTED_DEPTH_MM, self.depth_mm, self.force_over_E_mm2))


def deflection(size_mm: tuple[float, float], cache: StateCache) -> Deflection:
    """Press a sheet until it is deeper than the paper's."""
    used, depth_mm = [], []
    for force, state in zip(FORCE_OVER_E_MM2, _pressed(size_mm, cache), strict=False):
        if state.status != "ok":
            break
        used.append(force)
        depth_mm.append(_deepest_mm(state))
        if depth_mm[-1] > ENOUGH_MM:
            break
    return Deflection(
        size_mm=size_mm,
        force_over_E_mm2=read_only(np.array(used)),
        depth_mm=read_only(np.array(depth_mm)),
    )


def printed_press(cache: StateCache) -> tuple[SheetState, float]:
    """The 120 x 80 mm sheet at the first solved force that presses as deep as printed, and its modulus."""
    for force, state in zip(FORCE_OVER_E_MM2, _pressed(SHEETS_MM[0], cache), strict=True):
        if _deepest_mm(state) > 0.95 * PRINTED_DEPTH_MM:
            return state, FORCE_N / force
    raise AssertionError("the last force presses deeper")


def sag_mm(cache: StateCache, young_MPa: float = PRINTED_MPA) -> float:
    """How far the 120 x 80 mm sheet hangs through under its own weight."""
    rubber = NeoHooke(young_MPa=young_MPa, poisson=POISSON, density_kg_m3=DENSITY_KG_M3)
    model = SheetModel(
        size_mm=SHEETS_MM[0],
        thickness_mm=THICKNESS_MM,
        material=rubber,
        gravity=(0.0, 0.0, -1.0),
        element_mm=4.0,
    )
    *_, state = cache.states(model, Loading(patches=(_patch((0.0,)),)))
    return _deepest_mm(state)


def _pressed(size_mm: tuple[float, float], cache: StateCache) -> Iterable[SheetState]:
    model = SheetModel(
        size_mm=size_mm, thickness_mm=THICKNESS_MM, material=NeoHooke(young_MPa=1.0, poisson=POISSON)
    )
    return cache.states(model, Loading(patches=(_patch(FORCE_OVER_E_MM2),)))


def _patch(force_N: tuple[float, ...]) -> PressurePatch:
    down = np.zeros((len(force_N), 3))
    down[:, 2] = -np.array(force_N)
    return PressurePatch(
        centre_mm=(0.0, 0.0), size_mm=(SIDE_MM, SIDE_MM), outline="rectangle", force_N=read_only(down)
    )


def _deepest_mm(state: SheetState) -> float:
    place_mm = np.stack(np.meshgrid(np.linspace(-6, 6, 13), np.linspace(-6, 6, 13)), axis=-1).reshape(-1, 2)
    return -float(state.camera_side(place_mm)[0][:, 2].min())
