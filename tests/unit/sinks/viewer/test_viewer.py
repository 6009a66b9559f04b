"""The viewer as a client program uses it: files, updates, requests, and what is refused."""

import http.client
import json
import re
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("nicegui")
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from manytouch.errors import OutputError
from manytouch.geometry.sampling import sampling_at
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.viewer import Viewer
from manytouch.sinks.viewer.clients import MAX_IN_FLIGHT
from manytouch.sinks.viewer.server import page_files
from manytouch.sinks.viewer.update_format import unpack
from manytouch.values import Comparison, Pause, Press, Record, Tare, UseMethod
from viewer_session import FakeSession, reading_of
from waiting import wait_until


def get(viewer: Viewer, path: str, **headers: str) -> tuple[int, http.client.HTTPMessage, bytes]:
    connection = http.client.HTTPConnection(viewer.access.host, viewer.access.port, timeout=20)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, answer.headers, content


def connect_to(viewer: Viewer, **more: Any) -> ClientConnection:
    """Connect as a program that has the token, unless an origin or other headers are given."""
    if not {"origin", "additional_headers"} & set(more):
        more["additional_headers"] = bearer(viewer)
    return connect(f"ws://127.0.0.1:{viewer.access.port}/stream", max_size=2**24, open_timeout=20, **more)


def bearer(viewer: Viewer) -> dict[str, str]:
    assert viewer.token_file is not None
    return {"Authorization": f"Bearer {viewer.token_file.read_text()}"}


def next_message(stream: ClientConnection, kind: str) -> dict[str, Any]:
    """The next text message of a kind."""
    while True:
        message = stream.recv(timeout=20)
        if isinstance(message, str) and (content := json.loads(message))["kind"] == kind:
            return content


def next_update(stream: ClientConnection) -> tuple[dict[str, Any], dict[str, Any]]:
    """The next update."""
    while True:
        message = stream.recv(timeout=20)
        if isinstance(message, bytes):
            return unpack(message)


def test_the_page_and_all_its_files_are_served(viewer: Viewer) -> None:
    status, headers, page = get(viewer, "/")
    assert status == 200
    policy = str(headers["content-security-policy"])
    assert "default-src 'none'" in policy
    assert "style-src 'self'" in policy
    assert "unsafe" not in policy
    wanted = re.findall(rb'(?:href|src)="([^"]+)"', page)
    assert len(wanted) >= 3
    for name, (_, content) in page_files().items():
        assert get(viewer, f"/{name}")[2] == content
        if name.endswith(".js") and name != "three.js":
            wanted += re.findall(rb'from "\./([^"]+)"', content)
    assert {name.decode() for name in wanted} <= set(page_files())


@pytest.mark.parametrize(
    "path",
    ["/nothing", "/../server.py", "/%2e%2e/server.py", "/..%2fserver.py", "/page/main.js", "/stream"],
)
def test_nothing_else_is_served(viewer: Viewer, path: str) -> None:
    assert get(viewer, path)[0] == 404


def test_pages_of_other_sites_are_refused(viewer: Viewer) -> None:
    assert get(viewer, "/", Host="evil.example")[0] == 421
    with pytest.raises(InvalidStatus):
        connect_to(viewer, origin="http://evil.example")
    origin = f"http://127.0.0.1:{viewer.access.port}"
    with connect_to(viewer, origin=origin) as stream:
        assert next_message(stream, "scene_info")["sensor"] == "demo sheet"


def test_other_machines_need_a_token(serve: Callable[..., Viewer]) -> None:
    viewer = serve(host="0.0.0.0")
    token = viewer.access.token
    assert token is not None
    assert f"?token={token}" in viewer.url
    assert get(viewer, "/")[0] == 403
    assert get(viewer, "/main.js")[0] == 403
    assert get(viewer, "/?token=wrong-word")[0] == 403
    status, headers, _ = get(viewer, f"/?token={token}")
    cookie = str(headers["set-cookie"]).split(";")[0]
    assert status == 303
    assert get(viewer, "/", Cookie=cookie)[0] == 200
    origin = f"http://127.0.0.1:{viewer.access.port}"
    with pytest.raises(InvalidStatus):
        connect_to(viewer, origin=origin)
    with connect_to(viewer, origin=origin, additional_headers={"Cookie": cookie}) as stream:
        next_message(stream, "scene_info")


def test_programs_need_the_token_of_the_file(viewer: Viewer) -> None:
    token_file = viewer.token_file
    assert token_file is not None
    for headers in ({}, {"Authorization": "Bearer wrong-word"}):
        with pytest.raises(InvalidStatus):
            connect_to(viewer, additional_headers=headers)
    url = f"ws://127.0.0.1:{viewer.access.port}/stream?token={token_file.read_text()}"
    with pytest.raises(InvalidStatus):
        connect(url)
    with connect_to(viewer) as stream:
        next_message(stream, "scene_info")
    viewer.close()
    assert not token_file.exists()


def test_more_clients_than_allowed_are_told_so(serve: Callable[..., Viewer]) -> None:
    viewer = serve(max_clients=2)
    with connect_to(viewer) as first, connect_to(viewer) as second:
        next_message(first, "scene_info")
        next_message(second, "scene_info")
        with connect_to(viewer) as third, pytest.raises(ConnectionClosed) as closed:
            next_message(third, "never")
        assert closed.value.rcvd is not None
        assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (
            1013,
            "2 clients are connected, the most allowed",
        )
        assert viewer.client_count == 2
    wait_until(lambda: viewer.client_count == 0)
    with connect_to(viewer) as again:
        next_message(again, "scene_info")


def test_a_flood_of_requests_is_coalesced(viewer: Viewer, session: FakeSession) -> None:
    with connect_to(viewer) as stream:
        for number in range(400):
            stream.send(json.dumps({"type": "method", "method": f"m{number}"}))
        for number in range(100):
            stream.send(json.dumps({"type": "press", "finger": 1, "x_mm": number, "y_mm": 0, "depth_mm": 1}))
        wait_until(lambda: Press(finger=1, x_mm=99.0, y_mm=0.0, depth_mm=1.0) in session.commands)
        wait_until(lambda: UseMethod(method="m399") in session.commands)
    assert len(session.commands) < 250


def test_what_one_client_displays_does_not_occupy_the_viewer(viewer: Viewer) -> None:
    viewer.write(reading_of(1))
    with connect_to(viewer) as flooding, connect_to(viewer) as other:
        wait_until(lambda: viewer.client_count == 2)
        before = viewer.update_count
        for number in range(1500):
            layer = ("depth", "strain")[number % 2]
            flooding.send(json.dumps({"type": "show", "layer": layer, "image": True}))
        other.send('{"type": "show", "layer": "pressure", "image": false}')
        wait_until(lambda: "pressure" in viewer.layers)
        wait_until(lambda: "strain" in viewer.layers)
    assert viewer.update_count - before < 100


def test_an_update_contains_the_reading(viewer: Viewer) -> None:
    with connect_to(viewer) as stream:
        scene_info = next_message(stream, "scene_info")
        wait_until(lambda: viewer.client_count == 1)
        reading = reading_of(3)
        viewer.write(reading)
        head, parts = next_update(stream)
    assert head["frame"] == 3
    assert head["latency_ms"] > 0
    assert parts["depth"].shape == (60, 100)
    place = np.stack(np.meshgrid(scene_info["x_mm"], scene_info["y_mm"]), axis=-1).reshape(-1, 2)
    layout = demo_sensor(320).layout
    own = sampling_at(layout, place)(-reading.surface.displacement_mm[:, 2]).reshape(60, 100)
    np.testing.assert_allclose(parts["depth"], own, atol=2e-3)
    (contact,) = head["contacts"]
    assert contact["id"] == 7
    assert contact["depth_mm"] == 2.0
    assert contact["depth_std_mm"] == pytest.approx(0.1)
    assert contact["force_N"] == 1.5
    assert contact["centre_covariance_mm2"] == [0.04, 0.0, 0.09]
    assert contact["shear_N"] == [None, None]
    assert contact["half_axes_mm"] == [5.0, 3.0]
    assert (contact["orientation_rad"], contact["shape"], contact["shape_probability"]) == (0.4, "patch", 0.9)
    for outline in (contact["outline_mm"], contact["outline_px"]):
        assert [len(ring) for ring in outline] == [24, 12]
    assert contact["outline_mm"][0][0] == [-14.0, 8.0]
    picture = cv2.imdecode(np.frombuffer(parts["image"], np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture.shape == (180, 320)
    assert abs(int(np.median(picture)) - 60) <= 1


def test_an_update_contains_the_comparison(viewer: Viewer, session: FakeSession) -> None:
    shallower = reading_of(3, 1.5)
    session.other = Comparison(name="recorded", surface=shallower.surface, contacts=shallower.contacts)
    with connect_to(viewer) as stream:
        next_message(stream, "scene_info")
        wait_until(lambda: viewer.client_count == 1)
        stream.send(json.dumps({"type": "show", "layer": "difference", "image": False}))
        wait_until(lambda: "difference" in viewer.layers)
        viewer.write(reading_of(3, 2.0))
        head, parts = next_update(stream)
        assert head["comparison"]["name"] == "recorded"
        assert head["comparison"]["contacts"][0]["depth_mm"] == 1.5
        np.testing.assert_allclose(parts["difference"], 0.25 * parts["depth"], atol=1e-6)
        session.other = Comparison(name="recorded", surface=None, contacts=shallower.contacts)
        viewer.write(reading_of(4, 2.0))
        head, parts = next_update(stream)
    assert head["comparison"]["contacts"]
    assert "difference" not in parts
    assert "difference" not in head["layers"]


def test_each_client_has_its_own_measurement(viewer: Viewer) -> None:
    point_mm = [[-20.0, 8.0], [10.0, 0.0]]
    reading = reading_of(1)
    with connect_to(viewer) as first, connect_to(viewer) as second:
        wait_until(lambda: viewer.client_count == 2)
        first.send(json.dumps({"type": "measure", "point_mm": point_mm}))
        second.send(json.dumps({"type": "measure", "point_mm": point_mm[:1]}))
        second.send(json.dumps({"type": "show", "layer": "strain", "image": False}))
        wait_until(lambda: viewer.layers == {"depth", "strain"})
        viewer.write(reading)
        two, one = next_message(first, "measurement"), next_message(second, "measurement")
        assert "strain" in next_update(second)[1]
    own = sampling_at(demo_sensor(320).layout, np.array(point_mm))(-reading.surface.displacement_mm[:, 2])
    assert [point["depth_mm"] for point in two["points"]] == pytest.approx(own, abs=1e-3)
    assert [point["depth_mm"] for point in one["points"]] == pytest.approx(own[:1], abs=1e-3)
    assert len(two["profile"]["depth_mm"]) > 50
    assert "profile" not in one


def test_requests_reach_the_session_and_invalid_messages_do_not(viewer: Viewer, session: FakeSession) -> None:
    with connect_to(viewer) as stream:
        for text in (
            '{"type": "stop"}',
            "nonsense",
            '{"type": "record", "path": "/tmp/x"}',
            '{"type": "tare"}',
        ):
            stream.send(text)
        stream.send('{"type": "record"}')
        stream.send('{"type": "press", "finger": 1, "x_mm": 2, "y_mm": 3, "depth_mm": 1.5}')
        wait_until(lambda: len(session.commands) == 4)
        assert next_message(stream, "note")["text"]
    assert session.commands == [
        Pause(),
        Tare(),
        Record(path=None),
        Press(finger=1, x_mm=2.0, y_mm=3.0, depth_mm=1.5),
    ]


def test_a_slow_client_gets_fewer_updates_never_old_ones(viewer: Viewer) -> None:
    with connect_to(viewer) as stream:
        wait_until(lambda: viewer.client_count == 1)
        for index in range(30):
            viewer.write(reading_of(index))
            time.sleep(0.02)
        heads = [next_update(stream)[0] for _ in range(MAX_IN_FLIGHT)]
        quiet_until_s = time.monotonic() + 0.6
        while time.monotonic() < quiet_until_s:
            assert isinstance(stream.recv(timeout=20), str)  # health goes on
        stream.send(json.dumps({"type": "ack", "number": heads[-1]["number"]}))
        assert next_update(stream)[0]["frame"] == 29
    assert [head["frame"] for head in heads] == sorted(head["frame"] for head in heads)


def test_without_clients_nothing_is_encoded_and_a_late_one_gets_the_last_update(viewer: Viewer) -> None:
    viewer.write(reading_of(5))
    assert viewer.update_count == 0
    with connect_to(viewer) as stream:
        assert next_update(stream)[0]["frame"] == 5
        stream.socket.shutdown(socket.SHUT_RDWR)  # as if the browser was killed
    wait_until(lambda: viewer.client_count == 0)
    before = viewer.update_count
    for index in range(6, 20):
        viewer.write(reading_of(index))
    assert viewer.update_count == before
    with connect_to(viewer) as again:
        assert next_update(again)[0]["frame"] == 19


def test_a_changed_sensor_is_announced(viewer: Viewer, session: FakeSession) -> None:
    with connect_to(viewer) as stream:
        next_message(stream, "scene_info")
        session.change_sensor(replace(session.sensor, name="tared sheet"))
        assert next_message(stream, "scene_info")["sensor"] == "tared sheet"
        assert next_message(stream, "health")["sensor_version"] == 1


def test_the_end_is_announced_and_the_port_is_free_again(serve: Callable[..., Viewer]) -> None:
    viewer = serve()
    port = viewer.access.port
    with connect_to(viewer) as stream:
        next_message(stream, "scene_info")
        viewer.close()
        assert next_message(stream, "end")
        with pytest.raises(ConnectionClosed):
            next_message(stream, "more")
    assert serve(port=port).access.port == port


def test_a_port_in_use_is_an_error_with_a_remedy(serve: Callable[..., Viewer], session: FakeSession) -> None:
    taken = serve().access.port
    with pytest.raises(OutputError, match=f"port {taken}"):
        Viewer(session, port=taken)
    with pytest.raises(OutputError, match="--host"):
        Viewer(session, host="192.0.2.1")


@pytest.mark.parametrize("path", ["/", "/main.js", "/stream"])
def test_an_invalid_host_header_is_a_bad_request(
    viewer: Viewer, caplog: pytest.LogCaptureFixture, path: str
) -> None:
    status = get(viewer, path, Host="[")[0] if path != "/stream" else handshake_status(viewer, Host="[")
    assert status == (400 if path != "/stream" else 403)
    assert len(caplog.messages) == 1
    assert "Host header" in caplog.messages[0]


def handshake_status(viewer: Viewer, **headers: str) -> int:
    upgrade = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }
    return get(viewer, "/stream", **upgrade, **headers)[0]


def test_a_token_that_is_not_ascii_is_a_bad_request(
    serve: Callable[..., Viewer], caplog: pytest.LogCaptureFixture
) -> None:
    for viewer in (serve(), serve(host="0.0.0.0")):
        caplog.clear()
        assert get(viewer, "/?token=%ff%fe")[0] == 400
        assert len(caplog.messages) == 1
        assert "token" in caplog.messages[0]


def test_binary_data_closes_the_connection(viewer: Viewer, caplog: pytest.LogCaptureFixture) -> None:
    with connect_to(viewer) as stream, connect_to(viewer) as other:
        next_message(stream, "scene_info")
        stream.send(b"\x00\xff")
        with pytest.raises(ConnectionClosed) as closed:
            next_message(stream, "never")
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1003
        assert next_message(other, "health")
    assert len(caplog.messages) == 1
    assert "binary" in caplog.messages[0]


def test_the_page_never_parses_text_as_html() -> None:
    """Names of recordings, methods and contacts come from files; `elements.js` inserts them as text."""
    parsing = re.compile(rb"innerHTML|outerHTML|insertAdjacentHTML|document\.write|createContextualFragment")
    for name, (_, content) in page_files().items():
        if name != "three.js":
            assert not parsing.search(content), name
