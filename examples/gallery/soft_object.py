"""Soft or hard: a soft object flattens, so that its area grows faster with the force.

A hard ball and a body as flat as a soft fingertip that has yielded (the simulation has rigid bodies
only) press equally deep. The contact's region and its ellipse under uniform pressure give the area that
the dots determine.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

import manytouch

SCENE = """
schema = 1
name = "object"
seconds = 1.6
fps = 10.0
sensor = "demo"
width_px = 1280
mechanics = "shell"
[light]
read_noise = 1.5
[[bodies]]
shape = {shape}
motions = [{{ kind = "press", at_mm = [0, 0], depth_mm = 4.0, start_s = 0.3, end_s = 1.6, ramp_s = 0.6 }}]
"""
SHAPES = {
    "hard ball": '{ kind = "sphere", radius_mm = 4.0 }',
    "soft fingertip": '{ kind = "fingertip", semi_axes_mm = [14.0, 11.0, 5.0] }',
}


def main(picture: str = "soft_object.png") -> float:
    """Draw region and size over force; return the ratio of the sizes at the largest common force."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4))
    sizes = {}
    for place, (name, shape) in enumerate(SHAPES.items()):
        with TemporaryDirectory() as folder:
            scene = Path(folder) / "object.toml"
            scene.write_text(SCENE.format(shape=shape), encoding="utf-8")
            pressed = [
                each for each in manytouch.prepare(f"sim:{scene}").readings() if each.contacts.touching
            ]
        deepest = max(pressed, key=lambda each: -each.contacts.touching[0].force_N[2])
        manytouch.plot_surface(deepest, axes[place])
        axes[place].set(title=name, xlim=(-25, 25), ylim=(25, -25))
        contacts = [each.contacts.touching[0] for each in pressed]
        rows = [(-each.force_N[2], np.sqrt(each.half_major_mm * each.half_minor_mm)) for each in contacts]
        sizes[name] = np.array(sorted(rows))  # by force
        axes[2].plot(*sizes[name].T, "o-", label=name)
    axes[2].set(xlabel="normal force (N)", ylabel="radius of equal area (mm)")
    axes[2].legend()
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    common_N = min(table[:, 0].max() for table in sizes.values())
    hard_mm, soft_mm = (np.interp(common_N, *table.T) for table in sizes.values())
    ratio = float(soft_mm / hard_mm)
    print(
        f"at {common_N:.1f} N the soft fingertip touches with {ratio:.1f} times the radius of the hard ball"
    )
    return ratio


if __name__ == "__main__":
    main(*sys.argv[1:])
