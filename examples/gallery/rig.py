"""Two sensors as one: `manytouch run rig.toml` joins their contacts in the frame of the rig.

Each sensor runs in a process of its own; with real cameras, `serial` or `source` name them. Here both
are simulated, and the second one stands opposite to the first, turned by 180 degrees about x.
"""

import csv
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from manytouch.cli import main as command

RIG = """
schema = 1
name = "gripper"

[[sensors]]
name = "left"
source = "sim:one"
[sensors.pose]
translation_mm = [0.0, 0.0, -30.0]

[[sensors]]
name = "right"
source = "sim:fingers"
[sensors.pose]
rotation_vector = [3.14159265, 0.0, 0.0]
translation_mm = [0.0, 0.0, 30.0]
"""


def main(picture: str = "rig.png") -> float:
    """Draw the contacts of both sensors in the frame of the rig; return their number."""
    with TemporaryDirectory() as text:
        folder = Path(text)
        (folder / "gripper.toml").write_text(RIG, encoding="utf-8")
        command(["run", str(folder / "gripper.toml"), "--out", str(folder / "out"), "--no-view"])
        with (folder / "out" / "gripper" / "contacts.csv").open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["phase"] != "end"]
    axes = plt.figure(figsize=(8, 6)).add_subplot(projection="3d")
    for name, colour in (("left", "C0"), ("right", "C1")):
        own = [row for row in rows if row["sensor"] == name]
        place = [[float(row[key]) for row in own] for key in ("x_mm", "y_mm", "z_mm")]
        axes.scatter(*place, s=4, c=colour, label=name)
        force = [
            [2 * float(row[key] or 0) for row in own[::10]] for key in ("force_x_N", "force_y_N", "force_z_N")
        ]
        axes.quiver(*[each[::10] for each in place], *force, color=colour, lw=0.7)
        height_mm = -30.0 if name == "left" else 30.0
        outline = [(-60, -40, height_mm), (60, -40, height_mm), (60, 40, height_mm), (-60, 40, height_mm)]
        axes.add_collection3d(Poly3DCollection([outline], facecolor=colour, edgecolor=colour, alpha=0.12))
    axes.quiver(-60, -40, 0, 0, 0, 10, color="black", lw=1.2)
    axes.text(-58, -40, 3, "5 N")
    axes.set(
        xlabel="x (mm)",
        ylabel="y (mm)",
        zlabel="z (mm)",
        xlim=(-60, 60),
        ylim=(-40, 40),
        zlim=(-45, 45),
        title="both sheets, their contacts and forces in the frame of the rig",
    )
    axes.legend()
    plt.savefig(picture, dpi=110)
    return float(len({(row["sensor"], row["contact"]) for row in rows}))


if __name__ == "__main__":
    main(*sys.argv[1:])
