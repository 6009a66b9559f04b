"""The public names: what importing them costs, their declared types, and how values are printed."""

import ast
import subprocess
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

import manytouch
from manytouch.simulation.demo_sensor import demo_sensor

STUB = Path(manytouch.__file__).with_suffix(".pyi")


def loaded_by(statement: str) -> set[str]:
    """Top-level packages in memory after a statement, in a fresh interpreter."""
    code = f"{statement}\nimport sys\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_the_package_loads_nothing_heavy() -> None:
    heavy = {"typing", "numpy", "cv2", "numba", "scipy", "pydantic", "pyarrow", "rich"}
    assert not heavy & loaded_by("import manytouch")


def test_importing_the_command_line_does_not_load_the_estimators() -> None:
    assert not {"cv2", "numba", "scipy", "pyarrow"} & loaded_by("import manytouch.cli")


def test_every_public_name_is_available_and_declared_in_the_stub() -> None:
    for name in manytouch.__all__:
        assert getattr(manytouch, name) is not None
    declared = {
        (node.module, alias.name)
        for node in ast.parse(STUB.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    loaded = {(module, name) for module, names in manytouch._NAMES.items() for name in names}
    assert declared == loaded


def test_every_error_class_is_public() -> None:
    from manytouch import errors

    for name, value in vars(errors).items():
        if isinstance(value, type):
            assert name in manytouch.__all__


def test_an_unknown_name_raises_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = manytouch.nonsense


def test_values_print_in_one_line() -> None:
    from manytouch.sources.simulated import simulated_source

    source = simulated_source(width_px=640).lasting(0.1)
    job = manytouch.prepare(source, method="mechanics")
    reading = next(job.readings())
    truth = source.truth(0)
    assert repr(reading) == "Reading(frame 0, 600 of 600 markers seen, 0 contacts, ok)"
    assert repr(job).endswith("method mechanics, lengths in mm)")
    assert repr(job.pipeline) == "Pipeline(DotSearch, MarkerTracker, MechanicsEstimator)"
    for value in (job, job.pipeline):
        assert len(repr(value)) <= 160
    values = [reading, truth, demo_sensor(640)]
    for value in values:  # and, appended on the way, the values in them
        if is_dataclass(value):
            text = repr(value)
            assert len(text) <= 360, text
            assert "\n" not in text
            assert "array(" not in text
            values += [getattr(value, field.name) for field in fields(value)]
    assert {type(value).__name__ for value in values} >= {"SheetSpline", "Layout", "Frame", "Detections"}


def test_an_unknown_scale_is_stated() -> None:
    from dataclasses import replace

    sensor = replace(demo_sensor(640), scale_is_known=False)
    assert sensor.length_unit == "pitch"
    assert repr(sensor).endswith("scale unknown)")
