"""States at rest are computed once for equal sensors: most tests are about later frames."""

import pickle
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import wraps
from hashlib import blake2b
from typing import Any
from unittest import mock

KEPT = 40  # states of each class


def _once(start: Callable[..., Any]) -> Callable[..., Any]:
    """As `start`, which depends on its arguments alone; a state is a value, so that tests can share it."""
    states: OrderedDict[bytes, Any] = OrderedDict()

    @wraps(start)
    def started(*arguments: Any, **named: Any) -> Any:
        key = blake2b(pickle.dumps((arguments, named))).digest()
        if key not in states:
            states[key] = start(*arguments, **named)
            if len(states) > KEPT:
                states.popitem(last=False)
        states.move_to_end(key)
        return states[key]

    return started


@contextmanager
def states_started_once() -> Iterator[None]:
    """While it lasts, estimators and the tracker start once for equal parameters and sensors."""
    from manytouch.estimation.load.load_contact_finder import LoadContactFinder
    from manytouch.estimation.mechanics.estimator import MechanicsEstimator
    from manytouch.estimation.mechanics.undescribed_frames import UndescribedFrames
    from manytouch.estimation.perimeter.estimator import PerimeterEstimator
    from manytouch.tracking import MarkerTracker

    with ExitStack() as patches:
        stages = (MechanicsEstimator, UndescribedFrames, PerimeterEstimator, LoadContactFinder, MarkerTracker)
        for stage in stages:
            patches.enter_context(mock.patch.object(stage, "start", _once(stage.start)))
        yield
