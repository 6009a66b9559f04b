"""What many tests begin with is computed once for equal arguments: states at rest, surveys, shipped files."""

import pickle
import sys
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import wraps
from hashlib import blake2b
from typing import Any
from unittest import mock

KEPT = 40  # results of each function


class _All:
    """All functions whose results are kept."""

    are_computed_again = False


def _once(
    function: Callable[..., Any], key_of: Callable[..., Any] = lambda *each: each
) -> Callable[..., Any]:
    """As a function that depends on its arguments alone, and whose results, being values, can be shared."""
    results: OrderedDict[bytes, Any] = OrderedDict()

    @wraps(function)
    def found(*arguments: Any, **named: Any) -> Any:
        if _All.are_computed_again:
            return function(*arguments, **named)
        try:
            key = blake2b(pickle.dumps((key_of(*arguments), named))).digest()
        except (AttributeError, OSError):  # a part of them was made up by a test; there is no such file
            return function(*arguments, **named)
        if key not in results:
            results[key] = function(*arguments, **named)
            if len(results) > KEPT:
                results.popitem(last=False)
        results.move_to_end(key)
        return results[key]

    return found


@contextmanager
def computed_once() -> Iterator[None]:
    """While it lasts, estimators and the tracker start once for equal parameters and sensors, and so on."""
    from manytouch import detection
    from manytouch.estimation.load.load_contact_finder import LoadContactFinder
    from manytouch.estimation.mechanics.estimator import MechanicsEstimator
    from manytouch.estimation.mechanics.undescribed_frames import UndescribedFrames
    from manytouch.estimation.pad import pad_model
    from manytouch.estimation.perimeter.estimator import PerimeterEstimator
    from manytouch.simulation.scene.deformation_file import read_deformations
    from manytouch.tracking import MarkerTracker

    read = _once(read_deformations, lambda path: (str(path), path.read_bytes()))
    with ExitStack() as patches:
        stages = (MechanicsEstimator, UndescribedFrames, PerimeterEstimator, LoadContactFinder, MarkerTracker)
        for stage in stages:
            patches.enter_context(mock.patch.object(stage, "start", _once(stage.start)))
        patches.enter_context(mock.patch.object(detection, "survey", _once(detection.survey)))
        for name in ("manytouch.simulation.solve_scene", "manytouch.evaluation.suite.solutions"):
            if name in sys.modules:
                patches.enter_context(mock.patch.object(sys.modules[name], "read_deformations", read))
        patches.enter_context(mock.patch.object(pad_model, "pad_response", _once(pad_model.pad_response)))
        yield


@contextmanager
def computed_again() -> Iterator[None]:
    """While it lasts, nothing that was computed before is used: for tests that states are values."""
    _All.are_computed_again = True
    try:
        yield
    finally:
        _All.are_computed_again = False
