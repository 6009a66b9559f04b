"""A contact is processed to warm up where a method has never been compiled, and nowhere else."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from manytouch.session import warm_up
from manytouch.session.methods import kernels, pipeline_for
from manytouch.values import Reading, Status


def test_the_contact_is_processed_from_its_beginning_to_its_end(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    readings: list[Reading] = []

    class Observed:
        def __init__(self, method: str) -> None:
            self._pipeline = pipeline_for(method)

        def run(self, *arguments):
            for reading in self._pipeline.run(*arguments):
                readings.append(reading)
                yield reading

    monkeypatch.setattr(warm_up, "kernels", dict)
    monkeypatch.setattr(warm_up, "compiled_mark", lambda _: tmp_path / "mark")
    monkeypatch.setattr(warm_up, "pipeline_for", Observed)
    assert warm_up.warm_up_kernels("perimeter")
    lost = [reading.status for reading in readings[len(warm_up.FRAMES) :]]
    assert lost == [Status.OK, Status.FEW_MARKERS, Status.BLURRED]
    assert not readings[len(warm_up.FRAMES)].grid.is_seen.all(), "partly out of view"
    readings = readings[: len(warm_up.FRAMES)]
    touched = [bool(reading.contacts.touching) for reading in readings]
    assert not touched[0]
    assert any(touched)
    assert not touched[-1]
    assert all(reading.status == "ok" for reading in readings)


@pytest.mark.parametrize(
    ("method", "known", "is_needed"),
    [
        ("mechanics", {"manytouch.estimation.perimeter.law_kernels.sheet": True}, True),
        (
            "mechanics",
            {
                "manytouch.mechanics.solver.band_kernels.a": True,
                "manytouch.mechanics.solver.band_kernels.b": False,
            },
            False,
        ),
        ("perimeter", {"manytouch.estimation.perimeter.law_kernels.sheet": False}, True),
        ("perimeter", {"manytouch.estimation.perimeter.law_kernels.sheet": True}, False),
        ("paper", {}, False),
    ],
)
def test_only_what_was_never_compiled_is_warmed_up(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    method: str,
    known: dict[str, bool],
    is_needed: bool,
) -> None:
    simulated = replace(pipeline_for("perimeter"))
    monkeypatch.setattr(warm_up, "kernels", lambda: known)
    monkeypatch.setattr(warm_up, "pipeline_for", lambda _: simulated)
    monkeypatch.setattr(warm_up, "FRAMES", (0,))
    monkeypatch.setattr(warm_up, "compiled_mark", lambda _: tmp_path / "marks" / "mark")
    (tmp_path / "marks").mkdir()
    assert warm_up.warm_up_kernels(method) is (method != "paper"), "it was never done to the end"
    assert (tmp_path / "marks" / "mark").exists() is (method != "paper")
    assert warm_up.warm_up_kernels(method) is is_needed


def test_the_mark_depends_on_the_method_and_the_sources(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    source = tmp_path / "package" / "probe.py"
    source.parent.mkdir()
    source.write_text("1")
    monkeypatch.setattr(warm_up, "SOURCES", tmp_path)
    before = warm_up.compiled_mark("mechanics")
    assert before == warm_up.compiled_mark("mechanics")
    assert before != warm_up.compiled_mark("perimeter")
    source.write_text("2 + 2")
    assert before != warm_up.compiled_mark("mechanics")


def test_the_mark_does_not_depend_on_what_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    before = warm_up.compiled_mark("mechanics")
    module = ModuleType("manytouch.loaded_later")
    module.__file__ = __file__
    monkeypatch.setitem(sys.modules, "manytouch.loaded_later", module)
    loaded = {**kernels(), "manytouch.loaded_later.kernel": True}
    monkeypatch.setattr(warm_up, "kernels", lambda: loaded)
    assert warm_up.compiled_mark("mechanics") == before


def test_a_process_that_begins_later_need_not_do_it_again() -> None:
    warm_up.warm_up_kernels("perimeter")
    code = "from manytouch.session.warm_up import warm_up_kernels; print(warm_up_kernels('perimeter'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_kernels_are_listed_while_another_thread_imports(monkeypatch: pytest.MonkeyPatch) -> None:
    class Name(str):
        def startswith(self, *words: Any) -> bool:
            monkeypatch.setitem(sys.modules, "manytouch.imported_meanwhile", ModuleType("meanwhile"))
            return super().startswith(*words)

    class Kernel:
        @property
        def stats(self) -> None:
            busy.__dict__["new"] = 1

    busy = ModuleType("manytouch.busy")
    busy.__dict__["kernel"] = Kernel()
    monkeypatch.setitem(sys.modules, Name("manytouch.busy"), busy)
    kernels()
    assert busy.__dict__["new"] == 1
