"""Features of touch of a LeRobot data set: their names, shapes and values, in one place, as they are a draft.

Layout v3.0 of huggingface/lerobot. The draft (pull request "Add tactile sensor module with unified point-set
interface") has point sets of displacements and wrenches below `observation.tactile`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from manytouch.values import Contact, Reading, Sensor, Status

VERSION = "v3.0"
IMAGE = "observation.images.tactile"
DISPLACEMENT = "observation.tactile.displacement"
IS_KNOWN = "observation.tactile.displacement_is_known"
IS_VALID = "observation.tactile.is_valid"
WRENCH = "observation.tactile.wrench"
WRENCH_STD = "observation.tactile.wrench_std"
WRENCH_IS_KNOWN = "observation.tactile.wrench_is_known"
CONTACTS = "observation.tactile.contacts"
CONTACTS_STD = "observation.tactile.contacts_std"
CONTACTS_STD_IS_KNOWN = "observation.tactile.contacts_std_is_known"
CONTACT_SLOTS = 8
ESTIMATED = ("x", "y", "depth", "shear_x", "shear_y", "normal_force", "area")
"""Estimates with the standard deviations of the numbers of `CONTACTS` after the first; force_z has that of
`normal_force`, its negative."""
CHUNK_FILES = 1000
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
ABOUT_PATH = "meta/manytouch.json"
COUNTERS = {
    "timestamp": "float32",
    **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64"),
}


def features(sensor: Sensor, fps: int, size_px: tuple[int, int]) -> dict[str, dict[str, Any]]:
    """Description of all features, as in meta/info.json."""
    layout = sensor.layout
    markers = 0 if layout is None else len(layout.rest_mm)
    unit = sensor.length_unit
    width_px, height_px = size_px
    image: dict[str, Any] = {
        "dtype": "video",
        "shape": [height_px, width_px, 3],
        "names": ["height", "width", "channels"],
        "info": {
            "video.fps": fps,
            "video.height": height_px,
            "video.width": width_px,
            "video.channels": 3,
            "video.codec": "vp9",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "has_audio": False,
        },
    }
    found: dict[str, dict[str, Any]] = {
        IMAGE: image,
        DISPLACEMENT: {
            "dtype": "float32",
            "shape": [markers, 3],
            "names": ["marker", f"x_y_z_{unit}"],
        },
        IS_KNOWN: {"dtype": "bool", "shape": [markers], "names": None},
        IS_VALID: {"dtype": "bool", "shape": [1], "names": None},
        CONTACTS: _contacts("float32", ("is_present", *contact_names(unit))),
        CONTACTS_STD: _contacts("float32", contact_names(unit, "_std")),
        CONTACTS_STD_IS_KNOWN: _contacts("bool", contact_names(unit, "_std")),
    }
    if sensor.sheet is not None and sensor.sheet.young_MPa is not None:
        forces = [f"force_{axis}{{}}_N" for axis in "xyz"] + [f"torque_{axis}{{}}_Nmm" for axis in "xyz"]
        for feature, std in ((WRENCH, ""), (WRENCH_STD, "_std")):
            names = [name.format(std) for name in forces]
            found[feature] = {"dtype": "float32", "shape": [6], "names": names}
        found[WRENCH_IS_KNOWN] = {"dtype": "bool", "shape": [2], "names": ["wrench", "wrench_std"]}
    for name, kind in COUNTERS.items():
        found[name] = {"dtype": kind, "shape": [1], "names": None}
    return found


def contact_names(unit: str, std: str = "") -> tuple[str, ...]:
    """Names of the estimates of a contact, or of their standard deviations."""
    lengths = tuple(f"{name}{std}_{unit}" for name in ("x", "y", "depth"))
    return *lengths, *(f"force_{axis}{std}_N" for axis in "xyz"), f"area{std}_{unit}2"


def _contacts(kind: str, names: tuple[str, ...]) -> dict[str, Any]:
    return {"dtype": kind, "shape": [CONTACT_SLOTS, len(names)], "names": ["contact", ",".join(names)]}


def values(reading: Reading, known: dict[str, dict[str, Any]]) -> dict[str, np.ndarray]:
    """The features of touch of a reading. Unknown numbers are 0, and the feature that states it is false."""
    moved_mm = reading.surface.displacement_mm.astype(np.float32)
    shape = (CONTACT_SLOTS, len(ESTIMATED))
    numbers, std = np.zeros((CONTACT_SLOTS, 1 + len(ESTIMATED)), np.float32), np.full(shape, np.nan)
    strongest = sorted(reading.contacts.touching, key=lambda contact: -contact.depth_mm)
    for place, contact in enumerate(sorted(strongest[:CONTACT_SLOTS], key=lambda contact: contact.id)):
        row = [1.0, *contact.centre_mm, contact.depth_mm, *contact.force_N, contact.area_mm2]
        numbers[place] = np.nan_to_num(row, nan=0.0)
        std[place] = [contact.std(name) for name in ESTIMATED]
    found: dict[str, np.ndarray] = {
        DISPLACEMENT: np.nan_to_num(moved_mm, nan=0.0),
        IS_KNOWN: np.asarray(np.isfinite(moved_mm).all(axis=1)),
        IS_VALID: np.asarray(reading.status is Status.OK),
        CONTACTS: numbers,
        CONTACTS_STD: np.nan_to_num(std, nan=0.0).astype(np.float32),
        CONTACTS_STD_IS_KNOWN: np.isfinite(std),
    }
    if WRENCH in known:
        wrench, wrench_std = _wrench(reading.contacts.touching)
        found[WRENCH] = np.nan_to_num(wrench, nan=0.0).astype(np.float32)
        found[WRENCH_STD] = np.nan_to_num(wrench_std, nan=0.0).astype(np.float32)
        is_known = np.isfinite(wrench).all(), np.isfinite(wrench_std).all()
        found[WRENCH_IS_KNOWN] = np.array(is_known) & (reading.status is Status.OK)
    return found


def _wrench(contacts: Sequence[Contact]) -> tuple[np.ndarray, np.ndarray]:
    """Force (N) and torque (N mm) of all contacts about the origin, with their standard deviations.

    The deviations of the contacts are added up, as if all had the same cause: mostly it is the modulus.
    """
    wrench, std = np.zeros(6), np.zeros(6)
    for contact in contacts:
        x, y = contact.centre_mm
        force_x, force_y, force_z = contact.force_N
        wrench[:3] += contact.force_N
        wrench[3:] += np.cross(np.array([x, y, 0.0]), contact.force_N)
        wrench[5] += contact.torque_Nmm
        # rows: the wrench; columns: ESTIMATES of values.contacts, whose normal force is -z
        slope = np.zeros((6, 8))
        slope[0, 3], slope[1, 4], slope[2, 5] = 1.0, 1.0, -1.0
        slope[3, [1, 5]] = force_z, -y
        slope[4, [0, 5]] = -force_z, x
        slope[5, [0, 1, 3, 4, 6]] = force_y, -force_x, -y, x, 1.0
        for row, each in enumerate(slope):
            used = each != 0.0
            std[row] += np.sqrt(each[used] @ contact.covariance[np.ix_(used, used)] @ each[used])
    return wrench, std
