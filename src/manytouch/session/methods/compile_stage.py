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
from manytouch.errors import ManytouchError
from manytouch.session.methods.pipelines import PAD, pipeline_for
from manytouch.sources.simulated import simulated_source
from manytouch.values import Frame
from manytouch.values.arrays import Image, read_only

SCENE, WIDTH_PX = "one", 640
FRAMES = (0, 1, *range(38, 44), *range(50, 75, 5), *range(130, 150, 5), 170)  # at rest, in contact, released
AT_REST_COUNT = 2  # of these, the first ones
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
    else:
        state = pipeline.estimate.start(simulator.sensor)
        for number in shown:
            state, _, _ = pipeline.estimate.step(state, simulator.truth(number).grid)


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
