"""A touch that is read for nothing where nothing has been compiled yet, so that no live one has to wait."""

from collections.abc import Iterator
from dataclasses import replace

from manytouch.session.methods import kernels, pipeline_for
from manytouch.sources.simulated import simulated_source
from manytouch.values import Frame

SCENE, WIDTH_PX = "one", 640
FRAMES = (0, 1, *range(38, 44), *range(50, 75, 5), *range(130, 150, 5), 170)  # at rest, touched, let go
OWN = {"mechanics": "manytouch.mechanics.", "perimeter": "manytouch.estimation.perimeter.law_kernels."}
"""Compiled functions that nothing but a method needs."""


def rehearse(method: str) -> bool:
    """Read a simulated touch, unless the disk holds machine code of the method's own functions.

    Without it the first touch of a live session would stand still while functions are compiled that no
    frame at rest needs.

    Args:
        method: that will be used.

    Returns:
        Whether it had to.
    """
    own = OWN.get(method)
    if own is None or any(is_kept for name, is_kept in kernels().items() if name.startswith(own)):
        return False
    simulator = simulated_source(SCENE, width_px=WIDTH_PX).simulator
    frames: Iterator[Frame] = (
        replace(simulator.frame(shown), index=index) for index, shown in enumerate(FRAMES)
    )
    for _ in pipeline_for(method).run(frames, simulator.sensor):
        pass
    return True
