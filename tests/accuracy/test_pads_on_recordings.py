"""Touches of a gel of a kind of sensor, on a recording that is not part of this repository."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

import manytouch
from manytouch.values import Reading

DATA = Path(__file__).parents[3] / "shared" / "data" / "gsrobotics"


def _labelled(contacts: str) -> list[range]:
    """Frames that surely show this number of contacts; those between were not labelled."""
    with (DATA / "hand_contact_spans.csv").open(encoding="utf-8", newline="") as table:
        rows = csv.DictReader(line for line in table if not line.startswith("#"))
        return [
            range(int(row["start"]), int(row["end"]) + 1) for row in rows if row["n_contacts"] == contacts
        ]


def _hollows(reading: Reading) -> int:
    """Number of hollows between the markers that are at least a fifth as deep as the deepest."""
    rest_mm = reading.surface.layout.rest_mm[:, :2]
    along = [np.linspace(low, high, 61) for low, high in zip(rest_mm.min(0), rest_mm.max(0), strict=True)]
    x_mm, y_mm = np.meshgrid(*along, indexing="ij")
    depth_mm = manytouch.sample(reading.surface, x_mm.ravel(), y_mm.ravel()).depth_mm.reshape(61, 61)
    return int(((depth_mm == maximum_filter(depth_mm, 9)) & (depth_mm > 0.2 * depth_mm.max())).sum())


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="the recordings in ../shared/data are not here")
def test_the_touches_of_a_finger_are_its_contacts_and_one_hollow_each() -> None:
    job = manytouch.prepare(DATA / "mini_example.avi", sensor="gelsight-mini", whole_recording=True)
    readings = list(job.readings())
    ids = [{each.id for each in reading.contacts.touching} for reading in readings]
    for number, frames in enumerate(_labelled("1")):
        assert all(ids[frame] == {number} for frame in frames)
        assert _hollows(readings[frames[len(frames) // 2]]) == 1
    assert not any(ids[frame] for frames in _labelled("0") for frame in frames)
    assert set().union(*ids) == set(range(len(_labelled("1"))))
