"""Slip: a ball is pulled over a pad; first it sticks, then it slides.

While it sticks, the shear force grows; when it slides, the ratio of shear to normal force stays at the
coefficient of friction, 0.3. The first run solves the scene, which takes one or two minutes; later runs
use the stored states.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import manytouch

SCENE = Path(__file__).with_name("slip.toml")


def main(picture: str = "slip.png") -> float:
    """Draw forces and slip; return the estimated coefficient of friction."""
    rows = []
    for reading in manytouch.prepare(f"sim:{SCENE}").readings():
        for contact in reading.contacts.touching:
            shear_N, normal_N = np.linalg.norm(contact.force_N[:2]), -contact.force_N[2]
            rows.append((reading.frame.timestamp_ns * 1e-9, normal_N, shear_N, float(contact.slip or 0)))
    time_s, normal_N, shear_N, slip = np.array(rows).T
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(8, 5), sharex=True)
    upper.plot(time_s, normal_N, label="normal force")
    upper.plot(time_s, shear_N, label="shear force")
    upper.set(ylabel="force (N)")
    lower.plot(time_s, shear_N / normal_N, "C2", label="shear / normal")
    lower.axhline(0.3, color="k", lw=0.8, label="friction of the simulation")
    lower.set(xlabel="time (s)", ylabel="ratio", ylim=(0, 0.5))
    upper.set_ylim(0.0)
    for axes in (upper, lower):
        axes.fill_between(time_s, *axes.get_ylim(), where=slip > 0, color="C3", alpha=0.12, label="slip")
        axes.legend(loc="upper left")
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    friction = float(np.median((shear_N / normal_N)[slip > 0]))
    print(f"coefficient of friction: estimate {friction:.2f}, simulation 0.30")
    return friction


if __name__ == "__main__":
    main(*sys.argv[1:])
