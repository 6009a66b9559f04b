"""Compiles the kernels of a method before a live contact would have to wait for it."""

import hashlib
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import cv2
import numba
import numpy as np
from llvmlite.binding import get_host_cpu_name
from platformdirs import user_cache_path

from manytouch.calibration import sensor_from_rest
from manytouch.compilation import kernels_folder
from manytouch.errors import ManytouchError
from manytouch.kernel_cache import compiling, is_writable
from manytouch.session.methods import kernels, pipeline_for
from manytouch.sources.simulated import simulated_source
from manytouch.values.arrays import Image, read_only

SOURCES = Path(__file__).parents[1]
REST_FRAMES = 2
SCENE, WIDTH_PX = "one", 640
FRAMES = (0, 1, *range(38, 44), *range(50, 75, 5), *range(130, 150, 5), 170)  # at rest, in contact, released
OWN_KERNELS = {
    "mechanics": "manytouch.mechanics.solver.band_kernels",
    "perimeter": "manytouch.estimation.perimeter.law_kernels",
}
"""A module of compiled functions that only one method needs."""


def warm_up_kernels(method: str) -> bool:
    """Find a simulated layout and process a contact, unless this has been done with the present sources.

    Frames at rest do not need all kernels; without this a live session would stop until they are compiled,
    at the first contact, and where markers are lost for the first time. Of several processes that begin at
    once, one compiles and the others wait for it.

    Args:
        method: that will be used.

    Returns:
        Whether it was necessary.
    """
    own = OWN_KERNELS.get(method)
    if own is None or _is_compiled(method, own):
        return False
    with compiling():
        if _is_compiled(method, own):
            return False
        simulator = simulated_source(SCENE, width_px=WIDTH_PX).simulator
        frames = [replace(simulator.frame(shown), index=index) for index, shown in enumerate(FRAMES)]
        with suppress(ManytouchError):
            sensor_from_rest(frames[:REST_FRAMES], name=SCENE)
        image = frames[0].image
        assert image is not None
        lost = [
            replace(frames[0], index=len(FRAMES) + number, image=poor)
            for number, poor in enumerate(poor_images(image))
        ]
        for _ in pipeline_for(method).run([*frames, *lost], simulator.sensor):
            pass
        with suppress(OSError):
            mark = compiled_mark(method)
            mark.parent.mkdir(parents=True, exist_ok=True)
            mark.touch()
    return True


def poor_images(image: Image) -> Iterator[Image]:
    """Images in which markers are lost: moved partly out of view, without any marker, and blurred."""
    height, width = image.shape[:2]
    yield read_only(np.roll(image, (height // 12, width // 12), axis=(0, 1)))
    yield read_only(np.random.default_rng(0).integers(0, 256, image.shape, dtype=np.uint8))
    yield read_only(cv2.blur(image, (width // 30, width // 30)))


def compiled_mark(method: str) -> Path:
    """A file that exists once the kernels of a method are compiled, for these sources and this processor.

    It depends on all sources of the package: those that are loaded differ from one program to another.
    """
    stamps = [
        (str(file), found.st_mtime_ns, found.st_size)
        for file in sorted(SOURCES.rglob("*.py"))
        if (found := file.stat())
    ]
    content = repr((method, stamps, kernels_folder(), numba.__version__, sys.version, get_host_cpu_name()))
    digest = hashlib.sha256(content.encode()).hexdigest()[:20]
    return user_cache_path("manytouch") / "compiled" / digest


def _is_compiled(method: str, own: str) -> bool:
    import_module(own)  # methods import it when they need it, and `kernels` lists what is imported
    if not any(is_cached for name, is_cached in kernels().items() if name.startswith(f"{own}.")):
        return False
    mark = compiled_mark(method)
    return mark.exists() or not is_writable(mark.parent)
