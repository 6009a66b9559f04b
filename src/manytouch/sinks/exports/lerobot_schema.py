"""Names and shapes of the features of a LeRobot data set, in one place, since the names of touch are a draft.

Layout v3.0 of huggingface/lerobot. The draft (pull request "Add tactile sensor module with unified point-set
interface") has point sets of displacements and wrenches below `observation.tactile`.
"""

from typing import Any

import numpy as np

from manytouch.values import Reading, Sensor

VERSION = "v3.0"
IMAGE = "observation.images.tactile"
DISPLACEMENT = "observation.tactile.displacement"
IS_KNOWN = "observation.tactile.displacement_is_known"
WRENCH = "observation.tactile.wrench"
CONTACTS = "observation.tactile.contacts"
CONTACT_SLOTS = 8
CONTACT_NAMES = ("is_present", "x_mm", "y_mm", "depth_mm", "force_x_N", "force_y_N", "force_z_N", "area_mm2")
CHUNK_FILES = 1000
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
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
        CONTACTS: {
            "dtype": "float32",
            "shape": [CONTACT_SLOTS, len(CONTACT_NAMES)],
            "names": ["contact", ",".join(CONTACT_NAMES)],
        },
    }
    if sensor.sheet is not None and sensor.sheet.young_MPa is not None:
        names = ["force_x_N", "force_y_N", "force_z_N", "torque_x_Nmm", "torque_y_Nmm", "torque_z_Nmm"]
        found[WRENCH] = {"dtype": "float32", "shape": [6], "names": names}
    for name, kind in COUNTERS.items():
        found[name] = {"dtype": kind, "shape": [1], "names": None}
    return found


def values(reading: Reading, known: dict[str, dict[str, Any]]) -> dict[str, np.ndarray]:
    """The features of touch of a reading. Unknown numbers are 0, and `IS_KNOWN` or `is_present` is false."""
    moved_mm = reading.surface.displacement_mm.astype(np.float32)
    found: dict[str, np.ndarray] = {
        DISPLACEMENT: np.nan_to_num(moved_mm, nan=0.0),
        IS_KNOWN: np.asarray(np.isfinite(moved_mm).all(axis=1)),
        CONTACTS: np.zeros((CONTACT_SLOTS, len(CONTACT_NAMES)), np.float32),
    }
    wrench = np.zeros(6)
    strongest = sorted(reading.contacts.touching, key=lambda contact: -contact.depth_mm)
    for place, contact in enumerate(sorted(strongest[:CONTACT_SLOTS], key=lambda contact: contact.id)):
        numbers = [1.0, *contact.centre_mm, contact.depth_mm, *contact.force_N, contact.area_mm2]
        found[CONTACTS][place] = np.nan_to_num(numbers, nan=0.0)
    for contact in reading.contacts.touching:
        wrench[:3] += contact.force_N
        wrench[3:] += np.cross(np.array([*contact.centre_mm, 0.0]), contact.force_N)
        wrench[5] += contact.torque_Nmm
    if WRENCH in known:
        found[WRENCH] = np.nan_to_num(wrench, nan=0.0).astype(np.float32)
    return found
