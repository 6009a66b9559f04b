"""Methods have the same names everywhere."""

from typing import get_args

from manytouch.cli.terminal.options import Method
from manytouch.rigs.rig_file import SensorSection
from manytouch.session.methods import METHODS


def test_the_command_line_and_rigs_know_every_method() -> None:
    assert get_args(Method) == METHODS
    of_rigs = SensorSection.model_fields["method"].annotation
    assert {name for part in get_args(of_rigs) for name in get_args(part)} == set(METHODS)
