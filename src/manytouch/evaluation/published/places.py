"""Table 3: presses at 60 and 115 mm along a sheet, 10.06 mm deep, as a person reads them off each method.

What the paper leaves open: whether 60 and 115 mm are places or distances and from where they count (here:
along x from the left edge of a sheet of 160 x 100 mm, half-way up), what pressed (here a ball of 5 mm
radius), and where 10.06 mm was pressed (here at both places, one after the other).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from manytouch.calibration.rest.assumed_sensor import register_rest
from manytouch.evaluation.suite.cases import REST_FRAMES, Case, Touch
from manytouch.evaluation.suite.given import given_sensor
from manytouch.evaluation.suite.recordings import CaseSimulation, SimulatedRecording
from manytouch.pipeline import Pipeline

SIZE_MM = (160.0, 100.0)
PLACES_MM = (60.0, 115.0)
PUBLISHED = {"measured": (60.0, 115.0, 10.06), "published": (59.69, 114.5, 10.289)}
BALL_MM = {60.0: 10.674, 115.0: 10.68}
"""Depth of the ball's lowest point that presses the camera-side face 10.06 mm deep."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedPress:
    """One press as estimated, or in truth; NaN where no contact is given.

    Attributes:
        along_mm: place of the contact from the left edge.
        depth_mm: of the contact.
        along_std_mm, depth_std_mm: standard deviations that the method states; NaN for the ground truth.
    """

    along_mm: float
    depth_mm: float
    along_std_mm: float = float("nan")
    depth_std_mm: float = float("nan")


def presses() -> tuple[Case, Case]:
    """The two presses as cases of the suite's kind, in neither of its halves."""
    first, second = (
        Case(
            group="published",
            name=f"table-3-{place_mm:g}mm",
            seed=4000 + number,
            looked_at=False,
            touches=(
                Touch(at_mm=(place_mm - 0.5 * SIZE_MM[0], 0.0), radius_mm=5.0, strength=BALL_MM[place_mm]),
            ),
            deepest_mm=BALL_MM[place_mm],
            size_mm=SIZE_MM,
        )
        for number, place_mm in enumerate(PLACES_MM)
    )
    return first, second


def table(
    methods: Mapping[str, Pipeline], simulation: CaseSimulation
) -> dict[str, tuple[PublishedPress, PublishedPress]]:
    """The last frame of both presses, in truth and as each method estimates it."""
    recordings = [(case, simulation.simulate(case)) for case in presses()]
    rows = {"truth": tuple(_true(recording) for _, recording in recordings)}
    for method, pipeline in methods.items():
        rows[method] = tuple(_read(case, recording, pipeline) for case, recording in recordings)
    return {name: (row[0], row[1]) for name, row in rows.items()}


def _true(recording: SimulatedRecording) -> PublishedPress:
    (contact,) = recording.truths[-1].contacts.touching
    return PublishedPress(along_mm=float(contact.centre_mm[0]) + 0.5 * SIZE_MM[0], depth_mm=contact.depth_mm)


def _read(case: Case, recording: SimulatedRecording, pipeline: Pipeline) -> PublishedPress:
    """The deepest contact of the last frame."""
    sensor = register_rest(given_sensor(case), recording.frames[:REST_FRAMES])
    *_, last = pipeline.run(recording.frames, sensor)
    found = [contact for contact in last.contacts.touching if np.isfinite(contact.depth_mm)]
    if not found:
        return PublishedPress(along_mm=float("nan"), depth_mm=float("nan"))
    deepest = max(found, key=lambda contact: contact.depth_mm)
    return PublishedPress(
        along_mm=float(deepest.centre_mm[0]) + 0.5 * SIZE_MM[0],
        depth_mm=deepest.depth_mm,
        along_std_mm=deepest.std("x"),
        depth_std_mm=deepest.std("depth"),
    )
