"""How the recordings of a batch are processed, as a small value that travels to the workers."""

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import manytouch
from manytouch.recording.json_codec import from_json, to_json
from manytouch.session.methods import ParameterValue
from manytouch.session.result_hashes import Pitch, Request, request_hash
from manytouch.values import Roi, Sensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How all recordings of a batch are processed.

    Attributes:
        out: folder of the result folders, or its address in an object store.
        sensor: compressed JSON of the sensor; None: each input has its own, or it is found.
        method, pitch_mm, hfov_deg, roi_px, fps, parameters: see `manytouch.session.prepare`.
        surface, annotate: see `manytouch.session.results.ResultFiles`.
        is_verifying: inputs are compared by their bytes, also where size and time are unchanged.
        version: of the program that has begun the batch.
        request: `request_hash` of all this.
    """

    out: str
    sensor: bytes | None = None
    method: str | None = None
    pitch_mm: Pitch | None = None
    hfov_deg: float | None = None
    roi_px: Roi | None = None
    fps: float | None = None
    parameters: Mapping[str, ParameterValue] = field(default_factory=dict)
    surface: bool = False
    annotate: bool = False
    is_verifying: bool = False
    version: str = manytouch.__version__
    request: str = ""


def settings_for(
    out: str,
    request: Request,
    *,
    surface: bool = False,
    annotate: bool = False,
    is_verifying: bool = False,
) -> Settings:
    """Settings that carry a request to the workers."""
    sensor = request.sensor
    return Settings(
        out=out,
        sensor=None if sensor is None else zlib.compress(json.dumps(to_json(sensor)).encode()),
        method=request.method,
        pitch_mm=request.pitch_mm,
        hfov_deg=request.hfov_deg,
        roi_px=request.roi_px,
        fps=request.fps,
        parameters=dict(request.parameters),
        surface=surface,
        annotate=annotate,
        is_verifying=is_verifying,
        request=request_hash(request),
    )


def request_of(settings: Settings) -> Request:
    """The request that settings carry, with the same bits."""
    return Request(
        sensor=None if settings.sensor is None else _sensor(settings.sensor),
        method=settings.method,
        pitch_mm=settings.pitch_mm,
        hfov_deg=settings.hfov_deg,
        roi_px=settings.roi_px,
        fps=settings.fps,
        parameters=settings.parameters,
    )


@lru_cache(maxsize=1)
def _sensor(packed: bytes) -> Sensor:
    found = from_json(json.loads(zlib.decompress(packed)))
    assert isinstance(found, Sensor)
    return found
