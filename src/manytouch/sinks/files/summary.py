"""summary.json: input, sensor, parameters, assumptions, counts and warnings of a run."""

import dataclasses
import json
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

import manytouch
from manytouch.pipeline import Pipeline
from manytouch.sinks.clear_forces import ClearForceCount
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.files.hashing import result_hash
from manytouch.sinks.files.rest.end_shift import EndShift
from manytouch.sinks.files.rest.rest_noise import RestNoise
from manytouch.sinks.files.sensor_description import (
    assumed_thickness,
    estimated_pretension,
    layout_of,
    rest_px,
    sensor_to_dict,
    view_mm,
)
from manytouch.sinks.files.tables import WITHOUT_SHEET, method_of
from manytouch.tracking.held_markers import COMPRESSED_VIDEO
from manytouch.values import LengthUnit, Reading, Roi, Sensor, SheetSpline, Status
from manytouch.values.display.text import count_of

SCHEMA = 1
SHORTEST_REST_S = 0.5  # before the first contact, for rest positions from the first frames
MOSTLY = 0.5  # share of the usable frames above which frames that the sheet does not describe are most
COARSE_THICKNESS = 3.5  # pitch from which on depths between markers are wrong by more than their deviations
RARELY_SEEN = 0.5  # share of the frames below which a marker causes a warning


class Summary:
    """Collects statistics of a run; a sink.

    Attributes:
        forces: how many frames have a force that differs from 0.
    """

    def __init__(
        self,
        *,
        sensor: Sensor,
        pipeline: Pipeline,
        method: str,
        recording: Mapping[str, Any],
        roi_px: Roi | None = None,
    ) -> None:
        """Start a summary.

        Args:
            sensor: the sensor in use.
            pipeline: its stages, whose parameters are recorded.
            method: name of the method.
            recording: a description of the input; `frame_count` is the announced number of frames, or None.
            roi_px: the part of the image that is processed; None for all of it.
        """
        self._sensor = sensor
        self._roi_px = roi_px
        self._pipeline = pipeline
        self._method = method
        self._recording = dict(recording)
        markers = len(layout_of(sensor).rest_mm)
        self._noise = RestNoise(markers)
        self.forces = ClearForceCount()
        self._end = EndShift(sensor)
        self._seen_count = np.zeros(markers, dtype=np.int64)
        self._status: Counter[Status] = Counter()
        self._is_compressed = False
        self._contacts: set[int] = set()
        self._most_at_once = 0
        self._frames_touched = 0
        self._milliseconds: list[float] = []
        self._last_index = -1
        self._begin_ns: int | None = None
        self._first_touch_ns: int | None = None
        self._methods: Counter[str] = Counter()
        self._touched_without_sheet = 0
        self._spline: SheetSpline | None = None
        self._added: tuple[str, ...] = ()

    def write(self, reading: Reading) -> None:
        """Add a frame."""
        touching = reading.contacts.touching
        self._noise.add(reading)
        self.forces.add(touching)
        self._end.add(reading)
        self._seen_count += reading.grid.is_seen
        self._status[reading.status] += 1
        self._is_compressed |= reading.grid.is_compressed
        self._contacts.update(contact.id for contact in touching)
        self._most_at_once = max(self._most_at_once, len(touching))
        self._frames_touched += bool(touching)
        self._last_index = reading.frame.index
        self._begin_ns = reading.frame.timestamp_ns if self._begin_ns is None else self._begin_ns
        if touching and self._first_touch_ns is None:
            self._first_touch_ns = reading.frame.timestamp_ns
        self._milliseconds.append(reading.milliseconds)
        if reading.surface.spline is not None:
            self._spline = reading.surface.spline
        if reading.status is Status.OK:
            method = method_of(reading, self._method) or self._method
            self._methods[method] += 1
            self._touched_without_sheet += bool(touching) and method == WITHOUT_SHEET

    def add_warnings(self, sentences: Sequence[str]) -> None:
        """Add warnings of the session, in place of those that were added before."""
        self._added = tuple(sentences)

    def close(self) -> None:
        """Nothing to complete: the file is written by `save`, after all others."""

    def save(
        self,
        folder: Path,
        *,
        is_complete: bool,
        hashes: Mapping[str, str | None],
        stamp: str | None = None,
    ) -> None:
        """Write summary.json.

        Args:
            folder: of the file.
            is_complete: whether all frames of the input were processed.
            hashes: of input, sensor, parameters and version; None where not known.
            stamp: by which a result is known to be current without reading the input; None where not known.

        Raises:
            OutputError: it cannot be written.
        """
        path = folder / "summary.json"
        content = {
            "schema": SCHEMA,
            "complete": is_complete,
            "hash": result_hash(hashes),
            "hashes": dict(hashes),
            "stamp": stamp,
            **self.to_dict(),
        }
        with output_errors(path):
            text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
            path.write_text(text + "\n", encoding="utf-8")

    @property
    def length_unit(self) -> LengthUnit:
        """Unit of the lengths."""
        return self._sensor.length_unit

    @property
    def frames(self) -> int:
        """Number of frames so far."""
        return sum(self._status.values())

    @property
    def noise_px(self) -> dict[str, Any]:
        """Noise of the markers at rest: median, worst, and of each marker (null where not known)."""
        noise = self._noise.per_marker_px()
        known = noise[np.isfinite(noise)]
        return {
            "median": _rounded(np.median(known)) if len(known) else None,
            "worst": _rounded(known.max()) if len(known) else None,
            "per_marker": [_rounded(value) for value in noise],
        }

    @property
    def counts(self) -> dict[str, Any]:
        """Frames, frames per status, frames that are ok per method that estimated them, contacts, markers."""
        return {
            "frames": sum(self._status.values()),
            "status": dict(sorted(self._status.items())),
            "methods": dict(sorted(self._methods.items())),
            "frames_with_contact": self._frames_touched,
            "contacts": len(self._contacts),
            "contacts_at_once": self._most_at_once,
            "markers": int((~layout_of(self._sensor).is_missing).sum()),
        }

    @property
    def pretension(self) -> dict[str, Any] | None:
        """The last estimate of a pretension that the sensor does not state; None without one."""
        found = estimated_pretension(self._sensor, self._spline)
        if found is None:
            return None
        return {name: None if value is None else _rounded(value) for name, value in found.items()}

    @property
    def thickness(self) -> dict[str, float | None] | None:
        """The thickness of an assumed sheet; None where it is known."""
        found = assumed_thickness(self._sensor, self._spline)
        return None if found is None else {name: _rounded(value) for name, value in found.items()}

    def to_dict(self) -> dict[str, Any]:
        """What was collected."""
        return {
            "input": self._recording,
            "method": self._method,
            "sensor": sensor_to_dict(self._sensor),
            "view_mm": view_mm(self._sensor),
            "assumptions": list(self._sensor.assumptions),
            "counts": self.counts,
            "forces": self.forces.to_dict(),
            "pretension": self.pretension,
            "thickness": self.thickness,
            "milliseconds": self._latency(),
            "noise_px": self.noise_px,
            "warnings": self.warnings(),
            "odd": self.warnings(),  # its name before 0.2
            "parameters": parameters(self._pipeline),
            "versions": versions(),
        }

    def warnings(self) -> list[str]:
        """Sentences on properties of the input that make results doubtful."""
        frames = sum(self._status.values())
        sentences = []
        for status, count in sorted(self._status.items()):
            if status is not Status.OK:
                has = "frame has" if frames == 1 else "frames have"
                sentences.append(f"{count} of {frames} {has} the status {status}. {status.remedy}")
        sentences += self._without_sheet()
        found = self._sensor.provenance.get("rest_warnings")
        for sentence in found if isinstance(found, list | tuple) else ():
            sentences.append(f"the sensor file was made with a warning: {sentence}")
        sentences += [*self._added, *self._rest_warnings(), *self.forces.warnings(self._sensor)]
        if self._is_compressed:
            sentences.append(COMPRESSED_VIDEO)
        sentences += self._coarse_pitch()
        sentences += self._end.warnings(self.noise_px["median"])
        if self._recording.get("warning") is not None:
            sentences.append(str(self._recording["warning"]))
        announced = self._recording.get("frame_count")
        if announced is not None and announced != frames:
            sentences.append(
                f"the input announced {announced} frames; {frames} were read, up to number {self._last_index}"
            )
        present = ~layout_of(self._sensor).is_missing
        searched = frames - self._status[Status.DECODE_ERROR] - self._status[Status.WRONG_SIZE]
        if self._roi_px is not None:
            x, y, width, height = self._roi_px
            beyond_px = rest_px(self._sensor) - [x, y]
            present &= ((beyond_px > 0) & (beyond_px < [width, height])).all(axis=1)
        rare = np.flatnonzero(present & (self._seen_count < RARELY_SEEN * searched))
        if len(rare):
            named = ", ".join(str(marker) for marker in rare[:12]) + (", ..." if len(rare) > 12 else "")
            who = "1 marker is" if len(rare) == 1 else f"{len(rare)} markers are"
            sentences.append(f"{who} seen in less than half of the frames: {named}")
        return sentences

    def _without_sheet(self) -> list[str]:
        """A warning if frames do not show the sheet; of an assumed sheet, only frames with a contact can."""
        frames, without_sheet = sum(self._status.values()), self._methods[WITHOUT_SHEET]
        if self._method == WITHOUT_SHEET:
            return []
        if self._sensor.sheet is not None and self._sensor.sheet.is_assumed:
            if self._touched_without_sheet <= MOSTLY * self._frames_touched:
                return []
            return [
                f"{self._touched_without_sheet} of {self._frames_touched} frames with a contact do not show "
                f"the clamped sheet {_shape_and_remedy(self._sensor)}; their surface and contacts are those "
                "of the method perimeter, and have no forces, not even relative ones"
            ]
        if without_sheet > MOSTLY * self._status[Status.OK] and self._has_known_sheet:
            return [
                f"the sensor file does not fit this recording: {without_sheet} of {frames} frames do not "
                "show the clamped sheet that it states. Do not use the contacts, depths and forces of this "
                "run until the file is corrected (size_mm, thickness_mm, pitch_mm, fx_px, fy_px), or "
                "process without --sensor, with --pitch-mm. The surface and the contacts of these frames "
                "are those of the method perimeter, and have no forces, not even relative ones"
            ]
        if without_sheet:
            return [
                f"{without_sheet} of {frames} frames do not show the clamped sheet "
                f"{_shape_and_remedy(self._sensor)}; their surface and contacts are those of the method "
                "perimeter, and have no forces, not even relative ones"
            ]
        return []

    @property
    def _has_known_sheet(self) -> bool:
        sheet = self._sensor.sheet
        return sheet is not None and not sheet.is_assumed

    def _coarse_pitch(self) -> list[str]:
        """A warning if the markers of a known sheet are too far apart for mechanics."""
        sheet = self._sensor.sheet
        if self._method != "mechanics" or not self._has_known_sheet or sheet is None:
            return []
        thicknesses = float(np.sqrt(np.prod(layout_of(self._sensor).pitch_mm))) / sheet.thickness_mm
        if sheet.boundary == "bonded" or thicknesses < COARSE_THICKNESS:
            return []
        return [
            f"the markers are {thicknesses:.1f} thicknesses of the sheet apart. Presses between them that "
            "are not deeper than a thickness may be missed, and their depths may be off by more than their "
            "standard deviations: print markers at most 3 thicknesses apart, or correct thickness_mm"
        ]

    def _rest_warnings(self) -> list[str]:
        """A warning if a contact begins shortly after the frames from which the rest positions are."""
        provenance = self._sensor.provenance
        is_from_start = "rest_frames" in provenance or provenance.get("from") != "whole recording"
        frames = self._sensor.rest_frames
        if self._begin_ns is None or self._first_touch_ns is None or frames is None or not is_from_start:
            return []
        rest_s = (self._first_touch_ns - self._begin_ns) * 1e-9
        if rest_s >= SHORTEST_REST_S:
            return []
        return [
            f"the rest is short: a contact begins {rest_s:.2f} s after the first frame, and the rest "
            f"positions are the mean of {count_of(frames, 'frame')}. Depths and forces may be off by more "
            "than their standard deviations, and contacts may be false: begin recordings with at least a "
            "second without a touch."
        ]

    def _latency(self) -> dict[str, float | None]:
        if not self._milliseconds:
            return {"p50": None, "p95": None, "p99": None}
        found = np.percentile(self._milliseconds, [50, 95, 99])
        return {name: _rounded(value) for name, value in zip(("p50", "p95", "p99"), found, strict=True)}


def _shape_and_remedy(sensor: Sensor) -> str:
    """Which sheet it is that some frames do not show, and what to correct."""
    sheet = sensor.sheet
    if sheet is None or not sheet.is_assumed:
        return (
            "of the sensor file: correct its size_mm and thickness_mm, or process without --sensor, with "
            "--pitch-mm"
        )
    (x, y), unit = sheet.size_mm, sensor.length_unit
    return (
        f"that was assumed ({x:.4g} x {y:.4g} {unit}, {sheet.thickness_mm:.3g} {unit} thick, from "
        'the pitch): give a sensor file (--sensor) in which size and thickness, and boundary = "bonded" of a '
        "pad on a window, are right, since guessed ones give worse results than none"
    )


def versions() -> dict[str, str | None]:
    """Versions of the packages that compute; None for those that are not installed."""
    found: dict[str, str | None] = {
        "manytouch": manytouch.__version__,
        "python": platform.python_version(),
        "platform": platform.platform(),
    }
    packages = {
        "numpy": ("numpy",),
        "numba": ("numba",),
        "opencv": ("opencv-python-headless", "opencv-python"),
    }
    for name, candidates in packages.items():
        found[name] = next((each for each in map(installed, candidates) if each is not None), None)
    return found


def installed(package: str) -> str | None:
    """The version of an installed package, or None."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def parameters(pipeline: Pipeline) -> dict[str, Any]:
    """The parameters of every stage by its name; how surfaces are evaluated is among those of `estimate`."""
    stages = {"detect": pipeline.detect, "track": pipeline.track, "estimate": pipeline.estimate}
    found: dict[str, Any] = {
        name: {"type": type(stage).__name__, **_plain(stage)} for name, stage in stages.items()
    }
    if pipeline.interpolation is not None:
        found["estimate"]["interpolation"] = _plain(pipeline.interpolation)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, Roi):
        return list(value)
    if dataclasses.is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return str(value)


def _rounded(value: float) -> float | None:
    return round(float(value), 4) if np.isfinite(value) else None
