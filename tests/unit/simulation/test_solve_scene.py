"""States of a scene that are no equilibria of a pressed sheet are refused."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.simulation.scene.deformation import NO_CONTACT, Deformation, flat
from manytouch.simulation.solve_scene import checked

TIME_S = np.array([0.0, 0.1, 0.2])


def state(*normal_N: float, status: str = "ok") -> Deformation:
    """A flat sheet under bodies with these normal forces."""
    contacts = tuple(replace(NO_CONTACT, force_N=np.array([0.0, 0.0, -force])) for force in normal_N)
    return replace(flat((20.0, 20.0)), contacts=contacts, status=status)


def test_pressed_states_pass() -> None:
    states = [state(0.0, 0.0), state(0.5, 0.2), state(0.4, -0.05)]
    assert list(checked("pressed", TIME_S, states)) == states


@pytest.mark.parametrize("before_N", [0.3, 0.0])
def test_a_body_that_pulls_the_sheet_has_passed_through_it(before_N: float) -> None:
    states = checked("through", TIME_S, [state(0.0, 0.0), state(0.1, before_N), state(0.1, -0.3)])
    for _ in range(2):
        next(states)
    with pytest.raises(SourceError, match=r"'through', body 2 has passed through the sheet .* at 0\.20 s"):
        next(states)


def test_a_state_without_equilibrium_is_refused() -> None:
    states = checked("lost", TIME_S, [state(0.0), state(0.1, status="not_converged")])
    next(states)
    with pytest.raises(SourceError, match=r"'lost' could not be solved beyond 0\.10 s"):
        next(states)
