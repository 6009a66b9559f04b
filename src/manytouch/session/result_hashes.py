"""Hashes of what a result is computed from, known before anything is processed."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import manytouch
from manytouch.recording.json_codec import to_json
from manytouch.session.methods import DEFAULT, ParameterValue, default_method, pipeline_for
from manytouch.sinks.files.hashing import files_hash, text_hash, values_hash
from manytouch.sinks.files.summary import parameters
from manytouch.sources import Source
from manytouch.values import Roi, Sensor

Pitch = float | tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Request:
    """What was requested of `prepare`; see its arguments."""

    sensor: Sensor | None = None
    method: str | None = None
    pitch_mm: Pitch | None = None
    hfov_deg: float | None = None
    roi_px: Roi | None = None
    fps: float | None = None
    parameters: Mapping[str, ParameterValue] = field(default_factory=dict)


def request_hashes(source: Source, text: str, request: Request) -> Mapping[str, str | None]:
    """SHA-256 of everything that determines a result: input, sensor, parameters and version.

    `result_hash` of it is the `hash` in summary.json: while both are equal and `complete` is true, the result
    is current. No frame is processed, and an input of files is read once.

    Args:
        source: the input, opened; `text` is what was given for it.
        text: names a source that has no files, such as `sim:one`.
        request: sensor and options.

    Returns:
        `input`: hash of the bytes of the files in their order, of the text where there is no file; None for
        cameras and streams. `sensor`: of the values of the given sensor, else of that of the source, else of
        none, since it is determined from the input then. `parameters`: of the options, the method and its
        parameters. `version`: of this package, as text.

    Raises:
        OSError: a file of the input cannot be read.
    """
    known = request.sensor if request.sensor is not None else source.capabilities.sensor
    method = request.method or (None if known is None else default_method(known))
    given = request.parameters if method is not None else {}  # else the method follows from the input
    options = {
        "method": method,
        "pipeline": parameters(pipeline_for(method or DEFAULT, request.roi_px, given)),
        "pitch_mm": to_json(request.pitch_mm),
        "hfov_deg": to_json(request.hfov_deg),
        "fps": to_json(request.fps),
    }
    if given != request.parameters:
        options["parameters"] = to_json(request.parameters)
    return {
        "input": None if source.is_live else _input_hash(source, text),
        "sensor": values_hash(to_json(known)),
        "parameters": values_hash(options),
        "version": manytouch.__version__,
    }


def request_hash(request: Request) -> str:
    """SHA-256 of what was requested and of the version, without the input."""
    values = {name: to_json(getattr(request, name)) for name in Request.__slots__ if name != "roi_px"}
    roi = None if request.roi_px is None else str(request.roi_px)
    return values_hash({**values, "roi_px": roi, "version": manytouch.__version__})


def files_stamp(text: str) -> str | None:
    """SHA-256 of names, sizes and times of the files of an input, none of which is read.

    Args:
        text: path of a file or of a folder, or the name of a simulated source.

    Returns:
        None where it does not exist.
    """
    path = Path(text.removeprefix("sim:")).expanduser()
    try:
        if path.is_dir():
            with os.scandir(path) as entries:
                found = sorted(_file_stamp(entry.name, entry.stat()) for entry in entries if entry.is_file())
        elif text.startswith("sim:") and not path.is_file():
            found = [(text, 0, 0)]
        else:
            found = [_file_stamp(path.name, path.stat())]
    except OSError:
        return None
    return values_hash(found)


def result_stamp(files: str | None, requested: str) -> str | None:
    """The `stamp` in summary.json, from `files_stamp` and `request_hash`.

    While it and `complete` are equal to those of a new request, the result is current and no file has to be
    read. Where it differs, only `hash` decides.
    """
    return None if files is None else text_hash(f"{files} {requested}")


def _file_stamp(name: str, found: os.stat_result) -> tuple[str, int, int]:
    return name, found.st_size, found.st_mtime_ns


def _input_hash(source: Source, text: str) -> str:
    files = source.capabilities.files
    if files:
        return files_hash(files)
    scene = Path(text.removeprefix("sim:")).expanduser()
    return text_hash(text) + (files_hash([scene]) if scene.is_file() else "")
