"""The viewer from a browser's side, without a browser: files, stream, wishes, and who is refused."""

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
from manytouch.sinks.viewer import Viewer
from manytouch.sinks.viewer.hub import MOST_IN_FLIGHT
from manytouch.sinks.viewer.messages import unpack
from manytouch.sinks.viewer.server import page_files
from manytouch.values import Comparison, Press, Record, Stop, Tare
from watched import Desk, reading_of


def asked(viewer: Viewer, path: str, **headers: str) -> tuple[int, http.client.HTTPMessage, bytes]:
    connection = http.client.HTTPConnection(viewer.access.host, viewer.access.port, timeout=20)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, answer.headers, content


def looking(viewer: Viewer, **more: Any) -> ClientConnection:
    return connect(f"ws://127.0.0.1:{viewer.access.port}/stream", max_size=2**24, open_timeout=20, **more)


def hear(stream: ClientConnection, kind: str) -> dict[str, Any]:
    """The next sentence of a kind."""
    while True:
        message = stream.recv(timeout=20)
        if isinstance(message, str) and (sentence := json.loads(message))["kind"] == kind:
            return sentence


def see(stream: ClientConnection) -> tuple[dict[str, Any], dict[str, Any]]:
    """The next update."""
    while True:
        message = stream.recv(timeout=20)
        if isinstance(message, bytes):
            return unpack(message)


def until(condition: Callable[[], bool]) -> None:
    for _ in range(1000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("it did not happen within 10 s")


def test_the_page_and_all_it_needs_are_served_from_here(viewer: Viewer) -> None:
    status, headers, page = asked(viewer, "/")
    assert status == 200
    assert "default-src 'none'" in str(headers["content-security-policy"])
    wanted = re.findall(rb'(?:href|src)="([^"]+)"', page)
    assert len(wanted) >= 3
    for name, (_, content) in page_files().items():
        assert asked(viewer, f"/{name}")[2] == content
        if name.endswith(".js") and name != "three.js":
            wanted += re.findall(rb'from "\./([^"]+)"', content)
    assert {name.decode() for name in wanted} <= set(page_files())


@pytest.mark.parametrize(
    "path",
    ["/nothing", "/../server.py", "/%2e%2e/server.py", "/..%2fserver.py", "/page/main.js", "/stream"],
)
def test_nothing_else_is_served(viewer: Viewer, path: str) -> None:
    assert asked(viewer, path)[0] == 404


def test_other_sites_cannot_use_it(viewer: Viewer) -> None:
    assert asked(viewer, "/", Host="evil.example")[0] == 421
    with pytest.raises(InvalidStatus):
        looking(viewer, origin="http://evil.example")
    with looking(viewer, origin=f"http://127.0.0.1:{viewer.access.port}") as stream:
        assert hear(stream, "scenery")["sensor"] == "demo sheet"


def test_from_elsewhere_it_takes_a_token(serve: Callable[..., Viewer]) -> None:
    viewer = serve(host="0.0.0.0")
    token = viewer.access.token
    assert token is not None
    assert f"?token={token}" in viewer.url
    assert asked(viewer, "/")[0] == 403
    assert asked(viewer, "/main.js")[0] == 403
    assert asked(viewer, "/?token=wrong-word")[0] == 403
    status, headers, _ = asked(viewer, f"/?token={token}")
    cookie = str(headers["set-cookie"]).split(";")[0]
    assert status == 303
    assert asked(viewer, "/", Cookie=cookie)[0] == 200
    with pytest.raises(InvalidStatus):
        looking(viewer)
    with looking(viewer, additional_headers={"Cookie": cookie}) as stream:
        hear(stream, "scenery")


def test_an_update_shows_what_was_read(viewer: Viewer) -> None:
    with looking(viewer) as stream:
        scenery = hear(stream, "scenery")
        until(lambda: viewer.browsers == 1)
        reading = reading_of(3)
        viewer.write(reading)
        head, parts = see(stream)
    assert head["frame"] == 3
    assert head["latency_ms"] > 0
    assert parts["depth"].shape == (60, 100)
    place = np.stack(np.meshgrid(scenery["x_mm"], scenery["y_mm"]), axis=-1).reshape(-1, 2)
    layout = reading_layout(viewer)
    own = sampling_at(layout, place)(-reading.surface.displacement_mm[:, 2]).reshape(60, 100)
    np.testing.assert_allclose(parts["depth"], own, atol=2e-3)
    (contact,) = head["contacts"]
    assert contact["id"] == 7
    assert contact["depth_mm"] == 2.0
    assert contact["depth_std_mm"] == pytest.approx(0.1)
    assert contact["force_N"] == 1.5
    assert contact["place_mm2"] == [0.04, 0.0, 0.09]
    assert contact["shear_N"] == [None, None]
    picture = cv2.imdecode(np.frombuffer(parts["image"], np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture.shape == (180, 320)
    assert abs(int(np.median(picture)) - 60) <= 1


def reading_layout(viewer: Viewer) -> Any:
    return viewer._photographer.layout


def test_what_an_estimate_is_compared_with_goes_along(viewer: Viewer, desk: Desk) -> None:
    shallower = reading_of(3, 1.5)
    desk.other = Comparison(name="recorded", surface=shallower.surface, contacts=shallower.contacts)
    with looking(viewer) as stream:
        hear(stream, "scenery")
        until(lambda: viewer.browsers == 1)
        stream.send(json.dumps({"wish": "show", "layer": "difference", "image": False}))
        until(lambda: "difference" in viewer._hub.layers)
        viewer.write(reading_of(3, 2.0))
        head, parts = see(stream)
        assert head["beside"]["name"] == "recorded"
        assert head["beside"]["contacts"][0]["depth_mm"] == 1.5
        np.testing.assert_allclose(parts["difference"], 0.25 * parts["depth"], atol=1e-6)
        desk.other = Comparison(name="recorded", surface=None, contacts=shallower.contacts)
        viewer.write(reading_of(4, 2.0))
        head, parts = see(stream)
    assert head["beside"]["contacts"]
    assert "difference" not in parts
    assert "difference" not in head["layers"]


def test_each_browser_measures_for_itself(viewer: Viewer) -> None:
    point_mm = [[-20.0, 8.0], [10.0, 0.0]]
    reading = reading_of(1)
    with looking(viewer) as first, looking(viewer) as second:
        until(lambda: viewer.browsers == 2)
        first.send(json.dumps({"wish": "measure", "point_mm": point_mm}))
        second.send(json.dumps({"wish": "measure", "point_mm": point_mm[:1]}))
        second.send(json.dumps({"wish": "show", "layer": "strain", "image": False}))
        until(lambda: viewer._hub.layers == {"depth", "strain"})
        viewer.write(reading)
        two, one = hear(first, "measure"), hear(second, "measure")
        assert "strain" in see(second)[1]
    own = sampling_at(reading_layout(viewer), np.array(point_mm))(-reading.surface.displacement_mm[:, 2])
    assert [point["depth_mm"] for point in two["points"]] == pytest.approx(own, abs=1e-3)
    assert [point["depth_mm"] for point in one["points"]] == pytest.approx(own[:1], abs=1e-3)
    assert len(two["profile"]["depth_mm"]) > 50
    assert "profile" not in one


def test_orders_reach_the_session_and_nonsense_does_no_harm(viewer: Viewer, desk: Desk) -> None:
    with looking(viewer) as stream:
        for text in (
            '{"wish": "stop"}',
            "nonsense",
            '{"wish": "record", "path": "/tmp/x"}',
            '{"wish": "tare"}',
        ):
            stream.send(text)
        stream.send('{"wish": "record"}')
        stream.send('{"wish": "press", "finger": 1, "x_mm": 2, "y_mm": 3, "depth_mm": 1.5}')
        until(lambda: len(desk.commands) == 4)
        assert hear(stream, "note")["text"]
    assert desk.commands == [
        Stop(),
        Tare(),
        Record(path=None),
        Press(finger=1, x_mm=2.0, y_mm=3.0, depth_mm=1.5),
    ]


def test_a_slow_browser_gets_fewer_updates_never_old_ones(viewer: Viewer) -> None:
    with looking(viewer) as stream:
        until(lambda: viewer.browsers == 1)
        for index in range(30):
            viewer.write(reading_of(index))
            time.sleep(0.02)
        heads = [see(stream)[0] for _ in range(MOST_IN_FLIGHT)]
        quiet_until_s = time.monotonic() + 0.6
        while time.monotonic() < quiet_until_s:
            assert isinstance(stream.recv(timeout=20), str)  # health goes on
        stream.send(json.dumps({"wish": "taken", "number": heads[-1]["number"]}))
        assert see(stream)[0]["frame"] == 29
    assert [head["frame"] for head in heads] == sorted(head["frame"] for head in heads)


def test_who_goes_costs_nothing_and_who_comes_late_sees_the_last(viewer: Viewer) -> None:
    viewer.write(reading_of(5))
    assert viewer._number == 0
    with looking(viewer) as stream:
        assert see(stream)[0]["frame"] == 5
        stream.socket.shutdown(socket.SHUT_RDWR)  # as when the browser is killed
    until(lambda: viewer.browsers == 0)
    before = viewer._number
    for index in range(6, 20):
        viewer.write(reading_of(index))
    assert viewer._number == before
    with looking(viewer) as again:
        assert see(again)[0]["frame"] == 19


def test_another_sensor_is_told_before_its_readings_are_shown(viewer: Viewer, desk: Desk) -> None:
    with looking(viewer) as stream:
        hear(stream, "scenery")
        desk.change_sensor(replace(desk.sensor, name="tared sheet"))
        assert hear(stream, "scenery")["sensor"] == "tared sheet"
        assert hear(stream, "health")["sensor_version"] == 1


def test_the_end_is_told_and_the_port_is_free_again(serve: Callable[..., Viewer]) -> None:
    viewer = serve()
    port = viewer.access.port
    with looking(viewer) as stream:
        hear(stream, "scenery")
        viewer.close()
        assert hear(stream, "end")
        with pytest.raises(ConnectionClosed):
            hear(stream, "more")
    assert serve(port=port).access.port == port


def test_a_port_that_is_taken_is_said(serve: Callable[..., Viewer], desk: Desk) -> None:
    taken = serve().access.port
    with pytest.raises(OutputError, match=f"port {taken}"):
        Viewer(desk, port=taken)
    with pytest.raises(OutputError, match="--host"):
        Viewer(desk, host="192.0.2.1")
