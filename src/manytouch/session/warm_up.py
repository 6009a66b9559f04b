"""Compiles the kernels of a method before a live contact would have to wait for it."""

from collections.abc import Iterator
from dataclasses import replace

from manytouch.session.methods import kernels, pipeline_for
from manytouch.sources.simulated import simulated_source
from manytouch.values import Frame

SCENE, WIDTH_PX = "one", 640
FRAMES = (0, 1, *range(38, 44), *range(50, 75, 5), *range(130, 150, 5), 170)  # at rest, in contact, released
OWN_KERNELS = {
    "mechanics": "manytouch.mechanics.",
    "perimeter": "manytouch.estimation.perimeter.law_kernels.",
}
"""Compiled functions that only one method needs, by the beginning of their names."""


def warm_up_kernels(method: str) -> bool:
    """Process a simulated contact, unless machine code of the method's own kernels is cached.

    Frames at rest do not need all kernels; without this the first contact of a live session would be delayed
    until they are compiled.

    Args:
        method: that will be used.

    Returns:
        Whether it was necessary.
    """
    own = OWN_KERNELS.get(method)
    if own is None or any(is_cached for name, is_cached in kernels().items() if name.startswith(own)):
        return False
    simulator = simulated_source(SCENE, width_px=WIDTH_PX).simulator
    frames: Iterator[Frame] = (
        replace(simulator.frame(shown), index=index) for index, shown in enumerate(FRAMES)
    )
    for _ in pipeline_for(method).run(frames, simulator.sensor):
        pass
    return True
