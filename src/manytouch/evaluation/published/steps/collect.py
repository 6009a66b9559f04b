"""Runs the paper's method on an input and keeps every intermediate result of one frame."""

from dataclasses import dataclass
from typing import get_args

import numpy as np
from jaxtyping import Float64

from manytouch.errors import ManytouchError
from manytouch.geometry.camera import onto_plane
from manytouch.geometry.inverse_distance import AT_MARKER, plane_of
from manytouch.paper.detection import DetectionStages, PaperDetection, PaperDetectionState
from manytouch.paper.estimation import PaperEstimation, PaperEstimationState, perimeter_depth
from manytouch.paper.quads import Formula, corner_values
from manytouch.session.prepare import Job
from manytouch.session.run import NoObserver, Observer, StopCondition
from manytouch.values import Reading, Status
from manytouch.values.arrays import Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SampleCalculation:
    """Table 2: inverse distance weighting at one point of the plane.

    Attributes:
        point_mm: (2,) the point.
        marker: numbers of the markers within the search radius.
        distance_mm, depth_mm, share: of each of them; the shares sum to 1.
        result_mm: the depth of the surface there.
    """

    point_mm: Float64[np.ndarray, "2"]
    marker: tuple[int, ...]
    distance_mm: tuple[float, ...]
    depth_mm: tuple[float, ...]
    share: tuple[float, ...]
    result_mm: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PaperSteps:
    """One frame on its way through the method.

    Attributes:
        job: the input with its sensor and pipeline.
        rest: reading of the first frame in which the markers were numbered; None: in none so far.
        reading: of the frame that is explained.
        view: the detection's area of interest.
        stages: intermediate images.
        estimation: quads and initial perimeters.
        plane_mm: (m, 2) present coordinates of the markers on the plane at rest; NaN where not seen.
        marker: whose quad is shown: the deepest of those with a quad; None: none has a depth.
        depth_by_formula_mm: depth of this marker in each reading of equations 12 and 13.
        true_depth_mm: its true depth, where the input knows it.
        sample: a sample calculation of the surface; None where `marker` is None.
        lost_ids, new_ids: up to this frame.
        frames: number of frames up to this one.
    """

    job: Job
    rest: Reading | None
    reading: Reading
    view: PaperDetectionState
    stages: DetectionStages
    estimation: PaperEstimationState
    plane_mm: Points2
    marker: int | None
    depth_by_formula_mm: dict[str, float]
    true_depth_mm: float | None
    sample: SampleCalculation | None
    lost_ids: int
    new_ids: int
    frames: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Kept:
    """A frame that may be the one to explain."""

    reading: Reading
    view: PaperDetectionState
    lost_ids: int
    new_ids: int
    frames: int


def collect_steps(
    job: Job,
    *,
    frame: int | None = None,
    observer: Observer | None = None,
    stop: StopCondition | None = None,
) -> PaperSteps:
    """Process the frames of a job with method `paper` and keep what one of them goes through.

    Args:
        job: from `prepare`, with method "paper".
        frame: number of the frame; None selects the one with the most contacts, and of those the deepest;
            frames in which all markers have their identity go before others.
        observer: notified of begin and frames.
        stop: ends the search for the frame early.

    Raises:
        ManytouchError: the input has no such frame, or no frame with an image.
    """
    pipeline, sensor = job.pipeline, job.sensor
    detect, estimate = pipeline.detect, pipeline.estimate
    assert isinstance(detect, PaperDetection)
    assert isinstance(estimate, PaperEstimation)
    detecting, tracking = detect.start(sensor), pipeline.track.start(sensor)
    estimating = estimate.start(sensor)
    watch = NoObserver() if observer is None else observer
    watch.on_begin(sensor, job.frame_count)
    rest, kept, rank = None, None, (False, False, -1, -1.0)
    lost = new = count = 0
    for each in job.frames:
        before = detecting
        detecting, detections = detect.step(detecting, each, None)
        tracking, grid = pipeline.track.step(tracking, detections)
        estimating, surface, contacts = estimate.step(estimating, grid)
        reading = Reading(
            frame=each,
            detections=detections,
            grid=grid,
            surface=surface,
            contacts=contacts,
            milliseconds=0.0,
        )
        watch.on_reading(reading)
        lost, new, count = lost + (grid.lost_ids or 0), new + (grid.new_ids or 0), count + 1
        rest = reading if rest is None and grid.is_seen.any() else rest
        touching = contacts.touching
        its_rank = (
            len(touching) > 0,
            reading.status == Status.OK,
            len(touching),
            max((contact.depth_mm for contact in touching), default=0.0),
        )
        is_wanted = each.index == frame if frame is not None else its_rank > rank
        if is_wanted and each.image is not None:
            rank = its_rank
            kept = _Kept(reading=reading, view=before, lost_ids=lost, new_ids=new, frames=count)
        if (frame is not None and kept is not None) or (stop is not None and stop()):
            break
    if kept is None:
        wanted = "frame with an image" if frame is None else f"frame {frame} with an image"
        raise ManytouchError(f"{job.text} has no {wanted}: {count} frames were read")
    return _steps(job, kept, rest, estimating)


def _steps(job: Job, kept: _Kept, rest: Reading | None, estimation: PaperEstimationState) -> PaperSteps:
    detect, image = job.pipeline.detect, kept.reading.frame.image
    assert isinstance(detect, PaperDetection)
    assert image is not None
    plane_mm = onto_plane(job.sensor.camera, kept.reading.grid.position_px)[:, :2]
    depth_mm = -kept.reading.surface.displacement_mm[:, 2]
    has_quad = np.isfinite(corner_values(plane_mm, estimation.quads)).all(axis=(1, 2))
    if estimation.quads.is_corner is not None:
        has_quad = np.isfinite(depth_mm)
    ranked = np.where(has_quad & np.isfinite(depth_mm), depth_mm, -np.inf)
    marker = int(ranked.argmax()) if np.isfinite(ranked).any() else None
    truth_of = job.source.capabilities.truth
    truth = None if truth_of is None else truth_of(kept.reading.frame.index)
    true_mm = None
    if marker is not None and truth is not None:
        true_mm = -float(truth.surface.displacement_mm[marker, 2])
    return PaperSteps(
        job=job,
        rest=rest,
        reading=kept.reading,
        view=kept.view,
        stages=detect.stages(kept.view, image)[1],
        estimation=estimation,
        plane_mm=plane_mm,
        marker=marker,
        depth_by_formula_mm={} if marker is None else _by_formula(job, plane_mm, marker),
        true_depth_mm=true_mm,
        sample=None if marker is None else _sample(kept.reading, estimation, marker),
        lost_ids=kept.lost_ids,
        new_ids=kept.new_ids,
        frames=kept.frames,
    )


def _by_formula(job: Job, plane_mm: Points2, marker: int) -> dict[str, float]:
    nothing_px2 = np.zeros((len(plane_mm), 2, 2))
    return {
        name: float(
            perimeter_depth(PaperEstimation(formula=name).start(job.sensor), plane_mm, nothing_px2)[0][marker]
        )
        for name in get_args(Formula)
    }


def _sample(reading: Reading, estimation: PaperEstimationState, marker: int) -> SampleCalculation:
    """At the point of the plane next to 0.4 pitches right of and below a marker."""
    layout, between = estimation.layout, reading.surface.interpolation
    plane = plane_of(layout, between)
    wanted_mm = layout.rest_mm[marker, :2] + 0.4 * layout.pitch_mm
    column = int(np.abs(plane.x_mm - wanted_mm[0]).argmin())
    row = int(np.abs(plane.y_mm - wanted_mm[1]).argmin())
    point_mm = np.array([plane.x_mm[column], plane.y_mm[row]])
    depth_mm = -reading.surface.displacement_mm[:, 2]
    away_mm = np.hypot(*(layout.rest_mm[:, :2] - point_mm).T)
    radius_mm = between.search_radius_pitch * float(np.sqrt(np.prod(layout.pitch_mm)))
    near = np.flatnonzero((away_mm <= radius_mm) & np.isfinite(depth_mm))
    near = near[np.argsort(away_mm[near], kind="stable")]
    weight = np.maximum(away_mm[near], AT_MARKER * radius_mm) ** -between.power
    return SampleCalculation(
        point_mm=point_mm,
        marker=tuple(int(each) for each in near),
        distance_mm=tuple(away_mm[near].tolist()),
        depth_mm=tuple(depth_mm[near].tolist()),
        share=tuple((weight / weight.sum()).tolist()),
        result_mm=float(plane(depth_mm)[row, column]),
    )
