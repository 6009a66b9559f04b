"""Frames of a timeline processed in order, from kept states, so that a jump changes no result."""

from dataclasses import dataclass
from typing import Any

from manytouch.pipeline import FrontState, Pipeline
from manytouch.session.commands.contact_id_offset import ContactIdOffset
from manytouch.session.commands.continuation import (
    Kept,
    Setup,
    kept,
    resumed_estimation,
    resumed_tracking,
)
from manytouch.values import Frame, Reading

KEPT_STATES = 48
"""Most states that are kept. A state of `mechanics` has several megabytes."""
FIRST_INTERVAL = 16
"""Frames between kept states; doubled whenever there are too many."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _States:
    """States of the stages before the frame at a place."""

    front: FrontState | None
    estimation: Any


class FrameProcessor:
    """Readings of frames, each computed from the states after all frames before it.

    A frame has the same reading however it is reached, as long as neither method nor parameter changes.
    """

    def __init__(self) -> None:
        self._setup: Setup | None = None
        self._kept: dict[int, _States] = {}
        self._interval = FIRST_INTERVAL
        self._place = 0
        self._states: _States | None = None
        self._shown = -1
        self._renumber = ContactIdOffset()

    @property
    def kept_places(self) -> tuple[int, ...]:
        """Places from which frames can be processed."""
        return tuple(self._kept)

    def begin(self, setup: Setup, place: int, *, continues: bool) -> int:
        """Go to a place, or before it.

        Args:
            setup: processes the frames from now on.
            place: that is wanted.
            continues: contacts go on from the last frame, if only parameters differ.

        Returns:
            The place of the next frame to `step`: from there to `place` none may be left out.
        """
        before, states = self._setup, self._states
        is_variant = before is not None and setup.is_variant_of(before)
        if before is None or states is None or not is_variant:
            self._start_again(setup)
        elif setup.pipeline is not before.pipeline:
            if continues and self._place == place + 1:
                self._restart(setup, place, _resumed(setup, before.pipeline, states))
            else:
                self._start_again(setup)
        if place < min(self._kept):
            self._start_again(setup)
        nearest = max(each for each in self._kept if each <= place)
        if not nearest <= self._place <= place:
            self._place, self._states = nearest, self._kept[nearest]
        return self._place

    def is_new(self, place: int) -> bool:
        """Whether the frame at a place has not been processed yet."""
        return place > self._shown

    def take_stored(self, reading: Reading) -> Reading:
        """A reading that is shown as it was recorded; its contacts' numbers are not used again."""
        return self._renumber(reading)

    def step(self, frame: Frame) -> Reading:
        """Process the next frame."""
        setup, states = self._setup, self._states
        assert setup is not None
        assert states is not None
        self._keep(states)
        front, estimation = Kept(), Kept()
        stream = setup.pipeline.track_frames((frame,), setup.sensor, states.front)
        tracked = kept(stream, front.keep)
        (reading,) = kept(
            setup.pipeline.estimate_readings(tracked, setup.sensor, states.estimation), estimation.keep
        )
        self._states = _States(front=front.value, estimation=estimation.value)
        self._shown = max(self._shown, self._place)
        self._place += 1
        return self._renumber(reading)

    def _start_again(self, setup: Setup) -> None:
        """Process from the first frame on, with numbers of contacts that are new."""
        self._renumber.begin()
        self._restart(setup, 0, _States(front=None, estimation=_started(setup)))

    def _restart(self, setup: Setup, place: int, states: _States) -> None:
        self._setup, self._place, self._states = setup, place, states
        self._kept, self._interval, self._shown = {place: states}, FIRST_INTERVAL, place - 1

    def _keep(self, states: _States) -> None:
        if self._place % self._interval == 0:
            self._kept[self._place] = states
        if len(self._kept) > KEPT_STATES:
            first = min(self._kept)
            self._interval *= 2
            self._kept = {
                place: each
                for place, each in self._kept.items()
                if place == first or place % self._interval == 0
            }


def _started(setup: Setup) -> Any:
    """State of the estimation before the first frame."""
    if setup.estimation is not None:
        return setup.estimation
    return setup.pipeline.estimate.start(setup.sensor)


def _resumed(setup: Setup, before: Pipeline, states: _States) -> _States:
    """States to continue with after a parameter has changed."""
    front = states.front
    if front is not None:
        front = resumed_tracking(setup.pipeline, setup.sensor, before, front)
    estimation = resumed_estimation(setup.pipeline, _started(setup), before, states.estimation)
    return _States(front=front, estimation=estimation)
