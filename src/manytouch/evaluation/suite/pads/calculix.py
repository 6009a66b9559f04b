"""Cases of bonded pads that CalculiX solved, an independent program, with sizes of a published deck.

The deck is that of FEATS (https://github.com/feats-ai/feats, `src/calculix`): the pad of a GelSight Mini,
25.25 x 20.75 x 4 mm, neo-Hooke with C10 = 0.0725 MPa and D1 = 0, for which CalculiX takes 0.05 / C10, a bulk
modulus of 20 shear moduli; and indenters of these names. Places, depths and friction are our own.
`benchmarks/ship_calculix_pads.py` writes decks and solves them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from manytouch.evaluation.suite.pads.cases import WIDTH_PX, PadCase

SIZE_MM, THICKNESS_MM = (25.25, 20.75), 4.0
C10_MPA, BULK_OVER_SHEAR = 0.0725, 20.0
POISSON = (3.0 * BULK_OVER_SHEAR - 2.0) / (6.0 * BULK_OVER_SHEAR + 2.0)
YOUNG_MPA = 4.0 * C10_MPA * (1.0 + POISSON)
"""Young's modulus for small strains: 0.4279 MPa, with Poisson's ratio 0.4754."""

Shape = Literal[
    "sphere_10",
    "sphere_15",
    "sphere_20",
    "cylinder_8",
    "cylinder_10_7",
    "cuboid_7",
    "polygon_6_10",
    "triangle_8",
    "sloping_cuboid_10",
    "pyramid_10",
]
"""Names of the deck; numbers are diameters or sides in mm, of the ring outer diameter and inner one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalculixPress:
    """A rigid body at three depths, the last one after a way sideways.

    Attributes:
        shape: of the body.
        at_mm: x, y of its middle.
        turn_deg: about z.
        levels: depths of its lowest point, mm; facets of a ridge or tip are up to 0.02 mm above it.
        friction: Coulomb's coefficient.
        drag_mm: way along x and y at the last depth.
    """

    shape: Shape
    at_mm: tuple[float, float]
    turn_deg: float = 0.0
    levels: tuple[float, float, float]
    friction: float = 0.0
    drag_mm: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class CalculixCase(PadCase):
    """A press that CalculiX solved, three states held for four frames each after 15 frames at rest.

    Attributes:
        press: what touches the pad.
    """

    press: CalculixPress


PRESSES = {
    "sphere-10-mm": CalculixPress(shape="sphere_10", at_mm=(0.0, 0.0), levels=(0.3, 0.5, 1.0)),
    "sphere-15-mm-sticking": CalculixPress(
        shape="sphere_15", at_mm=(2.5, -1.5), levels=(0.3, 0.5, 0.75), friction=1.0
    ),
    "sphere-20-mm-near-a-side": CalculixPress(shape="sphere_20", at_mm=(9.6, 0.5), levels=(0.2, 0.4, 0.75)),
    "cylinder-8-mm-sticking": CalculixPress(
        shape="cylinder_8", at_mm=(-1.0, 1.0), levels=(0.1, 0.2, 0.3), friction=1.0
    ),
    "cuboid-7-mm": CalculixPress(shape="cuboid_7", at_mm=(1.0, -1.0), turn_deg=30.0, levels=(0.1, 0.3, 0.5)),
    "triangle-8-mm": CalculixPress(
        shape="triangle_8", at_mm=(-3.0, 1.5), turn_deg=15.0, levels=(0.15, 0.3, 0.5)
    ),
    "pyramid-10-mm": CalculixPress(
        shape="pyramid_10", at_mm=(2.0, 1.0), turn_deg=20.0, levels=(0.3, 0.6, 1.0)
    ),
    "sphere-10-mm-dragged": CalculixPress(
        shape="sphere_10", at_mm=(-2.0, 1.0), levels=(0.3, 0.75, 0.75), friction=0.6, drag_mm=(0.4, 0.2)
    ),
    "hexagon-10-mm-sticking": CalculixPress(
        shape="polygon_6_10", at_mm=(0.5, 1.0), turn_deg=10.0, levels=(0.1, 0.2, 0.3), friction=1.0
    ),
    "sloping-cuboid-10-mm": CalculixPress(
        shape="sloping_cuboid_10", at_mm=(-1.5, 0.5), turn_deg=40.0, levels=(0.25, 0.5, 0.8)
    ),
    "ring-10-mm": CalculixPress(shape="cylinder_10_7", at_mm=(1.0, 0.5), levels=(0.15, 0.3, 0.5)),
    "cylinder-8-mm-dragged": CalculixPress(
        shape="cylinder_8", at_mm=(0.5, -1.0), levels=(0.2, 0.4, 0.4), friction=0.8, drag_mm=(0.1, -0.4)
    ),
}
"""By the names of their cases."""
HELD_OUT = ("hexagon-10-mm-sticking", "sloping-cuboid-10-mm", "ring-10-mm", "cylinder-8-mm-dragged")
"""Not to be looked at while a method is tuned; chosen by shape before any method was run on them."""
FINE = ("sphere-15-mm-sticking", "triangle-8-mm", "sphere-10-mm-dragged", "hexagon-10-mm-sticking")
"""With 20 x 20 markers at 1 mm, 0.3 mm below the face; the others with 7 x 9 at 2 mm, 0.5 mm below."""
QUICK = ("sphere-10-mm", "ring-10-mm")


def calculix_pads() -> Iterator[CalculixCase]:
    """The cases of the group `pads_calculix`."""
    for number, (name, press) in enumerate(PRESSES.items()):
        fine = name in FINE
        yield CalculixCase(
            group="pads_calculix",
            name=name,
            seed=4200 + number,
            looked_at=name not in HELD_OUT,
            is_quick=name in QUICK,
            touches=(),
            press=press,
            deepest_mm=press.levels[-1],
            noise=1.2,
            width_px=WIDTH_PX,
            solution=f"pad-calculix-{name}.npz",
            size_mm=SIZE_MM,
            thickness_mm=THICKNESS_MM,
            young_MPa=YOUNG_MPA,
            poisson=POISSON,
            marker_depth_mm=0.3 if fine else 0.5,
            pitch_mm=1.0 if fine else 2.0,
            rows=20 if fine else 7,
            columns=20 if fine else 9,
        )
