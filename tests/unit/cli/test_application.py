"""Options, exit statuses, help, and errors of the command line."""

import inspect
import io
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from cyclopts import App

from manytouch.calibration import sensor_from_rest
from manytouch.cli import COMMANDS, OPTIONS, main
from manytouch.cli.application import application
from manytouch.cli.terminal import method_options, options
from manytouch.cli.terminal.failures import StandardOutput
from manytouch.cli.terminal.interrupt import StopOnSignal
from manytouch.errors import ManytouchError, SensorError
from manytouch.session.results import result_names
from manytouch.sinks.viewer import Viewer
from manytouch.values import Interpolation

VERBS = ("demo", "run", "process", "view", "design", "simulate", "evaluate", "explain", "doctor")


@pytest.mark.parametrize(
    ("inputs", "names"),
    [
        (["a.mp4"], ["a"]),
        (["a.mp4", "b.avi", "x/a.avi"], ["a", "b", "a-2"]),
        (["a.mp4", "A.mp4", "a.png"], ["a", "A-2", "a-3"]),
        (["a-2.mp4", "a.mp4", "x/a.mp4"], ["a-2", "a", "a-3"]),
        (["sim:", "sim:one"], ["sim", "sim-one"]),
    ],
)
def test_every_input_has_a_folder_of_its_own(inputs, names):
    assert result_names(inputs) == names


def test_letters_that_a_terminal_lacks_are_replaced(monkeypatch: pytest.MonkeyPatch):
    with io.TextIOWrapper(io.BytesIO(), encoding="ascii", write_through=True) as terminal:
        monkeypatch.setattr(sys, "stdout", terminal)
        assert main(["--version"]) == 0
        terminal.write("6.1 ± 0.2 N\n")
        assert terminal.buffer.getvalue().decode().endswith("6.1 ? 0.2 N\n")


def test_nothing_that_stays_is_searched_for_garbage_while_a_command_starts(tmp_path: Path):
    program = (
        "import gc, sys; searches = []; "
        "gc.callbacks.append(lambda phase, found: searches.append(found['generation'])); "
        "from manytouch.cli import main; main(sys.argv[1:]); print(searches.count(2))"
    )
    words = ["process", str(tmp_path / "missing.mp4"), "--out", str(tmp_path / "results")]
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=True)
    assert "There is no" in done.stderr
    assert done.stdout.split()[-1] == "0"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", [[], ["--version"], ["process", "--help"], ["doctor"]])
def test_standard_output_on_a_full_disk_is_one_sentence(words, unbuffered):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "manytouch", *words],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        )
    assert done.returncode == 1
    assert done.stderr == (
        "manytouch: cannot print to standard output (No space left on device): free some space there, or "
        "send it elsewhere\n"
    )


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("has_reader", [True, False])
def test_files_are_complete_though_standard_output_cannot_be_written(
    tmp_path: Path, unbuffered: str, *, has_reader: bool
):
    words = ["design", "--out", str(tmp_path / "sensor"), "--parts", "none"]
    if has_reader:
        output = os.open("/dev/full", os.O_WRONLY)
    else:
        read, output = os.pipe()
        os.close(read)
    done = subprocess.run(
        [sys.executable, "-m", "manytouch", *words],
        stdout=output,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
    )
    os.close(output)
    assert (tmp_path / "sensor" / "design.md").exists()
    assert done.returncode == int(has_reader)
    assert ("cannot print to standard output" in done.stderr) == has_reader
    assert "internal error" not in done.stderr


def test_a_live_session_ends_when_nobody_reads_its_output(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(StandardOutput, "error", BrokenPipeError())
    assert StopOnSignal(is_live=True)()
    assert not StopOnSignal()()
    monkeypatch.setattr(StandardOutput, "error", OSError(28, "No space left on device"))
    assert not StopOnSignal(is_live=True)()


@pytest.mark.parametrize("given", ["0.5", "179.5"])
def test_the_command_line_and_python_allow_the_same_fields_of_view(
    given: str, capsys: pytest.CaptureFixture[str]
):
    assert main(["process", __file__, "--out", "o", "--hfov-deg", given]) == 2
    assert "from 1 to 179" in capsys.readouterr().err
    with pytest.raises(SensorError, match="between 1 and 179"):
        sensor_from_rest([], name="any", hfov_deg=float(given))


def test_a_pitch_with_a_sensor_file_is_refused_with_what_suits_any_sensor_file(
    capsys: pytest.CaptureFixture[str],
):
    assert main(["process", __file__, "--out", "o", "--sensor", "camera.toml", "--pitch-mm", "4"]) == 2
    refused = capsys.readouterr().err
    assert "--pitch-mm and --hfov-deg are for inputs without a sensor file" in refused
    assert "calibrate rest adds [markers] to a file that has a [camera] only" in refused


@pytest.mark.parametrize(
    "source", ["sim:one", __file__, "rtsp://user:secret@host/x", f"views:{__file__},sim:"]
)
@pytest.mark.parametrize(
    "option",
    [
        ["--size", "640x480"],
        ["--exposure-ms", "auto"],
        ["--gain", "2"],
        ["--focus", "0"],
        ["--white-balance-K", "4500"],
        ["--no-mjpg"],
    ],
)
def test_options_of_a_camera_are_refused_for_other_sources(
    source: str, option: list[str], capsys: pytest.CaptureFixture[str]
):
    assert main(["run", source, *option]) == 2
    refused = capsys.readouterr().err
    assert f"{option[0]} can be requested of a camera of this computer only" in refused
    assert ": omit it;" in refused
    assert "secret" not in refused


def test_a_rate_that_a_stream_does_not_take_is_a_warning(capsys: pytest.CaptureFixture[str]):
    assert main(["run", "http://me:secret@127.0.0.1:9/live.mjpg", "--fps", "10", "--no-view"]) == 1
    printed = capsys.readouterr()
    assert "10 per second cannot be requested of the stream http://127.0.0.1:9/live.mjpg" in printed.out
    assert "secret" not in printed.out + printed.err


def test_the_viewer_has_the_defaults_of_its_options():
    defaults = {name: each.default for name, each in inspect.signature(Viewer).parameters.items()}
    assert (defaults["host"], defaults["max_clients"]) == (options.HOST, options.MAX_CLIENTS)


def test_a_folder_of_pictures_keeps_its_whole_name(tmp_path: Path):
    (tmp_path / "trial.3").mkdir()
    assert result_names([str(tmp_path / "trial.3"), f"{tmp_path}/trial.3/"]) == ["trial.3", "trial.3-2"]


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["--version"], 0),
        (["--help"], 0),
        (["process", "--help"], 0),
        (["proces"], 2),
        (["process", "a.mp4"], 2),
        (["process", "a.mp4", "--out", "o", "--roi", "0,0,9.5,9"], 2),
        (["process", "a.mp4", "--out", "o", "--threshold", "otsu"], 2),
        (["process", "a.mp4", "--out", "o", "--method", "paper", "--threshold", "256"], 2),
        (["process", "a.mp4", "--out", "o", "--iterations", "50"], 2),
        (["run", "a.mp4", "--method", "paper", "--interpolation", "spline", "--power", "3"], 2),
        (["process", "a.mp4", "--out", "o", "--pitch-mm", "0"], 2),
        (["process", "a.mp4", "--out", "o", "--pitch-mm", "1e300"], 2),
        (["process", "a.mp4", "--out", "o", "--pitch-mm", "4,1e-300"], 2),
        (["process", "a.mp4", "--out", "o", "--fps", "1e-300"], 2),
        (["run", "a.mp4", "--fps", "1e300"], 2),
        (["process", "a.mp4", "--out", "o", "--hfov-deg", "nan"], 2),
        (["process", "a.mp4", "--out", "o", "--pitch-mm", "4,nan"], 2),
        (["process", "a.mp4", "--out", "o", "--roi", "inf,0,9,9"], 2),
        (["process", "a.mp4", "--out", "o", "--sensor", "s.toml", "--pitch-mm", "4"], 2),
        (["run", "sim:", "--sensor", "s.toml", "--hfov-deg", "60"], 2),
        (["run", "sim:", "--record", "press.txt"], 2),
        (["demo", "--seconds", "inf"], 2),
        (["process", "a.mp4", "--out", "o", "--method", "paper", "--opening-px", "2"], 2),
        (["process", "a.mp4", "--out", "o", "--method", "paper", "--iterations", "1"], 2),
        (["process", "a.mp4", "--out", ""], 2),
        (["process", "a.mp4", "--out="], 2),
        (["process", "", "--out", "o"], 2),
        (["view", ""], 2),
        (["calibrate", "rest", "a.mp4", "--sensor", "", "--out", "o.toml"], 2),
        (["run", "sim:one", "--to", "bogus://x"], 2),
        (["run", "sim:one", "--to", "osc://127.0.0.1:notaport"], 2),
        (["run", "sim:one", "--to", "foxglove://:99999"], 2),
        (["run", "rig.toml", "--to", "bogus://x"], 2),
        (["demo", "--to", "bogus://x"], 2),
        (["design", "--out", "o", "--area-mm", "-nan,60"], 2),
        (["design", "--out", "o", "--area-mm", "-1,2"], 2),
        (["design", "--out", "o", "--bed-mm", "0,200,200"], 2),
        (["design", "--out", "o", "--deepest-mm", "nan"], 2),
        (["design", "--out", "o", "--force-N", "10,0.1"], 2),
        (["design", "--out", "o", "--fps", "-1"], 2),
        (["design", "--out", "o", "--material", "wood"], 2),
        (["calibrate", "camera", "a.png", "--board", "chess:9x6", "--square-mm", "5", "--out", "o.toml"], 2),
        (
            [
                "calibrate",
                "camera",
                "a.png",
                "--board",
                "circles:9x6",
                "--square-mm",
                "-5",
                "--out",
                "o.toml",
            ],
            2,
        ),
        (
            [
                "calibrate",
                "camera",
                "a.png",
                "--board",
                "circles:9x6",
                "--square-mm",
                "nan",
                "--out",
                "o.toml",
            ],
            2,
        ),
        (["calibrate", "rest", "a.mp4", "--sensor", "s", "--out", "o.toml", "--thickness-mm", "-1"], 2),
        (["calibrate", "rest", "a.mp4", "--sensor", "s.toml", "--out", "o.toml", "--sheet-mm", "9,9"], 2),
        (["calibrate", "sheet", "--sensor", "s.toml"], 2),
    ],
)
def test_exit_status_of_words_alone(words, status, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(words) == status
    printed = capsys.readouterr()
    assert (printed.err.count("\n") == 1) == (status == 2)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nothing"], "calibrate, design; see manytouch --help"),
        (["calibrate", "camera"], "see manytouch calibrate camera --help"),
        (["calibrate", "sheet", "--sensor", "s.toml"], "see manytouch calibrate sheet --help"),
        (["evaluate", "a", "--out", "o"], "see manytouch evaluate --help"),
        (
            ["process", "a.mp4", "--out", "o", "--method", "paper", "--opening-px", "2"],
            "--opening-px: expected an odd number of px from 1, found '2'",
        ),
        (["process", "a.mp4", "--out", ""], "an empty word after --out: give a path or a value"),
        (["batch", "a.mp4", "--out="], "an empty word after --out: give a path or a value"),
        (["view", ""], "there is an empty word: give a path or a value"),
        (["design", "--out", "o", "--area-mm", "-1,2"], "--area-mm: expected X,Y above 0, found '-1,2'"),
        (
            ["process", "a.mp4", "--out", "o", "b.mp4"],
            "unexpected words: b.mp4 (list all inputs before the options)",
        ),
        (["run", "a.avi", "b.avi"], "unexpected words: b.avi (run takes one input only)"),
        (
            ["doctor", "a.avi", "b.avi", "c.avi"],
            "unexpected words: b.avi c.avi (doctor takes one input only)",
        ),
        (["recording", "check", "a", "b"], "unexpected words: b (recording check takes one input only)"),
        (["demo", "a.avi"], "unexpected words: a.avi (demo takes no input)"),
        (
            ["run", "a.avi", "--no-view", "--port", "8100"],
            "--port is for the viewer, which --no-view omits: omit it, or --no-view",
        ),
        (
            ["demo", "--no-view", "--token", "abcdefgh12345678", "--host", "0.0.0.0"],
            "--host, --token are for the viewer, which --no-view omits: omit them, or --no-view",
        ),
    ],
)
def test_an_error_of_the_command_line_refers_to_the_help(words, message, capsys):
    assert main(words) == 2
    assert message in capsys.readouterr().err


def test_options_of_several_numbers_have_no_empty_variant_and_defaults_as_they_are_typed(capsys):
    assert main(["design", "--help"]) == 0
    printed = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "--empty" not in printed
    for default in ("100,60", "0.1,10", "2560,1440", "220,220,250"):
        assert f"[default: {default}]" in printed


@pytest.mark.parametrize("verb", [*VERBS, "calibrate camera", "calibrate rest", "calibrate sheet"])
def test_help_has_an_example_and_keeps_its_line_breaks(verb, capsys):
    assert main([*verb.split(), "--help"]) == 0
    explained = capsys.readouterr().out.split("╭")[0]
    assert f"Example: manytouch {verb}" in explained
    paragraphs = explained.split("\n\n")[2:]
    for lines in (text.splitlines() for text in paragraphs if "Example:" not in text):
        assert all(len(line) > 40 for line in lines[:-1]), lines


def test_the_list_of_commands_has_the_first_sentence_of_each_help(capsys):
    for name, (_, summary) in COMMANDS.items():
        assert main([name, "--help"]) == 0
        assert " ".join(capsys.readouterr().out.split("\n\n")[1].split()) == summary


@pytest.mark.parametrize("columns", [40, 80, 200])
def test_the_list_of_commands_fits_the_terminal(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert main(["--help"]) == 0
    lines = capsys.readouterr().out.partition("manytouch COMMAND --help")[0].splitlines()
    assert max(map(len, lines)) <= columns
    for name in (*COMMANDS, *OPTIONS):
        assert sum(line.startswith(f"  {name} ") for line in lines) == 1


def test_options_of_the_list_are_those_of_the_parser():
    known = {flag for name in OPTIONS for flag in name.split(", ")}
    assert known == {flag for flag in application(()) if flag.startswith("-")}


def test_failures_are_one_line_even_when_the_message_has_more(capsys, monkeypatch):
    def fail(*_: object, **__: object) -> int:
        raise ManytouchError("first\n  second")

    monkeypatch.setattr("manytouch.cli.application.application", lambda words: fail)
    assert main(["doctor"]) == 1
    assert capsys.readouterr().err == "manytouch: first second\n"


def test_an_internal_error_requests_a_report(capsys, monkeypatch):
    def fail(*_: object, **__: object) -> int:
        raise ValueError("shapes differ")

    monkeypatch.setattr("manytouch.cli.application.application", lambda words: fail)
    assert main(["doctor"]) == 1
    printed = capsys.readouterr().err
    assert "ValueError: shapes differ" in printed
    assert "--debug" in printed
    assert "Traceback" not in printed


def test_the_first_ctrl_c_requests_a_stop_and_the_second_interrupts(capsys):
    before = signal.getsignal(signal.SIGINT)
    with StopOnSignal() as stop:
        assert not stop()
        signal.raise_signal(signal.SIGINT)
        assert stop()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before
    printed = capsys.readouterr().err
    assert "Ctrl-C again" in printed
    assert "frame" not in printed, "there is none in a simulation or an evaluation"


def test_a_command_can_be_called_in_a_thread() -> None:
    found: list[bool] = []

    def call() -> None:
        with StopOnSignal() as stop:
            found.append(stop())

    thread = threading.Thread(target=call)
    thread.start()
    thread.join()
    assert found == [False]


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="there is no SIGHUP on Windows")
@pytest.mark.parametrize("before", [signal.SIG_DFL, signal.SIG_IGN])
def test_a_lost_terminal_ends_a_session_unless_it_is_to_be_ignored(before: signal.Handlers) -> None:
    outer = signal.signal(signal.SIGHUP, before)
    try:
        with StopOnSignal() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert stop() == StopOnSignal.is_terminated == (before == signal.SIG_DFL)
        assert signal.getsignal(signal.SIGHUP) is before
    finally:
        signal.signal(signal.SIGHUP, outer)


def test_a_program_that_is_interrupted_while_it_is_imported_has_no_traceback(monkeypatch, capsys):
    class Interrupting:
        """Finds no module, as Ctrl-C comes first."""

        def find_spec(self, name: str, *_: object) -> None:
            if name == "manytouch.cli.application":
                raise KeyboardInterrupt

    monkeypatch.delitem(sys.modules, "manytouch.cli.application")
    monkeypatch.setattr(sys, "meta_path", [Interrupting(), *sys.meta_path])
    assert main(["--version"]) == 0
    assert capsys.readouterr().err == "stopped\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_ends_a_program_that_waits_for_its_camera(number, monkeypatch, capsys):
    def waits(*args, **options) -> None:
        signal.raise_signal(number)

    monkeypatch.setattr("manytouch.session.prepare", waits)
    assert main(["run", "0", "--no-view"]) == (143 if number == signal.SIGTERM else 0)
    assert capsys.readouterr().err.endswith("stopped\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_the_first_reading_ends_with_a_sentence_that_nothing_was_written(
    number, monkeypatch, capsys, tmp_path
):
    monkeypatch.setattr("manytouch.session.prepare", lambda *_, **__: signal.raise_signal(number))
    (tmp_path / "a.mp4").touch()
    status = main(["process", str(tmp_path / "a.mp4"), "--out", str(tmp_path / "o")])
    assert status == (143 if number == signal.SIGTERM else 0)
    last = capsys.readouterr().out.split("\n")[-2]
    assert last.endswith(f"stopped before the first frame: nothing was written to {tmp_path / 'o' / 'a'}")
    assert not (tmp_path / "o").exists()


def test_doctor_reports_a_missing_file_and_nothing_else(capsys, tmp_path):
    assert main(["doctor", str(tmp_path / "press.mp4")]) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("manytouch: There is no ")


def test_calibrate_rest_without_a_sensor_file_names_what_makes_one(capsys, tmp_path):
    assert main(["calibrate", "rest", "rest.mp4", "--out", str(tmp_path / "rested.toml")]) == 2
    printed = capsys.readouterr().err
    assert "manytouch calibrate camera makes it" in printed
    assert "gelsight-mini" in printed


def test_an_interrupt_outside_of_any_run_ends_quietly(capsys, monkeypatch):
    def interrupt() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("manytouch.session.diagnosis.installation.describe_installation", interrupt)
    assert main(["doctor"]) == 0
    assert capsys.readouterr().err == "stopped\n"


def test_options_of_the_paper_become_the_parameters_of_its_pipeline():
    from manytouch.session import pipeline_for

    words = (
        "--threshold otsu-10 --opening-px 5 --opening-padding none --minimum-area-px2 30"
        " --maximum-area-px2 900 --gate-px 4.5 --formula unit-quads --padding zero --contact-depth-pitch 0.5"
        " --interpolation idw --iterations 60 --search-radius-pitch 2 --power 3"
    )
    given = {}

    def keep(
        surface: method_options.WithInterpolation = method_options.InterpolationOptions(),  # noqa: B008
        paper: method_options.Paper = method_options.PaperOptions(),  # noqa: B008
    ):
        given.update(surface.parameters("process", "paper") | paper.parameters("process", "paper"))

    App(default_command=keep)(words.split(), exit_on_error=False, result_action="return_value")
    pipeline = pipeline_for("paper", parameters=given)
    detect, track, estimate = pipeline.detect, pipeline.track, pipeline.estimate
    assert (detect.threshold, detect.margin, detect.kernel_px, detect.opening_padding) == (
        None,
        -10,
        5,
        "none",
    )
    assert (detect.minimum_area_px2, detect.maximum_area_px2, track.gate_px) == (30.0, 900.0, 4.5)
    assert (estimate.formula, estimate.padding, estimate.contact_depth_pitch) == ("unit_quads", "zero", 0.5)
    assert estimate.interpolation == Interpolation(
        kind="idw", iterations=60, search_radius_pitch=2.0, power=3.0
    )
