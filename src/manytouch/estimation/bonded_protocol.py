"""The protocol by which the estimator of clamped sheets calls one for bonded pads.

The estimator of pads itself is `estimation.pad.estimator.PadEstimator`; `estimation.mechanics` may not import
it, since `estimation.pad` uses `estimation.mechanics`.
"""

from typing import Any, Protocol, runtime_checkable

from manytouch.values import Contacts, Sensor, Surface, TrackedGrid


@runtime_checkable
class BondedEstimator(Protocol):
    """Surface and contacts of a pad that is bonded to a window."""

    def start(self, sensor: Sensor) -> Any:
        """State before the first frame."""

    def step(self, state: Any, grid: TrackedGrid) -> tuple[Any, Surface, Contacts]:
        """Surface and contacts of the next frame."""
