"""The methods and their pipelines."""

import sys
from collections.abc import Mapping
from pathlib import Path
from types import NoneType

from manytouch.detection import DotSearch
from manytouch.errors import ManytouchError, require_type
from manytouch.estimation import MechanicsEstimator, PadEstimator, PerimeterEstimator
from manytouch.estimation.mechanics.inversion.sheet_model import MIN_MARKERS
from manytouch.paper.detection import PaperDetection
from manytouch.paper.estimation import PaperEstimation
from manytouch.paper.tracking import PaperTracking
from manytouch.pipeline import Pipeline
from manytouch.session.methods.parameters import ParameterValue, with_parameters
from manytouch.tracking import MarkerTracker
from manytouch.values import Roi, Sensor
from manytouch.values.images.roi import require_roi
from manytouch.values.surface import SPLINE

METHODS = ("mechanics", "perimeter", "paper")
DEFAULT = "mechanics"
"""The method of a sensor of which nothing is known yet."""
PAD = "pad"
"""Instead of `mechanics` where kernels are compiled: on a bonded pad it has kernels of its own."""


def kernels() -> dict[str, bool]:
    """The compiled functions in use by name, and whether machine code of each is cached on disk."""
    found = {}
    files: dict[str, list[str]] = {}  # by folder: names of the files that list machine code
    # copies: another thread may be importing
    for module in [module for name, module in sys.modules.copy().items() if name.startswith("manytouch.")]:
        for value in vars(module).copy().values():
            path = getattr(getattr(value, "stats", None), "cache_path", None)
            if path is not None:
                if path not in files:
                    files[path] = [file.name for file in Path(path).glob("*.nbi")]
                function = value.py_func
                beginning = f"{Path(function.__code__.co_filename).stem}.{function.__qualname__}-"
                is_cached = any(name.startswith(beginning) for name in files[path])
                found[f"{function.__module__}.{function.__qualname__}"] = is_cached
    return found


def default_method(sensor: Sensor) -> str:
    """The best method for a sensor: mechanics where it has a sheet, which may be assumed.

    A known sheet with too few markers for it is an error of the file; an assumed one is not.
    """
    sheet, layout = sensor.sheet, sensor.layout
    if sheet is None or (sheet.is_assumed and layout is not None and len(layout.rest_mm) < MIN_MARKERS):
        return "perimeter"
    return "mechanics"


def require_method_for(sensor: Sensor, method: str) -> None:
    """Check that a method can process a sensor.

    Raises:
        ManytouchError: the sensor has several views, and the method works with one camera.
    """
    if sensor.camera.views and method != "mechanics":
        raise ManytouchError(
            f"the sensor {sensor.name!r} has {len(sensor.camera.views)} views, but {method} works with one "
            "camera: use --method mechanics"
        )


def pipeline_for(
    method: str | None = None,
    roi_px: Roi | None = None,
    parameters: Mapping[str, ParameterValue] | None = None,
) -> Pipeline:
    """The stages of a method.

    Args:
        method: one of `METHODS`; None: "perimeter", which works with every sensor.
        roi_px: the part of the image to process; None for all of it.
        parameters: values other than the defaults, by stage and field (`session.methods.parameters`).

    Raises:
        ManytouchError: there is no such method or parameter, or a value is invalid.
    """
    require_roi(roi_px)
    require_type("parameters", parameters, (Mapping, NoneType), "a dictionary of names and values")
    return with_parameters(_default_pipeline(method or "perimeter", roi_px), parameters or {})


def _default_pipeline(method: str, roi_px: Roi | None) -> Pipeline:
    match method:
        case "mechanics":
            return Pipeline(
                detect=DotSearch(roi_px=roi_px),
                track=MarkerTracker(roi_px=roi_px),
                estimate=MechanicsEstimator(pad=PadEstimator()),
                interpolation=SPLINE,
            )
        case "perimeter":
            return Pipeline(
                detect=DotSearch(roi_px=roi_px),
                track=MarkerTracker(roi_px=roi_px),
                estimate=PerimeterEstimator(),
                interpolation=SPLINE,
            )
        case "paper":
            return Pipeline(
                detect=PaperDetection(roi_px=roi_px),
                track=PaperTracking(),
                estimate=PaperEstimation(),
            )
    raise ManytouchError(f"there is no method {method!r}; there are: {', '.join(METHODS)}")
