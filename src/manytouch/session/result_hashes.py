"""Hashes of what a result is computed from, known before anything is processed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import manytouch
from manytouch.recording.json_codec import to_json
from manytouch.session.methods import Value, default_method, pipeline_for
from manytouch.sinks.files.result_hash import files_hash, text_hash, values_hash
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
    parameters: Mapping[str, Value] = field(default_factory=dict)


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
    options = {
        "method": method,
        "pipeline": parameters(pipeline_for(method, request.roi_px, request.parameters)),
        "pitch_mm": to_json(request.pitch_mm),
        "hfov_deg": request.hfov_deg,
        "fps": request.fps,
    }
    return {
        "input": None if source.is_live else _input_hash(source, text),
        "sensor": values_hash(to_json(known)),
        "parameters": values_hash(options),
        "version": manytouch.__version__,
    }


def _input_hash(source: Source, text: str) -> str:
    files = source.capabilities.files
    if files:
        return files_hash(files)
    scene = Path(text.removeprefix("sim:")).expanduser()
    return text_hash(text) + (files_hash([scene]) if scene.is_file() else "")
