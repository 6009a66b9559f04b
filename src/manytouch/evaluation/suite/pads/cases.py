"""Cases of bonded pads that our own finite elements solved: several sizes, stiffnesses and lattices."""

from collections.abc import Iterator
from dataclasses import dataclass

from manytouch.evaluation.suite.cases import HOLD_FRAMES, REST_FRAMES, Case
from manytouch.evaluation.suite.pads.presses import PRESSES, PadPress

WIDTH_PX = 640


@dataclass(frozen=True, slots=True, kw_only=True)
class PadCase(Case):
    """A press on a bonded pad, three states held for four frames each after 15 frames at rest.

    Attributes:
        solution: file in `deformations` with the plane of the markers and the contact face in each state.
        marker_depth_mm: below the contact face.
        rows, columns: of the markers.
    """

    solution: str
    marker_depth_mm: float
    rows: int = 7
    columns: int = 9

    @property
    def frame_count(self) -> int:
        """Frames of its recording."""
        return REST_FRAMES + 3 * HOLD_FRAMES


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnPadCase(PadCase):
    """A press that our own finite elements solved.

    Attributes:
        pad: one of `PADS`.
        press: what touches the pad.
    """

    pad: str
    press: PadPress


_GEL = {
    "size_mm": (25.0, 21.0),
    "thickness_mm": 4.0,
    "young_MPa": 0.3,
    "poisson": 0.48,
    "marker_depth_mm": 0.5,
    "pitch_mm": 2.0,
}
PADS: dict[str, dict[str, object]] = {
    "gel": _GEL,
    "thin": {
        "size_mm": (20.0, 20.0),
        "thickness_mm": 2.5,
        "young_MPa": 0.4,
        "poisson": 0.49,
        "marker_depth_mm": 0.3,
        "pitch_mm": 1.9,
    },
    "soft": _GEL | {"young_MPa": 0.2, "poisson": 0.45, "marker_depth_mm": 0.3},
    "deep": _GEL | {"young_MPa": 0.4, "poisson": 0.49, "marker_depth_mm": 1.0},
    "mini": _GEL | {"size_mm": (25.25, 20.75), "young_MPa": 0.43, "poisson": 0.485, "marker_depth_mm": 0.3},
    "fine": _GEL
    | {
        "young_MPa": 0.1,
        "poisson": 0.47,
        "marker_depth_mm": 0.4,
        "pitch_mm": 1.0,
        "rows": 20,
        "columns": 20,
    },
    "stiff": {
        "size_mm": (22.0, 22.0),
        "thickness_mm": 3.0,
        "young_MPa": 0.5,
        "poisson": 0.48,
        "marker_depth_mm": 0.4,
        "pitch_mm": 1.5,
        "rows": 13,
        "columns": 13,
    },
}
"""Fields of `PadCase` by the names of the pads."""
_PAD_OF = {
    "ball-3-mm": "gel",
    "flat-punch-3-mm": "gel",
    "ball-5-mm-thin-pad": "thin",
    "ball-5-mm-near-a-side": "gel",
    "ball-5-mm-sticking": "gel",
    "edge": "gel",
    "lying-cylinder": "soft",
    "ball-8-mm-deep-markers": "deep",
    "square-5-mm": "gel",
    "flat-punch-3-mm-sticking": "thin",
    "ball-4-mm-dragged": "gel",
    "punch-3-mm-twisted": "stiff",
    "two-balls": "gel",
    "soft-fingertip": "fine",
    "cube-corner": "mini",
    "fingertip-dragged": "fine",
    "ring": "stiff",
    "light-ball-12-mm": "mini",
    "two-punches": "fine",
    "tilted-plate": "soft",
    "soft-fingertip-sheared": "deep",
    "cylinder-dragged": "stiff",
}
"""The pad of each case."""
HELD_OUT = (
    "lying-cylinder",
    "ball-8-mm-deep-markers",
    "square-5-mm",
    "two-punches",
    "tilted-plate",
    "soft-fingertip-sheared",
    "cylinder-dragged",
)
"""Not to be looked at while a method is tuned."""
QUICK = ("ball-3-mm", "ball-5-mm-near-a-side", "square-5-mm")
QUICK_CALIBRATED = ("ball-3-mm",)
"""Quick cases of the group `pads_calibrated`, in which each pad takes a calibration first."""
_SEEDS = {"pads": 4000, "pads_nominal": 4100, "pads_calibrated": 4300}


def pads(group: str) -> Iterator[OwnPadCase]:
    """The cases of one of `OWN_PAD_GROUPS`."""
    for number, (name, pad) in enumerate(_PAD_OF.items()):
        yield OwnPadCase(
            group=group,  # type: ignore[arg-type]
            name=name,
            seed=_SEEDS[group] + number,
            looked_at=name not in HELD_OUT,
            is_quick=name in (QUICK if group != "pads_calibrated" else QUICK_CALIBRATED),
            touches=(),
            pad=pad,
            press=PRESSES[name],
            deepest_mm=PRESSES[name].levels[-1],
            noise=1.2,
            width_px=WIDTH_PX,
            solution=f"pad-{name}.npz",
            **PADS[pad],  # type: ignore[arg-type]
        )
