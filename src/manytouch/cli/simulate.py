"""`manytouch simulate`: a recording of the simulated sensor, and what really happened."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import options


def simulate(
    scene: Annotated[
        Path, Parameter(name="SCENE.toml", negative=(), help="What presses, and how it is seen.")
    ],
    /,
    *,
    out: Annotated[Path, options.folder("Folder for frames, sensor file and truth.")],
    states: Annotated[
        Path | None,
        options.folder("Folder of solved states of the sheet. [default: in the user's cache]"),
    ] = None,
) -> int:
    """Press a simulated sheet as a scene file says; write pictures, sensor file and truth.

    The folder gets frames/000000.png and on, sensor.toml, truth/contacts.csv and
    truth/markers.parquet. The sheet is solved with finite elements in 3-D at
    keyframes, some seconds each. Solved states are kept, so after Ctrl-C the same
    command goes on.

    Example: manytouch simulate two_fingers.toml --out simulated
    """
    from manytouch.cli.terminal.console import Steps
    from manytouch.cli.terminal.interrupt import Stop
    from manytouch.simulation.scene.file import load_scene
    from manytouch.simulation.scene.solve import simulator, solve_scene, state_count, states_folder
    from manytouch.sinks.files.atomic_output import check_writable
    from manytouch.sinks.files.simulated_folder import SimulatedFolder

    said = load_scene(scene)
    check_writable(out)
    with Stop() as stop, Steps() as steps:
        steps.say(
            f"scene {said.name}: {len(said.bodies)} bodies, {said.duration_s:g} s on {said.sensor.name}"
        )
        count, found = state_count(said), []
        folder = states or states_folder()
        for state in steps.through("states of the sheet", solve_scene(said, folder), count):
            found.append(state)
            if stop() and len(found) < count:
                steps.say(
                    f"stopped; {len(found)} of {count} states are kept in {folder}, run it again to go on"
                )
                return 0
        sensor = simulator(said, tuple(found))
        sink, written = SimulatedFolder(out, sensor.sensor), 0
        for index in steps.through("frames", range(sensor.frame_count), sensor.frame_count):
            sink.write(sensor.frame(index), sensor.truth(index))
            written += 1
            if stop():
                break
        sink.close()
        whole = "" if written == sensor.frame_count else f" of {sensor.frame_count}"
        steps.say(f"{written}{whole} frames and their truth in {out}")
    return 0
