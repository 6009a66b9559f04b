"""A method against the truth: all errors of one recording, or of many together."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from manytouch.evaluation.evaluated_recordings.evaluated_recording import (
    EvaluatedRecording,
    EvaluationError,
    subset,
)
from manytouch.evaluation.metrics.contacts import (
    ContactSamples,
    contact_figures,
    contact_samples,
    force_figures,
    region_figures,
)
from manytouch.evaluation.metrics.coverage import coverages
from manytouch.evaluation.metrics.depth import DepthSamples, depth_figures, depth_samples, error_against_depth
from manytouch.evaluation.metrics.latency import latency_figures
from manytouch.evaluation.metrics.markers import DotSamples, dot_figures, dot_samples
from manytouch.evaluation.metrics.matching import GATE_MM, PITCH_MM, REQUIRED_MM
from manytouch.evaluation.metrics.separation import (
    RATIOS,
    SeparationSamples,
    separation_curve,
    separation_samples,
)
from manytouch.evaluation.metrics.uncertainty_calibration import (
    UncertaintyCalibration,
    uncertainty_calibration,
)
from manytouch.evaluation.metrics.worst_frame import WorstFrame, find_worst_frame
from manytouch.values import LengthUnit
from manytouch.values.arrays import Scalars, read_only

Samples = TypeVar("Samples")
Figures = dict[str, dict[str, Any]]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MethodErrors:
    """The errors of one method on one recording.

    Attributes:
        name: of the recording.
        method: that is evaluated.
        unit: of everything named _mm.
        true_frames: frames of the truth.
        frames: of them, those that the method gave; only these are compared.
        failed: of these, those whose status is not "ok"; they are compared like all others.
        dots, depth, contacts, separation: samples of the metrics.
        milliseconds: (f,) of each frame.
        worst: the worst frame to look at; None when nothing touches.
        notes: sentences about what should be known of this comparison.
    """

    name: str
    method: str
    unit: LengthUnit
    true_frames: int
    frames: int
    failed: int
    dots: DotSamples
    depth: DepthSamples
    contacts: ContactSamples
    separation: SeparationSamples
    milliseconds: Scalars
    worst: WorstFrame | None
    notes: tuple[str, ...] = ()


def compare(
    truth: EvaluatedRecording,
    estimated: EvaluatedRecording,
    *,
    picture: Callable[[int], np.ndarray | None] | None = None,
) -> MethodErrors:
    """Compare the frames that both have.

    Args:
        truth: what was true.
        estimated: the estimates of the method, in the same unit.
        picture: gives the picture of a frame by its number, for the worst one.

    Raises:
        EvaluationError: the two have different units, or no frame in common.
    """
    if truth.unit != estimated.unit:
        raise EvaluationError(
            f"the result {estimated.name} is in {_plural(estimated.unit)} and the truth {truth.name} in "
            f"{_plural(truth.unit)}; process the recording again "
            + ("with --sensor or --pitch-mm" if truth.unit == "mm" else "without --sensor and --pitch-mm")
        )
    shared = np.intersect1d(truth.frame, estimated.frame)
    if not len(shared):
        raise EvaluationError(
            f"the result {estimated.name} (frames {_span(estimated)}) and the truth {truth.name} "
            f"(frames {_span(truth)}) have no frame in common; give the truth of the same recording"
        )
    true, given = _only(truth, shared), _only(estimated, shared)
    gate_mm, required_mm = gates(truth.unit)
    return MethodErrors(
        name=estimated.name,
        method=estimated.method,
        unit=truth.unit,
        true_frames=len(truth.frame),
        frames=len(shared),
        failed=sum(word != "ok" for word in given.status),
        dots=dot_samples(true, given),
        depth=depth_samples(true, given),
        contacts=contact_samples(true.contacts, given.contacts, gate_mm=gate_mm, required_mm=required_mm),
        separation=separation_samples(
            true.contacts, given.contacts, gate_mm=gate_mm, required_mm=required_mm
        ),
        milliseconds=given.milliseconds,
        worst=find_worst_frame(true, given, gate_mm=gate_mm, picture=picture),
        notes=_notes(truth, estimated, len(shared)),
    )


def gates(unit: LengthUnit) -> tuple[float, float]:
    """How near an estimated contact must be, and from which depth on a true one must be found."""
    scale = 1.0 if unit == "mm" else 1.0 / PITCH_MM
    return GATE_MM * scale, REQUIRED_MM * scale


def pooled(comparisons: Sequence[MethodErrors], name: str) -> MethodErrors:
    """Many comparisons of one method and unit as one: all samples together.

    Raises:
        EvaluationError: there is none, or their units differ.
    """
    units = {one.unit for one in comparisons}
    if len(units) != 1:
        raise EvaluationError(
            f"{name}: comparisons in one unit are needed, found {', '.join(sorted(units)) or 'none'}"
        )
    first = comparisons[0]
    ranked = [one.worst for one in comparisons if one.worst is not None]
    return replace(
        first,
        name=name,
        true_frames=sum(one.true_frames for one in comparisons),
        frames=sum(one.frames for one in comparisons),
        failed=sum(one.failed for one in comparisons),
        dots=_together([one.dots for one in comparisons]),
        depth=_together([one.depth for one in comparisons]),
        contacts=_together([one.contacts for one in comparisons]),
        separation=_together([one.separation for one in comparisons]),
        milliseconds=np.concatenate([one.milliseconds for one in comparisons]),
        worst=max(ranked, key=lambda worst_frame: worst_frame.rmse_mm, default=None),
        notes=tuple(dict.fromkeys(note for one in comparisons for note in one.notes)),
    )


def figures(comparison: MethodErrors) -> Figures:
    """All figures, by section and name; the name ends in the unit, _mm also where that is pitches."""
    return {
        "frames": {
            "true": comparison.true_frames,
            "compared": comparison.frames,
            "failed": comparison.failed,
        },
        "detection": dot_figures(comparison.dots),
        "depth": depth_figures(comparison.depth, shallowest_mm=gates(comparison.unit)[1]),
        "contacts": contact_figures(comparison.contacts),
        "force": force_figures(comparison.contacts),
        "region": region_figures(comparison.contacts),
        "separation": _separation_figures(comparison.separation),
        "latency": latency_figures(comparison.milliseconds),
        "calibration": {
            name: None if found is None else asdict(found)
            for name, found in uncertainty_calibrations(comparison).items()
        },
        "coverage": {
            name: None if found is None else asdict(found)
            for name, found in coverages(comparison.contacts).items()
        },
    }


def _separation_figures(samples: SeparationSamples) -> dict[str, Any]:
    """Frames with two contacts, all and those of each force ratio, and the distance that resolves these."""
    by_ratio = {f"{ratio:g}": separation_curve(samples, ratio) for ratio in RATIOS}
    return {
        "pairs": len(samples.is_resolved),
        **{f"pairs_at_1_to_{ratio}": sum(curve.frames) for ratio, curve in by_ratio.items()},
        **{f"from_mm_at_1_to_{ratio}": curve.from_mm for ratio, curve in by_ratio.items()},
    }


def curves(comparison: MethodErrors) -> dict[str, Any]:
    """What is drawn as curves: error against depth, separation."""
    return {
        "error_against_depth": error_against_depth(comparison.depth.true_mm, comparison.depth.error_mm),
        "separation": [asdict(separation_curve(comparison.separation, ratio)) for ratio in RATIOS],
    }


def uncertainty_calibrations(comparison: MethodErrors) -> dict[str, UncertaintyCalibration | None]:
    """Predicted deviations of centres, depths, positions and forces against their errors.

    Centres and positions count x and y as components of their own; the noise of both is alike.
    """
    dots, depth, contacts = comparison.dots, comparison.depth, comparison.contacts
    return {
        "centre": uncertainty_calibration(dots.error_px.ravel(), dots.std_px.ravel()),
        "depth": uncertainty_calibration(depth.error_mm, depth.std_mm),
        "position": uncertainty_calibration(contacts.offset_mm.ravel(), contacts.offset_std_mm.ravel()),
        "force": uncertainty_calibration(contacts.force_N - contacts.true_force_N, contacts.force_std_N),
    }


def _together(samples: Sequence[Samples]) -> Samples:
    """Samples of one kind, their arrays one after the other and their counts added."""
    first = samples[0]
    joined: dict[str, Any] = {}
    for field in fields(first):  # type: ignore[arg-type]
        parts = [getattr(one, field.name) for one in samples]
        joined[field.name] = sum(parts) if isinstance(parts[0], int) else np.concatenate(parts)
    return type(first)(**joined)


def _only(recording: EvaluatedRecording, frame: np.ndarray) -> EvaluatedRecording:
    """The recording without other frames."""
    kept = np.flatnonzero(np.isin(recording.frame, frame))
    arrays = ("frame", "milliseconds", "centre_px", "centre_std_px", "depth_mm", "depth_std_mm")
    return replace(
        recording,
        **{name: read_only(getattr(recording, name)[kept]) for name in arrays},
        status=tuple(recording.status[index] for index in kept),
        contacts=subset(recording.contacts, np.isin(recording.contacts.frame, frame)),
    )


def _notes(truth: EvaluatedRecording, estimated: EvaluatedRecording, shared: int) -> tuple[str, ...]:
    notes = []
    if shared < len(truth.frame):
        notes.append(f"{len(truth.frame) - shared} of {len(truth.frame)} true frames are not in the result")
    if shared < len(estimated.frame):
        notes.append(f"{len(estimated.frame) - shared} frames of the result have no truth; they are left out")
    if not np.array_equal(truth.marker, estimated.marker):
        notes.append(
            f"the result numbers {len(estimated.marker)} markers and the truth {len(truth.marker)}, so "
            "markers are paired by where they lie in the first frame"
        )
    return tuple(notes)


def _plural(unit: LengthUnit) -> str:
    return "millimetres" if unit == "mm" else "pitches"


def _span(recording: EvaluatedRecording) -> str:
    return f"{recording.frame[0]} to {recording.frame[-1]}" if len(recording.frame) else "none"
