"""Shear and torque: a sticking ball is pressed into a pad, moved sideways and turned.

`sim:pad` is a bonded pad as in GelSight Mini, seen through its window; the package contains the solved
scene. The shear is within a few percent of the truth; the torque is less certain, and up to half too
large here.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import manytouch


def rows(contacts: manytouch.Contacts, time_s: float) -> list[tuple[float, ...]]:
    """Time, identity, shear force along x and y, and torque of the contacts that touch."""
    return [(time_s, each.id, *each.force_N[:2], each.torque_Nmm) for each in contacts.touching]


def main(picture: str = "shear.png") -> float:
    """Draw shear and torque of the first contact with the truth; return the error of the shear, N."""
    source = manytouch.open_source("sim:pad")
    estimates, truth = [], []
    for reading in manytouch.prepare("sim:pad").readings():
        time_s = reading.frame.timestamp_ns * 1e-9
        estimates += rows(reading.contacts, time_s)
        truth += rows(source.truth(reading.frame.index).contacts, time_s)
        if reading.frame.index == 45:
            shown = reading
    estimate, true = np.array(estimates), np.array(truth)
    estimate, true = estimate[estimate[:, 1] == estimate[0, 1]], true[true[:, 1] == true[0, 1]]
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
    shown.draw(left)
    for column, name in ((2, "shear x (N)"), (3, "shear y (N)"), (4, "torque (N mm)")):
        (line,) = right.plot(estimate[:, 0], estimate[:, column], ".", label=name)
        right.plot(true[:, 0], true[:, column], color=line.get_color(), lw=0.8)
    right.set(xlabel="time (s)", title="first contact: estimate (dots), truth (lines)")
    right.legend()
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    common = np.isin(estimate[:, 0], true[:, 0]), np.isin(true[:, 0], estimate[:, 0])
    error_N = np.abs(estimate[common[0], 2] - true[common[1], 2])
    print(f"median error of the shear force {np.median(error_N):.3f} N")
    return float(np.median(error_N))


if __name__ == "__main__":
    main(*sys.argv[1:])
