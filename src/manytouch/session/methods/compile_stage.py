"""Compiles the kernels of one stage of a method, in a process of its own.

The memory that compiling needs, more than processing frames, ends with the process.
"""

import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numba.core import event

from manytouch.calibration import sensor_from_rest
from manytouch.detection import DotSearch
from manytouch.errors import ManytouchError
from manytouch.session.methods.pipelines import PAD, pipeline_for
from manytouch.sources.simulated import simulated_source
from manytouch.values import Frame, Layout, Sensor, TrackedGrid
from manytouch.values.arrays import Image, read_only
from manytouch.values.sensor_file.assumed_sheet import assumed_sheet

SCENE, WIDTH_PX = "one", 640
FRAMES = (0, 1, *range(38, 44), *range(50, 75, 5), *range(130, 150, 5), 170)  # at rest, in contact, released
AT_REST_COUNT = 2  # of these, the first ones
OF_PRESSED = 3  # each third one for long and wide objects and an assumed sheet: others call the same kernels
Shifts = tuple[tuple[int, int], ...]
LONG: Shifts = ((0, -1), (0, 1))
WIDE: Shifts = tuple((row, column) for row in range(-2, 3) for column in range(-2, 3))
"""Rows and columns between the parts of a long and of a wide object."""
OBJECTS_PER_COLLECTION = 200_000
"""Compiling makes millions of objects, few of them garbage: a search through them takes long."""


def compile_stage(method: str, stage: str) -> None:
    """Process a simulated contact, so that all functions are compiled that its frames need.

    Args:
        method: of the pipeline, or `PAD`.
        stage: "pixels": detection and tracking, also of frames in which markers are lost; "contacts": what
            follows them, from the true positions of the dots.
    """
    is_pad = method == PAD and stage == "contacts"
    simulator = simulated_source(PAD if is_pad else SCENE, width_px=WIDTH_PX).simulator
    pipeline = pipeline_for("mechanics" if method == PAD else method)
    shown = [number // 2 if is_pad else number for number in FRAMES]  # the scene of the pad is half as long
    if stage == "pixels":
        frames = [replace(simulator.frame(number), index=index) for index, number in enumerate(shown)]
        with suppress(ManytouchError):
            sensor_from_rest(frames[:AT_REST_COUNT], name=SCENE)
        for _ in pipeline.track_frames([*frames, *frames_without_markers(frames)], simulator.sensor):
            pass
        search, place_px = DotSearch(), simulator.truth(0).grid.position_px
        search.step(search.start(before_scene(simulator.sensor)), frames[0], place_px)
    else:
        grids = [simulator.truth(number).grid for number in shown]
        for sensor, seen in _sheets(simulator.sensor, grids, is_mechanics=method == "mechanics"):
            state = pipeline.estimate.start(sensor)
            for grid in seen:
                state, _, _ = pipeline.estimate.step(state, grid)


def before_scene(sensor: Sensor) -> Sensor:
    """The sensor as if its sheet were transparent."""
    assert sensor.layout is not None
    return replace(sensor, layout=replace(sensor.layout, is_before_scene=True))


def _sheets(
    sensor: Sensor, grids: list[TrackedGrid], *, is_mechanics: bool
) -> Iterator[tuple[Sensor, list[TrackedGrid]]]:
    """Sensors, each with the grids that are estimated for it.

    `mechanics` has other functions for a long or wide object, and for an assumed sheet and the frames that
    this does not describe.
    """
    if not is_mechanics:
        yield sensor, grids
        return
    layout = sensor.layout
    assert layout is not None
    pressed = grids[AT_REST_COUNT:-1]
    wide = [drawn_out(layout, grids[0], grid, by) for by in (LONG, WIDE) for grid in pressed[::OF_PRESSED]]
    yield sensor, [*grids[:-1], *wide, grids[-1]]
    yield replace(sensor, sheet=assumed_sheet(layout)), [*grids[:AT_REST_COUNT], *pressed[::OF_PRESSED]]


def drawn_out(layout: Layout, rest: TrackedGrid, grid: TrackedGrid, by: Shifts) -> TrackedGrid:
    """A frame as if the object were at several places at once, each so many rows and columns away.

    It moves the markers as far as one object and a half.
    """
    assert layout.row_column is not None
    assert layout.shape is not None
    row, column = layout.row_column.T
    motion_px = np.zeros((*layout.shape, 2))
    motion_px[row, column] = grid.position_px - rest.position_px
    moved_px = sum(np.roll(motion_px, shift, axis=(0, 1))[row, column] for shift in by) * (1.5 / len(by))
    return replace(grid, position_px=read_only(rest.position_px + moved_px))


def frames_without_markers(frames: list[Frame]) -> Iterator[Frame]:
    """Frames after others in which markers are lost."""
    image = frames[0].image
    assert image is not None
    for number, poor in enumerate(poor_images(image)):
        yield replace(frames[0], index=len(frames) + number, image=poor)


def poor_images(image: Image) -> Iterator[Image]:
    """Images in which markers are lost: moved partly out of view, without any marker, and blurred."""
    height, width = image.shape[:2]
    yield read_only(np.roll(image, (height // 12, width // 12), axis=(0, 1)))
    yield read_only(np.random.default_rng(0).integers(0, 256, image.shape, dtype=np.uint8))
    yield read_only(cv2.blur(image, (width // 30, width // 30)))


class CompiledFunctions(event.Listener):
    """Calls a function for each one that has been compiled, but not for its parts."""

    def __init__(self, on_compiled: Callable[[str], object]) -> None:
        self._on_compiled, self._depth = on_compiled, 0

    def on_start(self, event: Any) -> None:
        """A function or a part of one begins to be compiled."""
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """It is compiled, or could not be."""
        self._depth -= 1
        if self._depth == 0:
            self._on_compiled(event.data["dispatcher"].py_func.__qualname__)


def print_name(name: str) -> None:
    """Report progress to the process that started this one."""
    sys.stdout.write(f"{name}\n")
    sys.stdout.flush()


def main(method: str, stage: str) -> None:
    """Compile, and print the name of each function."""
    gc.freeze()
    gc.set_threshold(OBJECTS_PER_COLLECTION, 10, 10)
    event.register("numba:compile", CompiledFunctions(print_name))
    compile_stage(method, stage)
