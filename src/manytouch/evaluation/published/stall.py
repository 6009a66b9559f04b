"""Section 5: fast motion, with which the paper's program "may stop and give errors".

The demo's scene, in which up to five fingers press and slide, is shown faster and faster by leaving out
frames. The paper's program counts the markers at the beginning of each frame; here a frame in which not every
marker has its identity is a status, and the method goes on. Motion blur is not simulated.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from manytouch.evaluation.report.svg_theme import METHOD_COLOURS, PLOT_SYMBOLS, SOFT, figure, svg
from manytouch.paper.tracking import PaperTracking
from manytouch.pipeline import Pipeline
from manytouch.sources.simulated import SimulatedSource, simulated_source
from manytouch.values import TrackedGrid
from manytouch.values.arrays import Points2

STEPS = (1, 2, 3, 4, 6, 8, 12, 16)
MOST_FRAMES = 60
WRONG_PITCH = 0.5  # a marker that is seen farther than this from its true place is another one


@dataclass(frozen=True, slots=True, kw_only=True)
class StallTest:
    """One method at one speed.

    Attributes:
        method: name.
        step: every step-th frame of the scene was shown.
        motion_px: largest motion of a marker between two frames.
        gate_px: motion beyond which the tracking of the paper gives another identity; None: of other methods.
        frames: number of frames, all of which gave a reading.
        incomplete_frames: frames in which not all markers have an identity.
        first_incomplete: the first of them; None: there is none.
        lost: largest number of markers without identity in a frame.
        wrong: largest number of markers with the identity of another one in a frame.
        new_ids: new identities in all frames; None where a method gives none.
    """

    method: str
    step: int
    motion_px: float
    gate_px: float | None
    frames: int
    incomplete_frames: int
    first_incomplete: int | None
    lost: int
    wrong: int
    new_ids: int | None


def stall_tests(
    methods: Mapping[str, Pipeline], source: SimulatedSource | None = None, steps: tuple[int, ...] = STEPS
) -> tuple[StallTest, ...]:
    """Every method at every speed, slowest first; `source` is the demo's scene by default."""
    scene = simulated_source() if source is None else source
    found = []
    for step in steps:
        indices = range(0, scene.frame_count, step)[:MOST_FRAMES]
        frames = [scene.simulator.frame(index) for index in indices]
        true_px = [scene.truth(index).grid.position_px for index in indices]
        motion_px = float(np.linalg.norm(np.diff(true_px, axis=0), axis=2).max())
        for method, pipeline in methods.items():
            grids = [each.grid for each in pipeline.track_frames(frames, scene.sensor)]
            gate_px = None
            if isinstance(pipeline.track, PaperTracking):
                gate_px = pipeline.track.start(scene.sensor).gate_px
            found.append(_test(method, (step, motion_px, gate_px), grids, true_px))
    return tuple(found)


def _test(
    method: str, shown: tuple[int, float, float | None], grids: list[TrackedGrid], true_px: list[Points2]
) -> StallTest:
    step, motion_px, gate_px = shown
    lost = [int((~grid.is_seen).sum()) for grid in grids]
    pitch_px = float(np.median(np.linalg.norm(np.diff(true_px[0], axis=0), axis=1)))
    wrong = [
        int((np.linalg.norm(grid.position_px - place_px, axis=1) > WRONG_PITCH * pitch_px).sum())
        for grid, place_px in zip(grids, true_px, strict=True)
    ]
    new = [grid.new_ids for grid in grids if grid.new_ids is not None]
    incomplete = [number for number, count in enumerate(lost) if count > 0]
    return StallTest(
        method=method,
        step=step,
        motion_px=motion_px,
        gate_px=gate_px,
        frames=len(grids),
        incomplete_frames=len(incomplete),
        first_incomplete=incomplete[0] if incomplete else None,
        lost=max(lost),
        wrong=max(wrong),
        new_ids=sum(new) if new else None,
    )


def stall_chart(tests: tuple[StallTest, ...]) -> str:
    """Lost and wrong identities, and incomplete frames, against speed, as SVG."""
    with figure(7.4, 3.4) as drawn:
        markers, frames = drawn.subplots(1, 2)
        for number, method in enumerate(dict.fromkeys(one.method for one in tests)):
            mine = [one for one in tests if one.method == method]
            speed_px = [one.motion_px for one in mine]
            style: dict[str, Any] = {
                "color": METHOD_COLOURS[number],
                "marker": PLOT_SYMBOLS[number],
                "markersize": 5,
            }
            markers.plot(speed_px, [one.lost for one in mine], **style, label=f"{method}: lost")
            wrong = [one.wrong for one in mine]
            markers.plot(speed_px, wrong, **style, linestyle=":", label=f"{method}: another's identity")
            share = [100.0 * one.incomplete_frames / one.frames for one in mine]
            frames.plot(speed_px, share, **style, label=method)
        gate_px = next((one.gate_px for one in tests if one.gate_px is not None), None)
        for axes in (markers, frames):
            if gate_px is not None:
                axes.axvline(gate_px, color=SOFT, linewidth=0.8)
            axes.set_xlabel("largest motion (px per frame)")
            axes.legend(loc="upper left")
        if gate_px is not None:
            frames.text(
                gate_px, 0.5, " gate of the paper", color=SOFT, transform=frames.get_xaxis_transform()
            )
        markers.set_ylim(bottom=-0.5)
        markers.set_title("Markers, in the worst frame")
        frames.set_ylim(-3.0, 100.0)
        frames.set_title("Frames without all identities (%)")
        return svg(
            drawn, "Lost and wrong identities, and incomplete frames, against the speed of the markers"
        )
