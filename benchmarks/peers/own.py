"""manytouch itself, stage by stage and complete, and the paper's chain as manytouch has it."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from rounds import Answer, Footage, Method

sys.path.append(str(Path(__file__).parents[1]))

from plain_paper import PlainChain

from manytouch.evaluation.published.speed import plain_map
from manytouch.geometry.camera import onto_plane
from manytouch.geometry.sampling import GridSampling, sampling_on
from manytouch.paper.detection import PaperDetection
from manytouch.paper.estimation import PaperEstimation, perimeter_depth
from manytouch.paper.tracking import PaperTracking
from manytouch.session import pipeline_for
from manytouch.values import Detections, Frame, Sensor, TrackedGrid

MAP_POINTS = (200, 120)
PAPER_MAP = (100, 60)
IDENTITIES, SURFACE, CONTACTS = "identities", "surface", "contacts"
Run = Callable[[int], Answer]


def map_of(sensor: Sensor) -> GridSampling:
    """Samples of the whole sheet on 200 x 120 points."""
    low, high = sensor.layout.rest_mm[:, :2].min(axis=0), sensor.layout.rest_mm[:, :2].max(axis=0)
    x_mm, y_mm = (np.linspace(low[axis], high[axis], MAP_POINTS[axis]) for axis in (0, 1))
    return sampling_on(sensor.layout, x_mm, y_mm)


class Tracked:
    """The method `perimeter` frame after frame, as `Pipeline.run` does it, up to some `end`.

    IDENTITIES: dots and which marker each is. SURFACE: also undistorted places, the sheet's surface at the
    markers, and its depth on the map. CONTACTS: also contacts.
    """

    def __init__(self, sensor: Sensor, end: str = SURFACE) -> None:
        self.stages = pipeline_for("perimeter")
        self.detecting = self.stages.detect.start(sensor)
        self.tracking = self.stages.track.start(sensor)
        self.end = end
        if end != IDENTITIES:
            self.estimating = self.stages.estimate.start(sensor)
            self.map = map_of(sensor)
        self.depth_mm = None

    def __call__(self, frame: Frame) -> TrackedGrid:
        detect, track, estimate = self.stages.detect, self.stages.track, self.stages.estimate
        before = self.tracking
        expected_px = track.expected_px(before)
        self.detecting, detections = detect.step(self.detecting, frame, expected_px)
        self.tracking, grid = track.step(before, detections)
        if expected_px is not None and track.needs_full_search(self.tracking):
            self.detecting, detections = detect.step(self.detecting, frame, None)
            self.tracking, grid = track.step(before, detections)
        if self.end == SURFACE:
            surface = estimate.surface(self.estimating.geometry, grid).surface
        elif self.end == CONTACTS:
            self.estimating, surface, _ = estimate.step(self.estimating, grid)
        if self.end != IDENTITIES:
            self.depth_mm = self.map(-surface.displacement_mm[:, 2])
        return grid


def tracked(end: str) -> Callable[[Footage], Run]:
    """Frames of a sheet that is tracked."""

    def prepare(footage: Footage) -> Run:
        follow = Tracked(footage.course.sensor, end)

        def run(index: int) -> Answer:
            return answer_of(follow(footage.frames[index]))

        return run

    return prepare


def from_nothing(end: str) -> Callable[[Footage], Run]:
    """Frames without a frame before: the whole image is searched, identities are found from the layout."""

    def prepare(footage: Footage) -> Run:
        follow = Tracked(footage.course.sensor, end)
        first = follow.tracking

        def run(index: int) -> Answer:
            follow.tracking = first
            if follow.stages.track.expected_px(first) is not None:
                raise RuntimeError(
                    "the first state of the tracker requires windows, so the image is not searched as a whole"
                )
            return answer_of(follow(footage.frames[index]))

        return run

    return prepare


def decoding(footage: Footage) -> Run:
    """A JPEG picture to grey pixels."""

    def run(index: int) -> Answer:
        cv2.imdecode(np.frombuffer(footage.jpeg[index], dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
        return Answer()

    return run


def from_jpeg(footage: Footage) -> Run:
    """A JPEG picture to identities."""
    follow = Tracked(footage.course.sensor, IDENTITIES)

    def run(index: int) -> Answer:
        image = cv2.imdecode(np.frombuffer(footage.jpeg[index], dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
        return answer_of(follow(replace(footage.frames[index], image=image)))

    return run


def paper(footage: Footage) -> Run:
    """The paper's chain to the depth of every marker: undistort, crop, grey, Otsu, open, contours, gate."""
    chain = _Paper(footage)

    def run(index: int) -> Answer:
        return chain(index)[0]

    return run


def paper_with_map(footage: Footage) -> Run:
    """The same, and inverse distance weighting in plain Python."""
    chain = _Paper(footage)

    def run(index: int) -> Answer:
        answer, depth_mm = chain(index)
        known = np.isfinite(depth_mm)
        x_mm, y_mm = (chain.rest_mm[known, axis].tolist() for axis in (0, 1))
        plain_map(x_mm, y_mm, depth_mm[known].tolist(), iterations=chain.side, radius_mm=chain.radius_mm)
        return answer

    return run


def plain_chain(footage: Footage) -> Run:
    """The paper's chain as its text describes it, with plain loops over the markers."""
    chain = PlainChain(footage)

    def run(index: int) -> Answer:
        return chain(index)[0]

    return run


def plain_chain_with_map(footage: Footage) -> Run:
    """The same, and inverse distance weighting in plain Python."""
    chain, quick = PlainChain(footage), _Paper(footage)
    x_mm, y_mm = (quick.rest_mm[:, axis].tolist() for axis in (0, 1))

    def run(index: int) -> Answer:
        answer, depth_mm = chain(index)
        plain_map(x_mm, y_mm, depth_mm, iterations=quick.side, radius_mm=quick.radius_mm)
        return answer

    return run


class _Paper:
    """State of the paper's chain."""

    def __init__(self, footage: Footage) -> None:
        sensor = footage.course.sensor
        self.footage = footage
        self.detect, self.track = PaperDetection(), PaperTracking()
        self.detecting, self.tracking = self.detect.start(sensor), self.track.start(sensor)
        self.memory = PaperEstimation().start(sensor)
        self.rest_mm = sensor.layout.rest_mm[:, :2]
        self.radius_mm = 1.5 * float(sensor.layout.pitch_mm.mean())
        # as many points as 100 x 60, but the loop's plane is square
        self.side = round(float(np.sqrt(np.prod(PAPER_MAP))))

    def __call__(self, index: int) -> tuple[Answer, np.ndarray]:
        frame = self.footage.frames[index]
        self.detecting, detections = self.detect.step(self.detecting, frame, None)
        self.tracking, grid = self.track.step(self.tracking, detections)
        plane_mm = onto_plane(self.memory.camera, grid.position_px)[:, :2]
        depth_mm, _ = perimeter_depth(self.memory, plane_mm, grid.covariance_px2)
        return answer_of(grid), depth_mm


def answer_of(grid: TrackedGrid) -> Answer:
    """The markers that are seen."""
    marker = np.flatnonzero(grid.is_seen)
    return Answer(centre_px=grid.position_px[marker], marker=marker)


def stage_methods(footage_sensor: Sensor) -> list[Method]:
    """The stages alone, each on what the stage before gave it."""

    def windows(footage: Footage) -> Run:
        detect = pipeline_for("perimeter").detect
        memory = [detect.start(footage_sensor)]
        # where a tracker would expect the dots: the frame before, up to a quarter of a pitch away
        before = [0]

        def run(index: int) -> Answer:
            expected_px = footage.course.centre_px[before[0]]
            memory[0], found = detect.step(memory[0], footage.frames[index], expected_px)
            before[0] = index
            return Answer(centre_px=found.centre_px)

        return run

    def everywhere(footage: Footage) -> Run:
        detect = pipeline_for("perimeter").detect
        memory = [detect.start(footage_sensor)]

        def run(index: int) -> Answer:
            memory[0], found = detect.step(memory[0], footage.frames[index], None)
            return Answer(centre_px=found.centre_px)

        return run

    def identities(footage: Footage) -> Run:
        track = pipeline_for("perimeter").track
        memory = [track.start(footage_sensor)]
        given = [_exact(footage, index) for index in range(len(footage.frames))]

        def run(index: int) -> Answer:
            memory[0], grid = track.step(memory[0], given[index])
            return answer_of(grid)

        return run

    def estimating(footage: Footage) -> Run:
        estimate = pipeline_for("perimeter").estimate
        memory = [estimate.start(footage_sensor)]
        given = [_seen(footage, index) for index in range(len(footage.frames))]

        def run(index: int) -> Answer:
            memory[0], _, _ = estimate.step(memory[0], given[index])
            return Answer()

        return run

    def shaping(footage: Footage) -> Run:
        estimate = pipeline_for("perimeter").estimate
        geometry = estimate.surface.start(footage_sensor)
        given = [_seen(footage, index) for index in range(len(footage.frames))]

        def run(index: int) -> Answer:
            estimate.surface(geometry, given[index])
            return Answer()

        return run

    def mapping(footage: Footage) -> Run:
        sample = map_of(footage_sensor)
        moved = footage.course.centre_px - footage.course.centre_px[0]

        def run(index: int) -> Answer:
            sample(moved[index, :, 0])
            return Answer()

        return run

    return [
        Method(name="stage: dots in windows", does="detection around expected places", prepare=windows),
        Method(name="stage: dots everywhere", does="detection in the whole image", prepare=everywhere),
        Method(name="stage: identities", does="tracking of given dots", prepare=identities),
        Method(name="stage: surface", does="undistorted places, view, depth, errors", prepare=shaping),
        Method(name="stage: surface and contacts", does="the same and contacts", prepare=estimating),
        Method(name="stage: map", does="200 x 120 points", prepare=mapping),
    ]


def _exact(footage: Footage, index: int) -> Detections:
    """True centres as detections, shuffled."""
    order = np.random.default_rng(index).permutation(np.flatnonzero(footage.course.is_visible[index]))
    return Detections(
        centre_px=footage.course.centre_px[index][order],
        covariance_px2=np.tile(0.015**2 * np.eye(2), (len(order), 1, 1)),
        area_px2=np.full(len(order), np.pi * footage.course.radius_px**2),
        contrast=np.full(len(order), 160.0),
    )


def _seen(footage: Footage, index: int) -> TrackedGrid:
    """True centres as a tracked grid."""
    visible = footage.course.is_visible[index]
    return TrackedGrid(
        position_px=np.where(visible[:, None], footage.course.centre_px[index], np.nan),
        covariance_px2=np.where(visible[:, None, None], 0.015**2 * np.eye(2), np.nan),
        is_seen=visible,
        frames_unseen=np.where(visible, 0, 1).astype(np.int64),
    )


def own_methods(sensor: Sensor) -> list[Method]:
    """manytouch and the paper's chain."""
    return [
        Method(name="manytouch: tracked frame", does="pixels to surface and map", prepare=tracked(SURFACE)),
        Method(
            name="manytouch: tracked, identities", does="pixels to identities", prepare=tracked(IDENTITIES)
        ),
        Method(
            name="manytouch: tracked, contacts",
            does="pixels to surface, map and contacts",
            prepare=tracked(CONTACTS),
        ),
        Method(
            name="manytouch: frame from nothing",
            does="pixels to surface and map",
            prepare=from_nothing(SURFACE),
        ),
        Method(name="JPEG to grey", does="decoding alone", prepare=decoding),
        Method(name="manytouch: JPEG to identities", does="decoding and tracking", prepare=from_jpeg),
        Method(name="paper's chain, quick", does="as in --method paper, to depth", prepare=paper),
        Method(
            name="paper's chain, quick, plain map",
            does="the same and 6000 points by a loop",
            prepare=paper_with_map,
        ),
        Method(name="paper's chain", does="as in its text, by plain loops", prepare=plain_chain),
        Method(
            name="paper's chain and map",
            does="the same and 6000 points by a loop",
            prepare=plain_chain_with_map,
        ),
        *stage_methods(sensor),
    ]
