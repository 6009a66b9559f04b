"""Lines about the contacts of a rig."""

from dataclasses import replace
from pathlib import Path

import pytest

from manytouch.cli.terminal.rig_run import RigLog, run_rig_file
from manytouch.errors import ManytouchError
from manytouch.rigs import run_rig as rigs
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


def test_a_sensor_that_is_given_up_ends_the_command_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rigs, "MOST_FAILURES", 1)
    path = tmp_path / "rig.toml"
    path.write_text('schema = 1\nname = "hand"\n[[sensors]]\nname = "index"\nsource = "gone.mp4"\n')
    with pytest.raises(ManytouchError, match=r"^1 of 1 sensor failed, index: There is no 'gone\.mp4' in"):
        run_rig_file(path, {}, out=None, record=None, to=(), is_viewing=False, port=0)
