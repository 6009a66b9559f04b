"""Recordings as a LeRobot data set (layout v3.0): an episode per recording, with video, touch and statistics.

Frames are those with a reading and an image, counted from 0 at their rate: LeRobot requires
even times. Images are padded to an even height and width.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from manytouch.errors import OutputError
from manytouch.recording.reader import Recording
from manytouch.sinks.exports import lerobot_schema as schema
from manytouch.sinks.exports.parquet import description
from manytouch.sinks.exports.readings import frames_of
from manytouch.sinks.pictures.video_file import VideoFile

TASK = "touch"
IMAGES_OF_STATISTICS = 64  # per episode
DEFAULT_FPS = 30  # of a recording with a single frame
MAX_RATE_DIFFERENCE = 0.1  # share, of recordings of one data set; sessions that skip frames differ a little
_KINDS = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}


@dataclass(slots=True, eq=False, kw_only=True)
class _Episode:
    """The columns of an episode, and a sample of its images."""

    columns: dict[str, list[np.ndarray]] = field(default_factory=dict)
    pixels: list[np.ndarray] = field(default_factory=list)
    length: int = 0


def write_lerobot(recordings: Sequence[Recording], folder: Path) -> None:
    """Write recordings of one sensor as one data set.

    Raises:
        OutputError: the recordings differ in their markers, image size or rate, or have no frames to write.
    """
    fps = _common_fps(recordings)
    first = next((image for _, _, image in _frames(recordings[0])), None)
    if first is None:
        raise OutputError(f"{recordings[0].path} has no frame with an image and a reading: nothing to export")
    size_px = (first.shape[1], first.shape[0])
    known = schema.features(recordings[0].sensor, fps, size_px)
    episodes = [
        _episode(recording, _video_path(folder, number), fps, known, size_px)
        for number, recording in enumerate(recordings)
    ]
    _write_data(folder, episodes, known, fps)
    _write_meta(folder, episodes, known, fps)
    about = [description(recording.sensor, recording.about) for recording in recordings]
    (folder / schema.ABOUT_PATH).write_text(json.dumps(about, indent=4), encoding="utf-8")


def _common_fps(recordings: Sequence[Recording]) -> int:
    """The rate of the first recording; a data set has one rate, which gives the times of all frames."""
    fps = _fps(recordings[0]) or DEFAULT_FPS
    for recording in recordings[1:]:
        other = _fps(recording) or fps
        if abs(other - fps) > max(MAX_RATE_DIFFERENCE * fps, 1.0):
            raise OutputError(
                f"{recording.path} has {other} frames per second, the first recording {fps}: "
                "export recordings of one rate together"
            )
    return fps


def _frames(recording: Recording) -> Any:
    """Frame, reading and image (h, w, 3) of even size, of the frames that have all three."""
    import cv2

    for frame, reading in frames_of(recording):
        if reading is None or frame.encoded is None:
            continue
        image = cv2.imdecode(np.frombuffer(frame.encoded, np.uint8), cv2.IMREAD_COLOR)
        if image is not None:
            padding = ((0, image.shape[0] % 2), (0, image.shape[1] % 2), (0, 0))
            yield frame, reading, np.pad(image, padding, mode="edge")


def _episode(
    recording: Recording,
    video_path: Path,
    fps: int,
    known: dict[str, dict[str, Any]],
    size_px: tuple[int, int],
) -> _Episode:
    """Write the video of a recording and collect the rest."""
    episode = _Episode()
    video_path.parent.mkdir(parents=True, exist_ok=True)
    video = VideoFile(video_path, float(fps))
    step = max(len(recording) // IMAGES_OF_STATISTICS, 1)
    markers = known[schema.DISPLACEMENT]["shape"][0]
    try:
        for _, reading, image in _frames(recording):
            is_alike = image.shape[1::-1] == size_px and len(reading.surface.displacement_mm) == markers
            if not is_alike:
                raise OutputError(
                    f"{recording.path} has another image size or number of markers than the first recording: "
                    "export recordings of one sensor together"
                )
            video.write(image)
            if episode.length % step == 0:
                episode.pixels.append(image[::4, ::4, ::-1].reshape(-1, 3) / 255.0)
            for name, value in schema.values(reading, known).items():
                episode.columns.setdefault(name, []).append(value)
            episode.length += 1
    finally:
        video.close()
    if not episode.length:
        raise OutputError(f"{recording.path} has no frame with an image and a reading: nothing to export")
    return episode


def _write_data(
    folder: Path, episodes: Sequence[_Episode], known: dict[str, dict[str, Any]], fps: int
) -> None:
    path = folder / schema.DATA_PATH.format(chunk_index=0, file_index=0)
    path.parent.mkdir(parents=True)
    kinds = pa.schema([(name, _arrow_type(each)) for name, each in known.items() if each["dtype"] != "video"])
    begin = 0
    with pq.ParquetWriter(path, kinds) as writer:
        for number, episode in enumerate(episodes):
            table = {**episode.columns, **_counters(number, episode.length, begin, fps)}
            arrays = [
                pa.array([np.asarray(value).tolist() for value in table[name]], kinds.field(name).type)
                for name in kinds.names
            ]
            writer.write_table(pa.Table.from_arrays(arrays, schema=kinds))
            begin += episode.length


def _counters(number: int, length: int, begin: int, fps: int) -> dict[str, list[Any]]:
    places = range(length)
    return {
        "timestamp": [place / fps for place in places],
        "frame_index": list(places),
        "episode_index": [number] * length,
        "index": [begin + place for place in places],
        "task_index": [0] * length,
    }


def _write_meta(
    folder: Path, episodes: Sequence[_Episode], known: dict[str, dict[str, Any]], fps: int
) -> None:
    frames = sum(episode.length for episode in episodes)
    info = {
        "codebase_version": schema.VERSION,
        "robot_type": "manytouch",
        "total_episodes": len(episodes),
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": schema.CHUNK_FILES,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 500,
        "fps": fps,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": schema.DATA_PATH,
        "video_path": schema.VIDEO_PATH,
        "features": known,
    }
    meta = folder / "meta"
    (folder / schema.EPISODES_PATH).parent.mkdir(parents=True)
    (meta / "info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")
    begin, rows, all_stats = 0, [], []
    for number, episode in enumerate(episodes):
        stats = _statistics(episode, number, begin, fps)
        all_stats.append(stats)
        rows.append(_episode_row(number, episode, begin, fps, stats))
        begin += episode.length
    pq.write_table(pa.Table.from_pylist(rows), folder / schema.EPISODES_PATH)
    (meta / "stats.json").write_text(json.dumps(_pooled(all_stats), indent=4), encoding="utf-8")
    pq.write_table(_tasks(), meta / "tasks.parquet")


def _episode_row(
    number: int, episode: _Episode, begin: int, fps: int, stats: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    video = f"videos/{schema.IMAGE}"
    place = _place(number)
    return {
        "episode_index": number,
        "tasks": [TASK],
        "length": episode.length,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": begin,
        "dataset_to_index": begin + episode.length,
        f"{video}/chunk_index": place["chunk_index"],
        f"{video}/file_index": place["file_index"],
        f"{video}/from_timestamp": 0.0,
        f"{video}/to_timestamp": episode.length / fps,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
        **{f"stats/{name}/{key}": value for name, each in stats.items() for key, value in each.items()},
    }


def _statistics(episode: _Episode, number: int, begin: int, fps: int) -> dict[str, dict[str, Any]]:
    """Least, largest, mean, standard deviation and number of values, over the frames."""
    counters = _counters(number, episode.length, begin, fps)
    numbers = {
        name: np.asarray(values, np.float64) for name, values in {**episode.columns, **counters}.items()
    }
    found = {name: _summary(values, episode.length) for name, values in numbers.items()}
    pixels = _summary(np.concatenate(episode.pixels), len(episode.pixels))
    found[schema.IMAGE] = {
        key: value if key == "count" else np.reshape(value, (3, 1, 1)).tolist()
        for key, value in pixels.items()
    }
    return found


def _summary(values: np.ndarray, count: int) -> dict[str, Any]:
    over = values.reshape(len(values), -1) if values.ndim == 1 else values
    return {
        "min": over.min(axis=0).tolist(),
        "max": over.max(axis=0).tolist(),
        "mean": over.mean(axis=0).tolist(),
        "std": over.std(axis=0).tolist(),
        "count": [count],
    }


def _pooled(episodes: Sequence[dict[str, dict[str, Any]]]) -> dict[str, dict[str, Any]]:
    """Statistics of all episodes together, from those of each."""
    pooled = {}
    for name in episodes[0]:
        each = [{key: np.array(value) for key, value in stats[name].items()} for stats in episodes]
        counts = np.array([stats["count"][0] for stats in each], np.float64)
        weights = counts / counts.sum()
        mean = sum(weight * stats["mean"] for weight, stats in zip(weights, each, strict=True))
        square = sum(
            weight * (stats["std"] ** 2 + (stats["mean"] - mean) ** 2)
            for weight, stats in zip(weights, each, strict=True)
        )
        pooled[name] = {
            "min": np.min([stats["min"] for stats in each], axis=0).tolist(),
            "max": np.max([stats["max"] for stats in each], axis=0).tolist(),
            "mean": np.asarray(mean).tolist(),
            "std": np.sqrt(square).tolist(),
            "count": [int(counts.sum())],
        }
    return pooled


def _tasks() -> pa.Table:
    """The list of tasks, as a table whose index for pandas is the task."""
    index = "__index_level_0__"
    table = pa.table({"task_index": pa.array([0], pa.int64()), index: pa.array([TASK])})
    columns: list[dict[str, Any]] = [
        {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64"},
        {"name": None, "field_name": index, "pandas_type": "unicode", "numpy_type": "object"},
    ]
    pandas = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [{**column, "metadata": None} for column in columns],
        "pandas_version": "2.0.0",
    }
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def _arrow_type(feature: dict[str, Any]) -> pa.DataType:
    kind: Any = _KINDS[feature["dtype"]]
    shape = feature["shape"]
    if shape == [1]:
        return cast("pa.DataType", kind)
    for size in reversed(shape):
        kind = pa.list_(kind, size) if len(shape) == 1 else pa.list_(kind)
    return cast("pa.DataType", kind)


def _video_path(folder: Path, number: int) -> Path:
    return folder / schema.VIDEO_PATH.format(video_key=schema.IMAGE, **_place(number))


def _place(number: int) -> dict[str, int]:
    chunk, file = divmod(number, schema.CHUNK_FILES)
    return {"chunk_index": chunk, "file_index": file}


def _fps(recording: Recording) -> int | None:
    """Frames per second, rounded, from the median step between frames with a reading; None of a single one.

    A recording of a camera also has the frames that the session skipped.
    """
    read = [place for place in range(len(recording)) if recording.has_reading(place)]
    steps_ns = np.diff([recording.timestamp_ns(place) for place in read])
    if not len(steps_ns) or np.median(steps_ns) <= 0:
        return None
    return max(round(1e9 / float(np.median(steps_ns))), 1)
