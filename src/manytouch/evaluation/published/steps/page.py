"""The page "the paper, step by step": the steps of the paper's method on one frame of any input.

Each step has its pictures, what it does, and its numbers on this frame.
"""

from pathlib import Path
from typing import Any

import numpy as np

from manytouch.evaluation.published.steps.collect import PaperSteps
from manytouch.evaluation.published.steps.pictures import draw_steps
from manytouch.evaluation.report.page import require_packages
from manytouch.paper.detection import PaperDetection
from manytouch.paper.estimation import PaperEstimation
from manytouch.paper.quads import corner_values, measure
from manytouch.paper.tracking import PaperTracking
from manytouch.sinks.files.atomic_output import atomic_file, check_writable
from manytouch.values import Status

TEMPLATE = "steps.html.jinja"


def write_steps(steps: PaperSteps, folder: Path) -> Path:
    """Write a picture of each step and index.html, which shows them.

    Raises:
        MissingExtraError: jinja2 or matplotlib is not installed.
        OutputError: the folder cannot be written.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    require_packages()
    check_writable(folder)
    pictures = draw_steps(steps, folder)
    environment = Environment(
        loader=PackageLoader("manytouch.evaluation", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = folder / "index.html"
    with atomic_file(page) as partial:
        partial.write_text(
            environment.get_template(TEMPLATE).render(pictures=pictures, **figures(steps)), encoding="utf-8"
        )
    return page


def figures(steps: PaperSteps) -> dict[str, Any]:
    """All numbers of the page."""
    pipeline, stages, reading = steps.job.pipeline, steps.stages, steps.reading
    detect, track, estimate = pipeline.detect, pipeline.track, pipeline.estimate
    assert isinstance(detect, PaperDetection)
    assert isinstance(track, PaperTracking)
    assert isinstance(estimate, PaperEstimation)
    height, width = stages.grey.shape
    return {
        "input": steps.job.text,
        "sensor": steps.job.sensor.name,
        "unit": steps.job.sensor.length_unit,
        "assumptions": steps.job.sensor.assumptions,
        "frame": reading.frame.index,
        "status": reading.status,
        "is_ok": reading.status == Status.OK,
        "size_px": (width, height),
        "is_remapped": steps.view.view.maps is not None,
        "detect": detect,
        "track": track,
        "estimate": estimate,
        # dark markers are searched in the inverted image; the page states the grey level of the camera image
        "level": 255 - stages.level if steps.view.view.is_dark else stages.level,
        "is_dark": steps.view.view.is_dark,
        "removed_px": int(((stages.binary > 0) & (stages.opened == 0)).sum()),
        "contours": len(stages.contours),
        "found": int(stages.is_marker.sum()),
        "expected": steps.view.markers,
        "minimum_area_px2": steps.view.view.minimum_area_px2,
        "median_area_px2": float(np.median(stages.area_px2[stages.is_marker]))
        if stages.is_marker.any()
        else None,
        "gate_px": track.start(steps.job.sensor).gate_px,
        "rest_frame": None if steps.rest is None else steps.rest.frame.index,
        "seen": int(reading.grid.is_seen.sum()),
        "lost_ids": steps.lost_ids,
        "new_ids": steps.new_ids,
        "frames": steps.frames,
        "marker": steps.marker,
        "perimeter": None if steps.marker is None else _perimeter(steps, steps.marker),
        "by_formula": steps.depth_by_formula_mm,
        "true_depth": steps.true_depth_mm,
        "sample": steps.sample,
        "contacts": [
            {"id": one.id, "x": float(one.centre_mm[0]), "y": float(one.centre_mm[1]), "depth": one.depth_mm}
            for one in reading.contacts.touching
        ],
        "between": reading.surface.interpolation,
    }


def _perimeter(steps: PaperSteps, marker: int) -> dict[str, float]:
    """Numbers of equation 11, m = d (1 - AP / BP), for the quad of a marker, its first if it has several.

    AP is the perimeter of the quad at rest (`before`), BP its present one (`after`), or what else `formula`
    measures; d is the distance of the camera (`distance`). `depth` is that of the marker.
    """
    quads = steps.estimation.quads
    quad = marker if quads.is_corner is None else int(quads.is_corner[[marker]].indices[0])
    corner_mm = corner_values(steps.plane_mm, quads)[[quad]]
    return {
        "before": float(steps.estimation.initial_mm[quad]),
        "after": float(measure(corner_mm, steps.estimation.formula)[0][0]),
        "distance": steps.estimation.distance_mm,
        "depth": -float(steps.reading.surface.displacement_mm[marker, 2]),
    }
