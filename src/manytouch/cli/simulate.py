"""`manytouch simulate`: images of the simulated sensor with their ground truth."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import options


def simulate(
    scene: Annotated[
        str,
        Parameter(
            name="SCENE.toml",
            negative=(),
            help="Scene file: sensor, indenters and motions; or a built-in scene, such as sim:pad.",
        ),
    ],
    /,
    *,
    out: Annotated[Path, options.folder("Folder for frames, sensor file and ground truth.")],
    states: Annotated[
        Path | None,
        options.folder("Folder of solved states of the sheet. [default: the cache of the user]"),
    ] = None,
) -> int:
    """Simulate a scene file; write images, sensor file and ground truth.

    Writes frames/000000.png and so on, sensor.toml, truth/contacts.csv,
    truth/markers.parquet and, for presses that are held, truth/presses.csv, a
    table for `calibrate sheet`. The sheet is solved with 3-D finite elements at
    keyframes, which takes some seconds each. Solved states are saved, so that
    the same command continues after Ctrl-C. A scene with a table `board` shows
    a calibration board.

    Example: manytouch simulate two_fingers.toml --out simulated
    Example: manytouch simulate sim:pad --out pad
    """
    from manytouch.calibration.camera.simulated_views import is_board_scene
    from manytouch.cli.terminal.console import Steps
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.simulation.scene.file import load_scene, scene_path
    from manytouch.simulation.scene.motion import held_presses
    from manytouch.simulation.solve_scene import simulator, solve_scene, state_count, states_folder
    from manytouch.sinks.files.atomic_output import check_writable
    from manytouch.sinks.files.simulated.simulated_folder import SimulatedFolder
    from manytouch.values.display.text import count_of

    path = scene_path(scene)
    if is_board_scene(path):
        return _simulate_views(path, out)
    loaded = load_scene(path)
    check_writable(out)
    with StopOnSignal() as stop, Steps() as steps:
        steps.print(
            f"scene {loaded.name}: {count_of(len(loaded.bodies), 'indenter')}, {loaded.duration_s:g} s, "
            f"sensor {loaded.sensor.name}"
        )
        count, found = state_count(loaded), []
        folder = states or states_folder()
        for state in steps.count("states of the sheet", solve_scene(loaded, folder), count):
            found.append(state)
            if stop() and len(found) < count:
                steps.print(
                    f"stopped; {len(found)} of {count} states are saved in {folder}; "
                    "run the same command again to continue"
                )
                return 0
        sensor = simulator(loaded, tuple(found))
        written = 0
        with SimulatedFolder(out, sensor.sensor, held_presses(loaded.bodies)) as sink:
            for index in steps.count("frames", range(sensor.frame_count), sensor.frame_count):
                sink.write(sensor.frame(index), sensor.truth(index))
                written += 1
                if stop():
                    break
        of_all = "" if written == sensor.frame_count else f" of {sensor.frame_count}"
        steps.print(f"{written}{of_all} frames and their ground truth in {out}")
    return 0


def _simulate_views(scene: Path, out: Path) -> int:
    from manytouch.calibration.camera.simulated_views import load_board_scene, write_views
    from manytouch.cli.terminal.console import Steps
    from manytouch.sinks.files.atomic_output import check_writable

    loaded = load_board_scene(scene)
    check_writable(out)
    with Steps() as steps:
        steps.print(
            f"scene {loaded.name}: {loaded.views} views of {loaded.board}, {loaded.board.square_mm:g} mm"
        )
        for _ in steps.count("views", write_views(loaded, out), loaded.views):
            pass
        steps.print(f"{loaded.views} views and their poses in {out}")
    return 0
