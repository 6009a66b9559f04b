"""A ROS 2 bag with wrench and contacts, written and read without ROS.

`manytouch run 0 --to ros2://skin` publishes the same topics live; `ros2 bag play` shows this bag to any
node. Needs the extra: pip install 'manytouch[connect]'.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from rosbags.highlevel import AnyReader

from manytouch.cli import main as command


def main(picture: str = "ros2.png") -> float:
    """Draw the wrench; return the largest normal force, N."""
    with TemporaryDirectory() as text:
        folder = Path(text)
        command(["run", "sim:one", "--no-view", "--fps", "30", "--record", str(folder / "press.mcap")])
        command(["export", str(folder / "press.mcap"), "--ros2bag", str(folder / "bags")])
        rows = []
        with AnyReader([folder / "bags" / "press"]) as reader:
            topics = sorted(f"{each.topic}: {each.msgtype}" for each in reader.connections)
            wanted = [each for each in reader.connections if each.topic == "/manytouch/wrench"]
            for connection, stamp_ns, data in reader.messages(wanted):
                force = reader.deserialize(data, connection.msgtype).wrench.force
                rows.append((stamp_ns * 1e-9, force.x, force.y, force.z))
    table = np.array(rows)
    figure, (axes, right) = plt.subplots(1, 2, figsize=(12, 4), width_ratios=[3, 2])
    labels = ["force x", "force y", "force z (a press is negative)"]
    axes.plot(table[:, 0] - table[0, 0], table[:, 1:], label=labels)
    axes.set(xlabel="time (s)", ylabel="force (N)", title="/manytouch/wrench")
    axes.legend(loc="lower left")
    axes.set_xlim(-2.5, None)  # room for the legend
    right.text(0.0, 0.5, "\n\n".join(["topics of the bag", *topics]), va="center", fontsize=9)
    right.axis("off")
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    return float(-np.nanmin(table[:, 3]))


if __name__ == "__main__":
    main(*sys.argv[1:])
