"""Two fingers that close in are two contacts, with their own numbers, until their dents are one.

The two are distinguished by the likelihood of the markers, not by a threshold; the bands are two
standard deviations.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import manytouch

SCENE = Path(__file__).with_name("two_fingers.toml")


def main(picture: str = "two_fingers.png") -> float:
    """Draw both positions over time; return the median distance from the truth, mm."""
    source = manytouch.open_source(f"sim:{SCENE}")
    estimates, truth, errors_mm, shown = [], [], [], None
    for reading in manytouch.prepare(f"sim:{SCENE}").readings():
        time_s = reading.frame.timestamp_ns * 1e-9
        true = [each.centre_mm for each in source.truth(reading.frame.index).contacts.touching]
        truth += [(time_s, *each) for each in true]
        for contact in reading.contacts.touching:
            estimates.append((time_s, *contact.centre_mm, contact.std("x"), contact.id))
            if true:
                errors_mm.append(min(np.linalg.norm(contact.centre_mm - each) for each in true))
        if len(reading.contacts.touching) == 2 and time_s < 2.4:  # then they are lifted
            shown = reading
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
    manytouch.plot_surface(shown, left)
    left.set_title("depth, when they are nearest")
    right.plot(*np.array(truth)[:, :2].T, "k_", label="truth")
    table = np.array(estimates)
    for number in np.unique(table[:, 4]):
        time_s, x_mm, _, std_mm, _ = table[table[:, 4] == number].T
        right.errorbar(time_s, x_mm, 2 * std_mm, fmt=".", label=f"contact {number:.0f}")
    right.set(xlabel="time (s)", ylabel="x (mm)", title="positions while the fingers close in")
    right.legend()
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    print(f"median distance from the truth {np.median(errors_mm):.2f} mm")
    return float(np.median(errors_mm))


if __name__ == "__main__":
    main(*sys.argv[1:])
