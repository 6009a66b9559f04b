"""Topics of ROS 2: bytes of rosbags, read by the deserializer of cyclonedds, over DDS on loopback."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from manytouch.errors import ManytouchError
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.dds import DdsParticipant, dds_type
from manytouch.sinks.publishers.registry import open_outputs
from manytouch.sinks.publishers.ros2 import TOPICS, mount_of
from manytouch.sinks.ros2.messages import CONTACT_FIELDS, UNKNOWN_SCALE, RosMessage, RosMessages, typestore
from manytouch.values import Command, Phase, Sensor, Status, Tare, UndoTare
from waiting import wait_until

LOOPBACK = Path(__file__).parents[3] / "peers" / "loopback.xml"
DOMAIN = 87


@pytest.fixture(autouse=True)
def on_loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK.as_uri())


@pytest.fixture
def pressed(reading_of, contact_of):
    one = contact_of(
        3, force_N=np.array([0.1, 0.2, -3.0]), torque_Nmm=5.0, area_mm2=12.0, centre_mm=np.array([2.5, -1.25])
    )
    ended = contact_of(4, Phase.END, force_N=np.array([9.0, 9.0, -9.0]))
    return reading_of(7, (one, ended), depth_mm=1.0)


def test_a_contact_has_all_standard_deviations_in_si_units(sensor, reading_of, contact_of) -> None:
    covariance = np.diag(np.arange(1.0, 9.0) ** 2)  # of x, y, depth, shear x, y, normal force, torque, area
    message = RosMessages(sensor).contacts(reading_of(0, (contact_of(3, covariance=covariance),)), 0)
    cloud = typestore().deserialize_cdr(message.cdr, message.type)
    numbers = np.frombuffer(cloud.data[8:], "<f4")  # behind id and phase
    found = dict(zip(CONTACT_FIELDS, numbers.tolist(), strict=True))
    assert {name: value for name, value in found.items() if name.endswith("_std")} == pytest.approx(
        {
            **{"x_std": 1e-3, "y_std": 2e-3, "depth_std": 3e-3, "shear_x_std": 4.0, "shear_y_std": 5.0},
            **{"normal_force_std": 6.0, "torque_std": 7e-3, "area_std": 8e-6},
        }
    )


def transforms_of(message: RosMessage) -> dict[str, tuple[str, np.ndarray]]:
    found = typestore().deserialize_cdr(message.cdr, message.type).transforms
    return {
        each.child_frame_id: (
            each.header.frame_id,
            matrix_of(each.transform.translation, each.transform.rotation),
        )
        for each in found
    }


def matrix_of(move, turn) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    matrix[:3, 3] = move.x, move.y, move.z
    return matrix


def with_read_only_pose(sensor: Sensor) -> None:
    """As of all sensors that are read or computed."""
    sensor.camera.rotation_vector.setflags(write=False)
    sensor.camera.translation_mm.setflags(write=False)


def test_the_pose_of_the_sheet_in_a_rig_is_the_product_of_its_transforms(sensor) -> None:
    address = parse_address("ros2://hand/index?parent=hand&pose=40,5,-2,0,0,1.5")
    with_read_only_pose(sensor)
    found = transforms_of(RosMessages(sensor, "hand/index", mount_of(address)).transform(0))
    assert {child: parent for child, (parent, _) in found.items()} == {
        "hand/index_sheet": "hand/index_camera",
        "hand/index_camera": "hand",
    }
    pose = found["hand/index_camera"][1] @ found["hand/index_sheet"][1]
    np.testing.assert_allclose(pose[:3, 3], (0.040, 0.005, -0.002), atol=1e-9)
    np.testing.assert_allclose(pose[:3, :3], Rotation.from_rotvec((0, 0, 1.5)).as_matrix(), atol=1e-9)
    assert len(transforms_of(RosMessages(sensor).transform(0))) == 1


@pytest.mark.parametrize(
    "options", ["parent=hand", "pose=0,0,0,0,0,0", "parent=hand&pose=1,2", "parent=7&pose=0,0,0,0,0,0"]
)
def test_half_a_pose_is_refused(options: str) -> None:
    with pytest.raises(ManytouchError, match="expected parent=FRAME&pose="):
        mount_of(parse_address(f"ros2://skin?{options}"))


def test_the_decoder_of_the_documentation_reads_contacts(sensor, pressed) -> None:
    page = Path(__file__).parents[4] / "docs" / "ros2.md"
    if not page.exists():
        pytest.skip("the pages come with the repository, not with the wheel")
    text = page.read_text(encoding="utf-8")
    (code,) = re.findall(r"^TYPES = .*?\n(?=def show)", text, re.MULTILINE | re.DOTALL)
    names: dict[str, Any] = {"np": np}
    exec(code, names)
    message = RosMessages(sensor).contacts(pressed, 0)
    points = names["records"](typestore().deserialize_cdr(message.cdr, message.type))
    assert points["id"].tolist() == [3, 4]
    assert points["phase"].tolist() == [1, 2]
    assert points["fz"].tolist() == [-3.0, -9.0]
    assert points["area"].tolist()[0] == pytest.approx(12e-6)


def samples_of(reader) -> list:
    return reader.take(N=10)


def test_the_description_names_every_topic_and_the_domain(session) -> None:
    (output,) = open_outputs([f"ros2://skin?domain={DOMAIN}"], session)
    output.close()
    for topic in TOPICS:
        assert f"/skin/{topic}" in output.description
    assert f"in the ROS domain {DOMAIN};" in output.description
    assert "/skin/tare" in output.description
    assert "/skin/undo_tare" in output.description


def test_a_reader_receives_the_wrench_and_the_contacts(session, pressed) -> None:
    peer = DdsParticipant(DOMAIN)
    wrench = peer.reader("/skin/wrench", "geometry_msgs/msg/WrenchStamped", is_reliable=False)
    cloud = peer.reader("/skin/contacts", "sensor_msgs/msg/PointCloud2", is_reliable=False)
    (output,) = open_outputs([f"ros2://skin?domain={DOMAIN}"], session)
    found: dict[str, list] = {"wrench": [], "contacts": []}

    def received() -> bool:
        output.write(pressed)
        found["wrench"] += samples_of(wrench)
        found["contacts"] += samples_of(cloud)
        return all(found.values())

    wait_until(received)
    message = found["wrench"][0]
    force, torque = message.wrench.force, message.wrench.torque
    assert (force.x, force.y, force.z) == (0.1, 0.2, -3.0)
    # r x f of (2.5, -1.25, 0) mm and the force, plus 5 N mm about z, in N m
    assert (torque.x, torque.y, torque.z) == pytest.approx((3.75e-3, 7.5e-3, 5.625e-3))
    assert message.header.frame_id == "skin_sheet"
    points = np.frombuffer(
        bytes(found["contacts"][0].data),
        np.dtype([("id", "<u4"), ("phase", "<u4"), *((name, "<f4") for name in CONTACT_FIELDS)]),
    )
    assert points["id"].tolist() == [3, 4]
    assert points["phase"].tolist() == [1, 2]
    assert points["x"][0] == pytest.approx(2.5e-3)
    assert points["normal_force_std"].tolist() == pytest.approx([np.nan, np.nan], nan_ok=True)
    assert points["area"][0] == pytest.approx(12e-6)
    output.close()
    peer.close()


@pytest.mark.parametrize(("topic", "kind"), [("/skin/tare", Tare), ("/skin/undo_tare", UndoTare)])
def test_a_message_requests_a_tare_or_undoes_it(topic: str, kind: type[Command], session, pressed) -> None:
    (output,) = open_outputs([f"ros2://skin?domain={DOMAIN}"], session)
    peer = DdsParticipant(DOMAIN)
    peer.declare(topic, "std_msgs/msg/Empty", is_latched=True)
    empty = bytes(typestore().serialize_cdr(typestore().types["std_msgs/msg/Empty"](), "std_msgs/msg/Empty"))

    def is_tared() -> bool:
        peer.write(RosMessage(topic=topic, type="std_msgs/msg/Empty", cdr=empty))
        output.write(pressed)
        return bool(session.commands)

    wait_until(is_tared)
    assert all(type(command) is kind for command in session.commands)
    output.close()
    peer.close()


@pytest.mark.parametrize(
    ("source", "status", "warning", "expected"),
    [
        ("ok", Status.OK, None, (0, "ok")),
        ("ok", Status.DARK, None, (1, "dark")),
        ("ok", Status.OK, "tared while touched", (1, "tared while touched")),
        ("ok", Status.DARK, "tared while touched", (1, "dark; tared while touched")),
        ("unplugged", Status.OK, "tared while touched", (2, "unplugged")),
    ],
)
def test_diagnostics_warn_of_frames_and_of_the_reference(
    source: str, status: Status, warning: str | None, expected: tuple[int, str], session
) -> None:
    health = replace(session.health(), source_state=source, reference_warning=warning)
    sent = RosMessages(session.sensor).diagnostics(health, status, 0)
    (found,) = typestore().deserialize_cdr(sent.cdr, sent.type).status
    assert (found.level, found.message) == expected


def test_lengths_in_pitches_are_not_called_metres(session) -> None:
    unscaled = replace(session.sensor, scale_is_known=False)
    sent = RosMessages(unscaled).diagnostics(session.health(), Status.OK, 0)
    (entry,) = typestore().deserialize_cdr(sent.cdr, sent.type).status
    assert (entry.level, entry.message) == (1, UNKNOWN_SCALE)
    session.sensor = unscaled
    (output,) = open_outputs([f"ros2://skin?domain={DOMAIN}"], session)
    output.close()
    assert output.description.endswith(UNKNOWN_SCALE)


def test_messages_without_a_reader_are_not_made(session, pressed, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("nobody reads it")

    monkeypatch.setattr(RosMessages, "surface", refuse)
    (output,) = open_outputs([f"ros2://skin?domain={DOMAIN}"], session)
    output.write(pressed)
    wait_until(lambda: output.state.sent + output.state.dropped == 1)
    assert output.state.problem is None
    output.close()


@pytest.mark.parametrize("url", ["ros2://my-robot", "ros2://a?domain=300", "ros2://1st"])
def test_names_and_domains_that_ros_does_not_know_are_refused(url: str, session) -> None:
    with pytest.raises(ManytouchError, match=r"not a name of ROS|number from 0 to 232"):
        open_outputs([url], session)


def test_every_message_is_what_another_deserializer_reads(sensor, pressed, session) -> None:
    with_read_only_pose(sensor)
    messages = RosMessages(sensor, "skin")
    _ = (messages.contacts(pressed, 1), messages.surface(pressed, 1), messages.image(b"", "jpeg", 1))
    made = [
        messages.wrench(pressed, 10**18),
        messages.contacts(pressed, 10**18),
        messages.surface(pressed, 10**18),
        messages.markers(pressed, 10**18),
        messages.image(b"\xff\xd8\xff", "jpeg", 10**18),
        messages.camera_info(10**18),
        messages.transform(10**18),
        messages.diagnostics(session.health(), pressed.status, 10**18),
    ]
    for each in made:
        assert (
            bytes(typestore().serialize_cdr(typestore().deserialize_cdr(each.cdr, each.type), each.type))
            == each.cdr
        )
        again = dds_type(each.type).deserialize(each.cdr)
        assert type(again).__name__ == each.type.rpartition("/")[2]
        if hasattr(again, "header"):
            assert again.header.stamp.sec == 10**9
    arrow = dds_type("visualization_msgs/msg/MarkerArray").deserialize(made[3].cdr)
    assert [marker.action for marker in arrow.markers] == [3, 0]
    transform = dds_type(made[6].type).deserialize(made[6].cdr).transforms[0].transform
    assert transform.translation.z == pytest.approx(0.05)
    values = {
        value.key: value.value for value in dds_type(made[7].type).deserialize(made[7].cdr).status[0].values
    }
    assert values["fps"] == "30.0"
