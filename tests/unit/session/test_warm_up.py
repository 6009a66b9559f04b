"""A contact is processed to warm up where a method has never been compiled, and nowhere else."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np
import pytest

from manytouch.detection import search
from manytouch.detection.rim import fit_rims
from manytouch.estimation.mechanics.clusters import model_order
from manytouch.estimation.mechanics.undescribed_frames import UndescribedFrames, WithoutSheet
from manytouch.pipeline import TrackedFrame
from manytouch.session import process, warm_up
from manytouch.session.methods import compile_stage, kernels, pipeline_for
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sources.simulated import simulated_source
from manytouch.values import Contacts, Sensor, Status, Surface, TrackedGrid


@pytest.fixture(autouse=True)
def nothing_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other tests have found what is compiled."""
    monkeypatch.setattr(warm_up, "COMPILED", set())


@pytest.mark.parametrize("method", ["perimeter", "pad"])
def test_the_contact_is_processed_from_its_beginning_to_its_end(
    monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    contacts: list[Contacts] = []
    tracked: list[TrackedFrame] = []

    class Observed:
        def __init__(self, method: str) -> None:
            self._pipeline = pipeline_for(method)
            self.estimate = self

        def start(self, sensor: Sensor) -> Any:
            return self._pipeline.estimate.start(sensor)

        def step(self, state: Any, grid: TrackedGrid) -> tuple[Any, Surface, Contacts]:
            found = self._pipeline.estimate.step(state, grid)
            contacts.append(found[2])
            return found

        def track_frames(self, *arguments: Any) -> Iterator[TrackedFrame]:
            for each in self._pipeline.track_frames(*arguments):
                tracked.append(each)
                yield each

    monkeypatch.setattr(compile_stage, "pipeline_for", Observed)
    compile_stage.compile_stage(method, "contacts")
    compile_stage.compile_stage(method, "pixels")
    touched = [bool(each.touching) for each in contacts]
    assert not touched[0]
    assert any(touched)
    assert not touched[-1]
    lost = [each.grid.status for each in tracked[len(compile_stage.FRAMES) :]]
    assert lost == [Status.OK, Status.FEW_MARKERS, Status.BLURRED]
    assert not tracked[len(compile_stage.FRAMES)].grid.is_seen.all(), "partly out of view"
    assert all(each.grid.status == "ok" for each in tracked[: len(compile_stage.FRAMES)])


def test_mechanics_also_compiles_for_bars_faces_and_assumed_sheets(monkeypatch: pytest.MonkeyPatch) -> None:
    called = set()

    def observed(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            found = function(*arguments, **named)
            if not isinstance(found, WithoutSheet) or found.touching:
                called.add(function.__name__)
            return found

        return call

    for name in ("fit_bar", "fit_elliptic_face"):
        monkeypatch.setattr(model_order, name, observed(getattr(model_order, name)))
    monkeypatch.setattr(UndescribedFrames, "step", observed(UndescribedFrames.step))
    compile_stage.compile_stage("mechanics", "contacts")
    assert called == {"fit_bar", "fit_elliptic_face", "step"}


def test_dots_before_a_scene_are_compiled_too(monkeypatch: pytest.MonkeyPatch) -> None:
    shares = []

    def observed(*arguments: Any) -> Any:
        found = fit_rims(*arguments)
        shares.append(found[1])
        return found

    monkeypatch.setattr(search, "fit_rims", observed)
    monkeypatch.setattr(compile_stage, "FRAMES", (0, 1))
    compile_stage.compile_stage("perimeter", "pixels")
    assert np.median(shares[0]) > 0.9


def test_true_positions_are_of_the_same_kinds_as_tracked_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other kinds, read-only or of another layout, would be compiled again."""
    grids = []

    class Observed:
        estimate = property(lambda self: self)

        def start(self, sensor: Sensor) -> None: ...

        def step(self, state: None, grid: TrackedGrid) -> tuple[None, None, None]:
            grids.append(grid)
            return None, None, None

    monkeypatch.setattr(compile_stage, "pipeline_for", lambda _: Observed())
    monkeypatch.setattr(compile_stage, "FRAMES", (0,))
    compile_stage.compile_stage("perimeter", "contacts")
    source = simulated_source(compile_stage.SCENE, width_px=compile_stage.WIDTH_PX)
    (tracked,) = pipeline_for("perimeter").track_frames([source.simulator.frame(0)], source.sensor)
    for field in fields(TrackedGrid):
        one, other = getattr(grids[0], field.name), getattr(tracked.grid, field.name)
        if isinstance(one, np.ndarray):
            assert numba.typeof(one) == numba.typeof(other), field.name


def test_progress_and_failures_of_the_compiling_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warm_up, "MESSAGE_EVERY_S", 0.0)
    monkeypatch.setattr(warm_up, "CODE", "print('a', flush=True); print('b')")
    sentences: list[str] = []
    assert warm_up.compile_in_processes("mechanics", sentences.append)
    assert sentences[-1] == f"compiling 4 of {warm_up.FUNCTIONS['mechanics']} for mechanics, once only"
    monkeypatch.setattr(warm_up, "CODE", "import sys; sys.exit(2 if sys.argv[-1] == 'pixels' else 0)")
    assert not warm_up.compile_in_processes("mechanics", sentences.append)


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
    monkeypatch.setattr(warm_up, "kernels", lambda: known)
    monkeypatch.setattr(warm_up, "compile_in_processes", lambda *_: True)
    monkeypatch.setattr(warm_up, "compiled_mark", lambda _: tmp_path / "marks" / "mark")
    (tmp_path / "marks").mkdir()
    assert warm_up.warm_up_kernels(method) is (method != "paper"), "it was never done to the end"
    assert (tmp_path / "marks" / "mark").exists() is (method != "paper")
    assert warm_up.warm_up_kernels(method) is is_needed


def test_a_process_looks_once_for_each_method_that_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[str] = []
    monkeypatch.setattr(warm_up, "is_compiled", lambda method, _: looked.append(method) is None)
    methods = ("mechanics", "perimeter", "mechanics", "perimeter", "paper")
    assert not any(warm_up.warm_up_kernels(method) for method in methods)
    assert looked == ["mechanics", "perimeter"]


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


LATER = """
import sys
from manytouch.session import warm_up
from manytouch.session.methods import compile_stage

method = sys.argv[1]
print(warm_up.warm_up_kernels(method))
compile_stage.FRAMES = (0, 60)
compile_stage.compile_stage(method, "contacts")
package = warm_up.OWN_KERNELS[method].rpartition(".")[0]
own = [module for name, module in sys.modules.items() if name.startswith(f"{package}.")]
kernels = [value for module in own for value in vars(module).values() if hasattr(value, "py_func")]
called = {each.py_func.__module__ for each in kernels if each.stats.cache_hits}
print(any(name.startswith(f"{package}.") for name in called))
"""


@pytest.mark.parametrize(
    "method",
    [
        pytest.param(name, marks=[] if name == "mechanics" else [pytest.mark.slow])
        for name in warm_up.OWN_KERNELS
    ],
)
def test_a_process_that_begins_later_need_not_do_it_again_and_calls_own_kernels(method: str) -> None:
    """What only compiled functions call is loaded with them, and has no machine code of its own."""
    warm_up.warm_up_kernels(method)
    words = [sys.executable, "-c", LATER, method]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout == "False\nTrue\n"


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


def test_pads_have_kernels_of_their_own() -> None:
    sensor = demo_sensor()
    assert warm_up.compiled_method("mechanics", sensor) == "mechanics"
    assert warm_up.compiled_method("mechanics", replace(sensor, sheet=None)) == "mechanics"
    assert warm_up.compiled_method("perimeter", replace(sensor, sheet=None)) == "perimeter"
    pad = simulated_source("pad", width_px=320).sensor
    assert warm_up.compiled_method("mechanics", pad) == "pad"
    assert warm_up.compiled_method("perimeter", pad) == "perimeter"


@pytest.mark.parametrize("is_given", [False, True])
def test_compiling_is_shown_on_standard_error_unless_an_observer_gets_it(
    is_given: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def compiled(_: str, on_message: Callable[[str], object]) -> bool:
        on_message("compiling 1 of 2")
        return False

    monkeypatch.setattr(warm_up, "is_compiled", lambda *_: False)
    monkeypatch.setattr(warm_up, "compile_in_processes", compiled)
    messages: list[str] = []
    assert warm_up.warm_up_kernels("perimeter", messages.append if is_given else None)
    assert messages == (["compiling 1 of 2"] if is_given else [])
    assert capsys.readouterr().err == ("" if is_given else "manytouch: compiling 1 of 2\n")


def test_processing_from_python_shows_that_it_compiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[object] = []
    module = sys.modules["manytouch.session.prepare"]
    monkeypatch.setattr(module, "warm_up_for", lambda _method, _sensor, on_message: given.append(on_message))
    process("sim:one", out=tmp_path, method="perimeter", stop=lambda: True)
    assert given
    assert all(each is None for each in given), "nobody gets the messages, so that they are printed"
