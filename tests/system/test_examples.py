"""Each example runs, and prints one number that must be right."""

import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> dict[str, object]:
    if not EXAMPLES.is_dir():
        pytest.skip("the examples come with the repository, not with the wheel")
    return runpy.run_path(str(EXAMPLES / f"{name}.py"))


def test_read_the_simulated_sensor(capsys: pytest.CaptureFixture[str]) -> None:
    error_mm = example("read_the_simulated_sensor")["main"]()
    assert error_mm < 1.0
    assert "truth" in capsys.readouterr().out
