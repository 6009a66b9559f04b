"""`manytouch run RIG.toml`: several sensors, whose contacts are printed in the frame of the rig."""

import math
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console

from manytouch.cli.terminal.failures import usage_error
from manytouch.rigs.sensor_process import RigContact
from manytouch.values.arrays import count_of


class _Log:
    """Prints notes, and contacts as they start and end."""

    def __init__(self) -> None:
        self._console = Console(highlight=False, soft_wrap=True)

    def on_note(self, sensor: str, sentence: str) -> None:
        self._console.print(f"{sensor}: {sentence}", markup=False)

    def on_contacts(self, sensor: str, time_s: float, contacts: tuple[RigContact, ...]) -> None:
        for contact in contacts:
            if contact.phase == "move":
                continue
            x, y, z = contact.position_mm
            place = f" at {x:.1f}, {y:.1f}, {z:.1f} mm" if math.isfinite(x) else ""
            self.on_note(sensor, f"{time_s:8.3f} s  contact {contact.id} {contact.phase}{place}")


def run_rig_file(
    path: Path,
    given: Mapping[str, object],
    *,
    out: Path | None,
    record: Path | None,
    is_viewing: bool,
    port: int,
) -> int:
    """Run a rig until its sources end or Ctrl-C.

    Raises:
        CycloptsError: an option is given that the rig file states for each sensor.
        SourceError: the rig file is wrong.
    """
    wrong = [
        name for name, value in given.items() if not (value is None or value is False or value in ((), {}))
    ]
    if wrong:
        raise usage_error(
            "run",
            f"{', '.join(wrong)} cannot be used with a rig file: write what belongs to a sensor into the rig "
            "file or the sensor's own file, and omit the rest",
        )
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.rigs.overview_page import OverviewPage
    from manytouch.rigs.rig_file import load_rig
    from manytouch.rigs.run_rig import SensorState, run_rig

    rig, log, shown = load_rig(path), _Log(), dict[str, SensorState]()
    page = OverviewPage(rig.name, shown, port) if is_viewing else None
    if page is not None:
        log.on_note(rig.name, f"all sensors at {page.url}")
    try:
        with StopOnSignal() as stop:
            states = run_rig(
                rig,
                log,
                stop,
                out=None if out is None else out / rig.name,
                record=record,
                viewer_host=None if page is None else "127.0.0.1",
                page_origin=None if page is None else page.origin,
                on_states=shown.update,
            )
    finally:
        if page is not None:
            page.close()
    for name, state in states.items():
        times = "" if not state.restarts else f", started again {count_of(state.restarts, 'time')}"
        log.on_note(name, f"{count_of(state.frames, 'frame')} processed, {state.dropped} dropped{times}")
    failed = [name for name, state in states.items() if state.is_over and state.failures]
    if record is not None:
        log.on_note(
            rig.name, f"recorded {record}; manytouch view {record}#{rig.sensors[0].name} shows a sensor"
        )
    return 1 if failed else 0
