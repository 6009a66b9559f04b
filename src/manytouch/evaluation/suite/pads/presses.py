"""What presses in the cases of bonded pads: bodies or a given pressure, step by step."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from manytouch.simulation.fem.contact.indenters import (
    Fingertip,
    Indenter,
    LyingCylinder,
    Ring,
    RoundPunch,
    Sphere,
    SquarePunch,
    convex_hull,
)
from manytouch.simulation.fem.loading import Loading, PressurePatch, press

DEPTHS_MM = (0.1, 0.2, 0.3, 0.4, 0.5, 0.75, 1.0, 1.25, 1.5)
"""Between the depths that are kept, those of this list are solved too."""
DRAG_STEP_MM, TWIST_STEP_DEG = 0.125, 2.5


@dataclass(frozen=True, slots=True, kw_only=True)
class PadBody:
    """A rigid body.

    Attributes:
        shape: of it.
        at_mm: x, y of its lowest point, of a plate or cube before its edges and corners are rounded.
        turn_deg: about z.
        share: its depth over that of the deepest body.
    """

    shape: Indenter
    at_mm: tuple[float, float]
    turn_deg: float = 0.0
    share: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PadPress:
    """Bodies at three depths, or the pressure of a soft fingertip at three forces.

    Attributes:
        bodies: that move together; none for a fingertip.
        fingertip_mm: extent along x and y of the ellipse of a dome of pressure; (0, 0) for none.
        at_mm: x, y of the middle of the dome.
        levels: three depths of the deepest body, mm, or three normal forces of the dome, N.
        friction: Coulomb's coefficient of the bodies.
        drag_mm: way of the bodies along x and y at the last depth.
        twist_deg: turn of the bodies about z at the last depth.
        shear: tangential force of the dome along x and y over its normal force.
    """

    bodies: tuple[PadBody, ...] = ()
    fingertip_mm: tuple[float, float] = (0.0, 0.0)
    at_mm: tuple[float, float] = (0.0, 0.0)
    levels: tuple[float, float, float]
    friction: float = 0.0
    drag_mm: tuple[float, float] = (0.0, 0.0)
    twist_deg: float = 0.0
    shear: tuple[float, float] = (0.0, 0.0)

    def loading(self, thickness_mm: float) -> tuple[Loading, tuple[int, int, int]]:
        """All steps on a pad of a thickness, and the numbers of the three that are kept."""
        between = () if not self.bodies else DEPTHS_MM
        path = sorted({*self.levels, *(each for each in between if each <= self.levels[-1])})
        kept = [path.index(level) for level in self.levels]
        count = math.ceil(max(math.hypot(*self.drag_mm) / DRAG_STEP_MM, self.twist_deg / TWIST_STEP_DEG))
        level = np.array(path + [self.levels[-1]] * count)
        moved = np.concatenate([np.zeros(len(path)), np.arange(1, count + 1) / max(count, 1)])
        kept[-1] = len(level) - 1
        return self._loading(thickness_mm, level, moved), (kept[0], kept[1], kept[2])

    def _loading(self, thickness_mm: float, level: np.ndarray, moved: np.ndarray) -> Loading:
        if not self.bodies:
            force_N = level[:, None] * np.array([*self.shear, -1.0])
            dome = PressurePatch(
                centre_mm=self.at_mm, size_mm=self.fingertip_mm, outline="dome", force_N=force_N
            )
            return Loading(patches=(dome,))
        return Loading(
            touches=tuple(
                press(
                    body.shape,
                    thickness_mm=thickness_mm,
                    path_mm=np.column_stack([body.at_mm + moved[:, None] * self.drag_mm, body.share * level]),
                    friction=self.friction,
                    yaw_rad=np.deg2rad(body.turn_deg + moved * self.twist_deg),
                )
                for body in self.bodies
            )
        )


def one(shape: Indenter, at_mm: tuple[float, float], turn_deg: float = 0.0) -> tuple[PadBody, ...]:
    """A single body."""
    return (PadBody(shape=shape, at_mm=at_mm, turn_deg=turn_deg),)


def tilted_plate(side_mm: tuple[float, float, float], tilt_deg: tuple[float, float]) -> Indenter:
    """A block that is turned about x and y, its lowest point in the origin."""
    half = 0.5 * np.array(side_mm)
    corner = half * np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return convex_hull(_with_lowest_in_origin(corner @ _turn(*tilt_deg).T))


def cube_corner(edge_mm: float) -> Indenter:
    """A cube that stands on a corner, which is in the origin."""
    corner = edge_mm * np.stack(np.meshgrid(*[(0.0, 1.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    diagonal = Rotation.align_vectors([[0.0, 0.0, 1.0]], [[1.0, 1.0, 1.0]])[0]
    return convex_hull(_with_lowest_in_origin(diagonal.apply(corner)))


def _turn(about_x_deg: float, about_y_deg: float) -> np.ndarray:
    turn: np.ndarray = Rotation.from_euler("xy", [about_x_deg, about_y_deg], degrees=True).as_matrix()
    return turn


def _with_lowest_in_origin(corner_mm: np.ndarray) -> np.ndarray:
    moved_mm: np.ndarray = corner_mm - corner_mm[corner_mm[:, 2].argmin()]
    return moved_mm


PRESSES = {
    "ball-3-mm": PadPress(bodies=one(Sphere(radius_mm=3.0), (0.0, 0.0)), levels=(0.3, 0.5, 1.0)),
    "flat-punch-3-mm": PadPress(
        bodies=one(RoundPunch(radius_mm=3.0, edge_radius_mm=0.3), (-2.0, 1.5)), levels=(0.1, 0.3, 0.5)
    ),
    "ball-5-mm-thin-pad": PadPress(bodies=one(Sphere(radius_mm=5.0), (0.7, 0.4)), levels=(0.3, 0.5, 1.0)),
    "ball-5-mm-near-a-side": PadPress(bodies=one(Sphere(radius_mm=5.0), (9.5, 0.0)), levels=(0.3, 0.5, 1.0)),
    "ball-5-mm-sticking": PadPress(
        bodies=one(Sphere(radius_mm=5.0), (2.3, -1.2)), friction=1.0, levels=(0.3, 0.5, 1.0)
    ),
    "edge": PadPress(
        bodies=one(SquarePunch(side_mm=(8.0, 1.0), edge_radius_mm=0.3), (0.0, 1.0), 70.0),
        levels=(0.3, 0.5, 1.0),
    ),
    "flat-punch-3-mm-sticking": PadPress(
        bodies=one(RoundPunch(radius_mm=3.0, edge_radius_mm=0.3), (0.0, 0.0)),
        friction=1.0,
        levels=(0.1, 0.3, 0.5),
    ),
    "ball-4-mm-dragged": PadPress(
        bodies=one(Sphere(radius_mm=4.0), (-1.5, 1.0)),
        friction=0.6,
        levels=(0.3, 0.75, 0.75),
        drag_mm=(0.5, 0.25),
    ),
    "punch-3-mm-twisted": PadPress(
        bodies=one(RoundPunch(radius_mm=3.0, edge_radius_mm=0.3), (1.2, -0.6)),
        friction=1.0,
        levels=(0.1, 0.3, 0.3),
        twist_deg=10.0,
    ),
    "two-balls": PadPress(
        bodies=(
            PadBody(shape=Sphere(radius_mm=3.0), at_mm=(-4.5, 0.0)),
            PadBody(shape=Sphere(radius_mm=3.0), at_mm=(4.5, 1.0), share=0.6),
        ),
        levels=(0.3, 0.5, 1.0),
    ),
    "soft-fingertip": PadPress(
        fingertip_mm=(10.0, 8.0), at_mm=(1.0, -0.5), levels=(0.3, 0.8, 1.6), shear=(0.2, 0.1)
    ),
    "cube-corner": PadPress(bodies=one(cube_corner(12.0), (2.0, 2.0), 20.0), levels=(0.75, 1.0, 1.5)),
    "fingertip-dragged": PadPress(
        bodies=one(Fingertip(semi_axes_mm=(6.0, 4.5, 5.0)), (-2.0, 1.0)),
        friction=0.4,
        levels=(0.3, 0.75, 0.75),
        drag_mm=(0.0, -0.5),
    ),
    "ring": PadPress(
        bodies=one(Ring(radius_mm=4.0, wire_radius_mm=1.0), (0.5, 0.0)), levels=(0.2, 0.4, 0.75)
    ),
    "light-ball-12-mm": PadPress(bodies=one(Sphere(radius_mm=12.0), (3.0, 2.0)), levels=(0.1, 0.2, 0.3)),
    "lying-cylinder": PadPress(
        bodies=one(LyingCylinder(radius_mm=3.0, length_mm=8.0, edge_radius_mm=0.5), (1.0, -1.0), 25.0),
        levels=(0.3, 0.5, 1.0),
    ),
    "ball-8-mm-deep-markers": PadPress(
        bodies=one(Sphere(radius_mm=8.0), (0.0, -1.0)), levels=(0.3, 0.5, 1.0)
    ),
    "square-5-mm": PadPress(
        bodies=one(SquarePunch(side_mm=(5.0, 5.0), edge_radius_mm=0.3), (1.0, 1.0), 20.0),
        levels=(0.1, 0.3, 0.5),
    ),
    "two-punches": PadPress(
        bodies=(
            PadBody(shape=RoundPunch(radius_mm=2.0, edge_radius_mm=0.3), at_mm=(-5.0, -3.0)),
            PadBody(
                shape=SquarePunch(side_mm=(3.0, 3.0), edge_radius_mm=0.3),
                at_mm=(5.0, 2.0),
                turn_deg=30.0,
                share=0.8,
            ),
        ),
        levels=(0.2, 0.4, 0.75),
    ),
    "tilted-plate": PadPress(
        bodies=one(tilted_plate((8.0, 6.0, 2.0), (5.0, 3.0)), (-1.0, 0.0), 35.0), levels=(0.2, 0.5, 0.75)
    ),
    "soft-fingertip-sheared": PadPress(
        fingertip_mm=(7.0, 6.0), at_mm=(-2.0, 1.0), levels=(0.7, 2.0, 4.0), shear=(-0.1, 0.4)
    ),
    "cylinder-dragged": PadPress(
        bodies=one(LyingCylinder(radius_mm=2.5, length_mm=10.0, edge_radius_mm=0.5), (0.0, 1.0), 60.0),
        friction=0.8,
        levels=(0.3, 0.5, 0.5),
        drag_mm=(0.1, 0.4),
    ),
}
"""By the names of their cases."""
