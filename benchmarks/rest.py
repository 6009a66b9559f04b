"""Spurious contacts: images of the sheet at rest, each with its own noise.

    OMP_NUM_THREADS=1 python benchmarks/rest.py [--frames 10000] [--noise 5] [--method mechanics]

2560 x 1440 px, 600 dots, the built-in scene `rest`; the noise is the same everywhere, in grey levels of
255. Prints how many readings have a contact, and how far the depth is from zero.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from manytouch.session.methods import pipeline_for
from manytouch.simulation.scene.file import BUILT_IN, load_scene
from manytouch.simulation.solve_scene import simulator, solve_scene, states_folder
from manytouch.values import Frame, Sensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """Readings of an untouched sheet.

    Attributes:
        frames: readings.
        touched: readings with at least one contact.
        not_ok: readings whose status is not "ok".
        depth_rms_mm, std_rms_mm: RMS of the depth at the markers, and of its predicted standard deviation.
        deepest_mm: largest absolute depth of all markers and frames.
    """

    frames: int
    touched: int
    not_ok: int
    depth_rms_mm: float
    std_rms_mm: float
    deepest_mm: float


def untouched(frames: int, noise: float, width_px: int) -> tuple[Sensor, Iterator[Frame]]:
    """The sensor of the demo and a number of noisy frames of it."""
    scene = load_scene(BUILT_IN / "rest.toml", width_px=width_px)
    scene = replace(scene, look=replace(scene.look, read_noise=noise, shot_noise=0.0), duration_s=1e9)
    camera = simulator(scene, tuple(solve_scene(scene, states_folder())))
    return camera.sensor, (camera.frame(index) for index in range(frames))


def rest(method: str, *, frames: int, noise: float, width_px: int) -> Rest:
    """Process the frames one after the other."""
    sensor, pictures = untouched(frames, noise, width_px)
    touched, not_ok, square, variance, deepest = 0, 0, [], [], 0.0
    for reading in pipeline_for(method).run(pictures, sensor):
        touched += bool(reading.contacts.contacts)
        not_ok += reading.status != "ok"
        depth_mm = reading.surface.displacement_mm[:, 2]
        square.append(np.nanmean(depth_mm**2))
        variance.append(np.nanmean(reading.surface.covariance_mm2[:, 2, 2]))
        deepest = max(deepest, float(np.nanmax(np.abs(depth_mm))))
    return Rest(
        frames=len(square),
        touched=touched,
        not_ok=not_ok,
        depth_rms_mm=float(np.sqrt(np.mean(square))),
        std_rms_mm=float(np.sqrt(np.mean(variance))),
        deepest_mm=deepest,
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--noise", type=float, default=5.0, help="grey levels of 255")
    parser.add_argument("--method", default="mechanics")
    parser.add_argument("--width", type=int, default=2560, help="of the pictures, px")
    arguments = parser.parse_args()
    found = rest(arguments.method, frames=arguments.frames, noise=arguments.noise, width_px=arguments.width)
    print(
        f"{arguments.method}, {found.frames} frames at rest, noise {arguments.noise:g}: "
        f"{found.touched} with contacts, {found.not_ok} not ok; depth RMS {1e3 * found.depth_rms_mm:.2f} um, "
        f"predicted {1e3 * found.std_rms_mm:.2f}, largest {1e3 * found.deepest_mm:.1f}"
    )


if __name__ == "__main__":
    main()
