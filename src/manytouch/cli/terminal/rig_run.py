"""`manytouch run RIG.toml`: several sensors, whose contacts are printed in rig coordinates."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from rich.console import Console

from manytouch.cli.terminal.failures import usage_error
from manytouch.cli.terminal.options import HOST, given_options
from manytouch.errors import ManytouchError
from manytouch.rigs.rig_contact import RigContact
from manytouch.values import Phase
from manytouch.values.display.text import count_of, with_std


class RigLog:
    """Prints notes, and contacts as they start and end; at the end with the values of their deepest frame."""

    def __init__(self, write_line: Callable[[str], None]) -> None:
        self._line = write_line
        self._open: dict[tuple[str, int], tuple[float, RigContact]] = {}

    def on_note(self, sensor: str, sentence: str) -> None:
        """Print a sentence."""
        self._line(f"{sensor}: {sentence}")

    def on_contacts(self, sensor: str, time_s: float, contacts: tuple[RigContact, ...]) -> None:
        """Print the contacts that start or end."""
        for contact in contacts:
            key = sensor, contact.id
            begun_s, deepest = self._open.get(key, (time_s, contact))
            if contact.phase is Phase.END:
                if self._open.pop(key, None) is not None:
                    self._print(sensor, time_s, deepest, "gone", f", deepest of {time_s - begun_s:.2f} s")
                continue
            if key not in self._open or contact.phase is Phase.START:
                self._open[key] = time_s, contact
                self._print(sensor, time_s, contact, "touches")
            elif not contact.depth_mm <= deepest.depth_mm:
                self._open[key] = begun_s, contact

    def _print(self, sensor: str, time_s: float, contact: RigContact, word: str, what: str = "") -> None:
        x, y, z = contact.position_mm
        place = f" at {x:.1f}, {y:.1f}, {z:.1f} mm" if math.isfinite(x) else ""
        depth = _described("depth", contact.depth_mm, contact.own["depth_std_mm"], "mm")
        force = _described("force", contact.own["normal_force_N"], contact.own["force_std_N"], "N")
        self.on_note(sensor, f"{time_s:8.3f} s  #{contact.id} {word}{place}{depth}{force}{what}")


def _described(name: str, value: float | None, std: float | None, unit: str) -> str:
    if value is None or not math.isfinite(value):
        return ""
    return f", {name} {with_std(value, math.nan if std is None else std)} {unit}"


def run_rig_file(
    path: Path,
    given: Mapping[str, object],
    *,
    out: Path | None,
    record: Path | None,
    to: Sequence[str],
    is_viewing: bool,
    port: int,
) -> int:
    """Run a rig until its sources end or Ctrl-C.

    Args:
        path: of the rig file.
        given: values of the options that a rig cannot have, by their names.
        out: folder in which results are written to a folder of the rig.
        record: MCAP file to record to.
        to: addresses of outputs.
        is_viewing: whether the page of the rig is served.
        port: of that page; 0 chooses one.

    Raises:
        CycloptsError: an option is given that the rig file states for each sensor.
        ManytouchError: the rig file or the address of an output is wrong, or, at the end, a sensor was given
            up.
    """
    _refuse_options(given)
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.rigs.overview_page import OverviewPage
    from manytouch.rigs.rig_file import load_rig
    from manytouch.rigs.rig_outputs import with_outputs
    from manytouch.rigs.run_rig import SensorState, run_rig

    rig, shown = with_outputs(load_rig(path), to), dict[str, SensorState]()
    console = Console(highlight=False, soft_wrap=True)
    log = RigLog(lambda line: console.print(line, markup=False))
    page = OverviewPage(rig.name, shown, port) if is_viewing else None
    if page is not None:
        log.on_note(rig.name, f"all sensors at {page.url}")
    try:
        with StopOnSignal(is_live=True) as stop:
            states = run_rig(
                rig,
                log,
                stop,
                out=None if out is None else out / rig.name,
                record=record,
                viewer_host=None if page is None else HOST,
                page_origin=None if page is None else page.origin,
                on_states=shown.update,
            )
    finally:
        if page is not None:
            page.close()
    for name, state in states.items():
        times = "" if not state.restarts else f", started again {count_of(state.restarts, 'time')}"
        log.on_note(name, f"{count_of(state.frames, 'frame')} processed, {state.dropped} dropped{times}")
    if record is not None:
        log.on_note(
            rig.name, f"recorded {record}; manytouch view {record}#{rig.sensors[0].name} shows a sensor"
        )
    failed = {name: state.failure for name, state in states.items() if state.is_over and state.failures}
    if failed:
        reasons = "; ".join(f"{name}: {why or 'its process ended'}" for name, why in failed.items())
        raise ManytouchError(f"{len(failed)} of {count_of(len(states), 'sensor')} failed, {reasons}")
    return 0


def _refuse_options(given: Mapping[str, object]) -> None:
    """Check that no option is given that the rig file states for each sensor.

    Raises:
        CycloptsError: one is.
    """
    wrong = given_options(given)
    if wrong:
        raise usage_error(
            "run",
            f"{', '.join(wrong)} cannot be used with a rig file: below [[sensors]] it has source, serial, "
            "sensor, method, fps, size_px, to and pose; omit the rest",
        )
