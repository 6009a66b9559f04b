"""The varied cases: every shape on every sheet, in each of the groups `VARIED_GROUPS`."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from manytouch.evaluation.suite.cases import HOLD_FRAMES, REST_FRAMES, VARIED_GROUPS, Case
from manytouch.evaluation.suite.varied.presses import CASES_OF_SHAPES, PressSampler, VariedPress
from manytouch.evaluation.suite.varied.sheets import SHEETS

HELD_OUT_SHAPES = ("ring", "palm")
HELD_OUT_SHEETS = ("wide", "gel")
"""Cases of these shapes or on these sheets, a third of all, may not be looked at."""
DEPTHS_MM = ((0.1, 0.3), (0.3, 0.8), (0.8, 2.0), (2.0, 5.0), (5.0, 12.0))
SHARES = (0.35, 0.7, 1.0)
RELAXING_SHARES = (0.45, 1.0, 0.6)
YEOH = ((0.15, 0.0), (-0.04, 0.004))
QUICK = (
    "balls-slack",
    "square-tight",
    "line-5-mm",
    "mixed-slack",
    "large-balls-slack",
    "ring-small",
    "fingers-gel",
)
QUICK_CALIBRATED = ("line-5-mm",)
"""Quick cases of the group `calibrated`, in which each sheet takes a calibration first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VariedCase(Case):
    """Bodies on a sheet at three strengths, each held for four frames after 15 frames at rest.

    Attributes:
        shape, sheet: of `CASES_OF_SHAPES` and `SHEETS`.
        presses: what presses.
        shares: of the strengths, one for each state.
        stiffening: factors of Yeoh's law; 0 is neo-Hooke.
        drag_mm: x, y by which rigid bodies move along the sheet before the last state.
        is_sagging: does the sheet sag under its weight?
        relaxing_share: force of a quick press that relaxes with a time constant of 0.1 s, over the remaining
            force.
        uneven_share: largest deviation of the thickness, over it.
    """

    shape: str
    sheet: str
    presses: tuple[VariedPress, ...]
    shares: tuple[float, ...] = SHARES
    stiffening: tuple[float, float] = (0.0, 0.0)
    drag_mm: tuple[float, float] = (0.0, 0.0)
    is_sagging: bool = False
    relaxing_share: float = 0.0
    uneven_share: float = 0.0

    @property
    def frame_count(self) -> int:
        """Frames of its recording."""
        return REST_FRAMES + len(self.shares) * HOLD_FRAMES

    @property
    def state_count(self) -> int:
        """States that are solved: the sheet at rest where it sags, then one for each share."""
        return len(self.shares) + self.is_sagging


def varied(group: str) -> Iterator[VariedCase]:
    """The cases of one of `VARIED_GROUPS`."""
    for i, (shape, draw) in enumerate(CASES_OF_SHAPES.items()):
        for j, (name, sheet) in enumerate(SHEETS.items()):
            number = i * len(SHEETS) + j
            rng = np.random.default_rng(5000 + number)
            low_mm, high_mm = DEPTHS_MM[(i + 2 * j) % len(DEPTHS_MM)]
            deepest_mm = round(float(np.exp(rng.uniform(np.log(low_mm), np.log(high_mm)))), 2)
            presses = draw(PressSampler(rng=rng, sheet=sheet, deepest_mm=deepest_mm))
            is_rigid = all(press.kind != "dome" for press in presses)
            is_rough, is_relaxing = (i + 2 * j) % 4 == 1, is_rigid and (2 * i + j) % 7 == 3
            angle = float(rng.uniform(0, 2 * np.pi))
            drag_mm = min(1.0 + 2.0 * float(rng.random()), 2.0 * deepest_mm) if is_rough else 0.0
            yield VariedCase(
                group=group,  # type: ignore[arg-type]
                name=f"{shape}-{name}",
                seed=5000 + number + 1000 * VARIED_GROUPS.index(group),
                looked_at=shape not in HELD_OUT_SHAPES and name not in HELD_OUT_SHEETS,
                is_quick=f"{shape}-{name}" in (QUICK if group != "calibrated" else QUICK_CALIBRATED),
                touches=(),
                deepest_mm=deepest_mm,
                size_mm=sheet.size_mm,
                thickness_mm=sheet.thickness_mm,
                young_MPa=sheet.young_MPa,
                poisson=sheet.poisson,
                pretension_N_per_mm=sheet.pretension_N_per_mm,
                pitch_mm=sheet.pitch_mm,
                friction=round(float(rng.uniform(0.3, 0.9)), 2) if is_rough else 0.0,
                shape=shape,
                sheet=name,
                presses=presses,
                shares=RELAXING_SHARES if is_relaxing else SHARES,
                stiffening=YEOH[number % 2] if (i + j) % 3 == 0 else (0.0, 0.0),
                drag_mm=(round(drag_mm * np.cos(angle), 2), round(drag_mm * np.sin(angle), 2)),
                is_sagging=(i + j) % 7 == 2,
                relaxing_share=0.04 if is_relaxing else 0.0,
                uneven_share=0.03 if (i + 2 * j) % 5 == 4 else 0.0,
            )
