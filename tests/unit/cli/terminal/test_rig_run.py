"""Lines about the contacts of a rig."""

from dataclasses import replace

from manytouch.cli.terminal.rig_run import RigLog
from manytouch.rigs.rig_contact import RigContact
from manytouch.values import Phase

CONTACT = RigContact(
    id=2,
    phase=Phase.START,
    frame=0,
    sensor_time_s=0.0,
    position_mm=(1.0, 2.0, 3.0),
    position_std_mm=(0.1, 0.1, 0.1),
    force_N=(0.0, 0.0, -1.0),
    force_std_N=(0.1, 0.1, 0.1),
    depth_mm=0.5,
    own={"depth_std_mm": 0.02, "normal_force_N": 1.0, "force_std_N": 0.1},
)


def test_depth_and_force_are_printed_and_the_end_shows_the_deepest_frame() -> None:
    lines: list[str] = []
    log = RigLog(lines.append)
    deepest = replace(CONTACT, phase=Phase.MOVE, depth_mm=0.8, own={**CONTACT.own, "normal_force_N": 2.0})
    last = replace(CONTACT, phase=Phase.END, depth_mm=0.1)
    for time_s, contact in ((1.0, CONTACT), (1.5, deepest), (2.0, last)):
        log.on_contacts("thumb", time_s, (contact,))
    begin, end = lines
    assert (
        begin
        == "thumb:    1.000 s  #2 touches at 1.0, 2.0, 3.0 mm, depth 0.50 ± 0.02 mm, force 1.00 ± 0.10 N"
    )
    assert "#2 gone at" in end
    assert "depth 0.80 ± 0.02 mm, force 2.00 ± 0.10 N, deepest of 1.00 s" in end


def test_what_is_unknown_is_left_out() -> None:
    lines: list[str] = []
    nothing = float("nan")
    own = {"depth_std_mm": None, "normal_force_N": None, "force_std_N": None}
    RigLog(lines.append).on_contacts(
        "thumb", 0.0, (replace(CONTACT, position_mm=(nothing,) * 3, depth_mm=nothing, own=own),)
    )
    assert lines == ["thumb:    0.000 s  #2 touches"]
