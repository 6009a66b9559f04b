"""Cameras: settings in the right order, read back, frames copied, disconnected and connected again."""

import base64
import contextlib
import http.server
import re
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from cameras import MJPG, Driver, jpeg, number_of, numbered
from manytouch.errors import SourceError
from manytouch.sources import open_source
from manytouch.sources.cameras import camera as camera_module
from manytouch.sources.cameras import stream as stream_module
from manytouch.sources.cameras.camera import ArrivalClock, CameraSource
from manytouch.sources.cameras.capture import CameraRequest, CapturedImage, backends, open_camera
from manytouch.sources.cameras.refusal import refusal_of, unreachable
from manytouch.sources.source import Source
from manytouch.values import Frame

BENCHMARKS = Path(__file__).parents[4] / "benchmarks"
sys.path.append(str(BENCHMARKS))
ALL = CameraRequest(
    size_px=(1280, 720), fps=25.0, exposure_ms=8.0, gain=3.0, focus=40.0, white_balance_K=4500.0
)
SYSTEMS = {"linux": cv2.CAP_V4L2, "win32": cv2.CAP_DSHOW, "darwin": cv2.CAP_AVFOUNDATION}


def opened(platform: str, request: CameraRequest, **driver: object) -> tuple[Driver, object]:
    made: list[Driver] = []

    def open_with(number: int | str, api: int) -> Driver:
        made.append(Driver(api, **driver))  # type: ignore[arg-type]
        return made[-1]

    capture = open_camera(0, request, open_with, platform)  # type: ignore[arg-type]
    assert capture is not None
    return made[-1], capture


def reported(capture: object) -> dict[str, tuple[str | None, str | None]]:
    return {setting.name: (setting.requested, setting.found) for setting in capture.settings}  # type: ignore[attr-defined]


@pytest.mark.parametrize("platform", SYSTEMS)
def test_every_system_sets_and_reports_size_and_rate(platform: str) -> None:
    driver, capture = opened(platform, ALL)
    assert driver.api == SYSTEMS[platform]
    assert reported(capture)["size"] == ("1280 x 720 px", "1280 x 720 px")
    assert reported(capture)["rate"] == ("25 per second", "25 per second")


@pytest.mark.parametrize("platform", ["linux", "win32"])
def test_motion_jpeg_survives_what_else_is_set(platform: str) -> None:
    driver, capture = opened(platform, ALL)
    assert driver.values[cv2.CAP_PROP_FOURCC] == MJPG
    assert reported(capture)["format"] == ("MJPG", "MJPG")


def test_amounts_reach_each_driver_in_its_unit() -> None:
    linux, capture = opened("linux", ALL)
    assert linux.values[cv2.CAP_PROP_EXPOSURE] == 80.0
    assert linux.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 1.0
    assert linux.values[cv2.CAP_PROP_AUTOFOCUS] == 0.0
    assert linux.values[cv2.CAP_PROP_WB_TEMPERATURE] == 4500.0
    assert reported(capture)["exposure"] == ("8 ms", "8 ms")
    assert reported(capture)["focus"] == ("40", "40")
    windows, capture = opened("win32", ALL)
    assert windows.values[cv2.CAP_PROP_EXPOSURE] == -6.0  # log2(0.008) cut by the driver
    assert reported(capture)["exposure"] == ("8 ms", "15.62 ms"), "what the camera reports is shown"


def test_automatic_is_switched_on_where_it_is_requested() -> None:
    driver, _ = opened("linux", CameraRequest(exposure_ms="auto", focus="auto", white_balance_K="auto"))
    assert driver.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 3.0
    assert driver.values[cv2.CAP_PROP_AUTOFOCUS] == 1.0
    assert driver.values[cv2.CAP_PROP_AUTO_WB] == 1.0
    assert cv2.CAP_PROP_EXPOSURE not in driver.values


def test_nothing_is_set_that_was_not_requested() -> None:
    driver, _ = opened("linux", CameraRequest(is_mjpg=False))
    assert driver.calls == []


def test_what_a_system_does_not_offer_is_not_known() -> None:
    driver, capture = opened("darwin", ALL)
    assert reported(capture)["exposure"] == ("8 ms", None)
    assert {prop for prop, _ in driver.calls} == {
        cv2.CAP_PROP_FRAME_WIDTH,
        cv2.CAP_PROP_FRAME_HEIGHT,
        cv2.CAP_PROP_FPS,
    }


def test_the_next_driver_is_tried_where_the_first_does_not_open() -> None:
    def open_with(number: int | str, api: int) -> Driver:
        return Driver(api, gone=lambda: api == cv2.CAP_DSHOW)

    capture = open_camera(0, ALL, open_with, "win32")  # type: ignore[arg-type]
    assert reported(capture)["driver"] == (None, "Media Foundation")
    assert [backend.name for backend in backends("linux")] == ["V4L2"]


@pytest.mark.parametrize("platform", SYSTEMS)
def test_pictures_are_copies_of_the_drivers_buffer(platform: str) -> None:
    _, capture = opened(platform, CameraRequest(size_px=(320, 240)))
    shots = [capture.read() for _ in range(3)]  # type: ignore[attr-defined]
    for number, shot in enumerate(shots):
        image = (
            shot.image if shot.image is not None else cv2.imdecode(np.frombuffer(shot.encoded, np.uint8), 0)
        )
        assert abs(number_of(image) - number) <= 1
    is_jpeg = platform == "linux"
    assert all((shot.encoded is not None) == is_jpeg for shot in shots)
    if is_jpeg:
        assert all(shot.encoded.endswith(b"\xff\xd9") for shot in shots), "what follows the end is cut off"


def test_a_camera_without_jpeg_gives_pictures_instead() -> None:
    _, capture = opened("linux", CameraRequest(size_px=(320, 240)), has_jpeg=False)
    assert capture.read() is None  # type: ignore[attr-defined]
    shot = capture.read()  # type: ignore[attr-defined]
    assert shot.encoded is None
    assert shot.image.shape == (240, 320, 3)
    assert reported(capture)["format"] == ("MJPG", "YUYV")


class Plugged:
    """A camera that can be pulled out."""

    def __init__(self, width: int = 320) -> None:
        self.is_out = False
        self.width = width
        self.drivers: list[Driver] = []

    def __call__(self) -> object:
        def open_with(number: int | str, api: int) -> Driver:
            first = self.drivers[-1].number + 1 if self.drivers else 0
            self.drivers.append(Paced(api, period_ms=10.0, gone=lambda: self.is_out))
            self.drivers[-1].number = first - 1
            return self.drivers[-1]

        return open_camera(0, CameraRequest(size_px=(self.width, 240)), open_with, "linux")  # type: ignore[arg-type]


class Paced(Driver):
    """A driver that takes its time for each picture."""

    def grab(self) -> bool:
        time.sleep(0.01)
        return super().grab()


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_module, "RETRY_S", 0.02)


def taken(source: CameraSource, frames: Iterator[Frame], count: int) -> list[Frame]:
    found = list(islice(frames, count))
    assert len(found) == count
    return found


def test_a_camera_that_is_pulled_out_is_tried_until_it_is_back(quick: None) -> None:
    plugged = Plugged()
    source = CameraSource("0", plugged)
    assert isinstance(source, Source)
    assert source.capabilities.device is source
    frames = iter(source)
    before = taken(source, frames, 10)
    plugged.is_out = True
    deadline = time.monotonic() + 5
    while source.status == "ok" and time.monotonic() < deadline:
        time.sleep(0.005)
    assert "no image from camera-0" in source.status
    time.sleep(0.3)
    plugged.is_out = False
    after = taken(source, frames, 13)
    assert source.status == "ok"
    source.close()
    indices = [frame.index for frame in before + after]
    assert indices == list(range(23)), "no number is missing"
    times_ns = [frame.timestamp_ns for frame in before + after]
    steps_ns = np.diff(times_ns)
    assert (steps_ns > 0).all()
    assert (steps_ns > 250_000_000).sum() == 1, "the gap shows in time"
    assert all(driver.is_released for driver in plugged.drivers)


def test_a_camera_that_comes_back_with_another_size_is_not_taken_for_the_same(quick: None) -> None:
    plugged = Plugged()
    source = CameraSource("0", plugged)
    frames = iter(source)
    taken(source, frames, 3)
    plugged.is_out, plugged.width = True, 640
    time.sleep(0.2)
    plugged.is_out = False
    deadline = time.monotonic() + 5
    while "640 x 240" not in source.status and time.monotonic() < deadline:
        time.sleep(0.005)
    assert "expected 320 x 240 px, found 640 x 240 px" in source.status
    plugged.width = 320
    taken(source, frames, 3)
    assert source.status == "ok"
    source.close()


def test_a_camera_that_is_not_there_or_dark_is_one_sentence() -> None:
    with pytest.raises(SourceError, match="does not open"):
        CameraSource("0", lambda: None)

    class Blind:
        settings = ()

        def read(self) -> None:
            return None

        def release(self) -> None:
            pass

    with pytest.raises(SourceError, match="gives no image"):
        CameraSource("0", Blind)


def test_the_first_image_that_can_be_decoded_opens_a_camera() -> None:
    whole = jpeg(numbered(7))
    shots = iter([whole[: len(whole) // 2], b"", whole, whole])

    class Beginning:
        settings = ()

        def read(self) -> CapturedImage | None:
            encoded = next(shots)
            return CapturedImage(image=None, encoded=encoded, driver_ns=None) if encoded else None

        def release(self) -> None:
            pass

    source = CameraSource("0", Beginning)
    assert (source.width_px, source.height_px) == (320, 240)
    source.close()


def test_frames_that_nobody_takes_make_room_for_newer_ones_but_reach_the_tap() -> None:
    plugged = Plugged()
    source = CameraSource("0", plugged)
    tapped: list[int] = []
    source.listen(lambda frame: tapped.append(frame.index))
    frames = iter(source)
    first = next(frames)
    time.sleep(0.4)
    second = next(frames)
    source.close()
    assert first.index == 0
    assert second.index > 10
    assert tapped[: second.index + 1] == list(range(second.index + 1))
    assert list(frames) == []


def test_a_closed_source_ends_an_iteration_that_waits() -> None:
    plugged = Plugged()
    source = CameraSource("0", plugged)
    frames = iter(source)
    next(frames)
    plugged.is_out = True
    source.close()
    assert list(frames) == []  # it would wait for the camera without end


MS = 1_000_000


def test_the_drivers_time_counts_while_it_makes_sense() -> None:
    clock = ArrivalClock()
    jitter = [0, 7, 2, 11, 3]
    found = [clock.at(900_000 * MS + 40 * MS * i, 40 * MS * i + jitter[i] * MS) for i in range(5)]
    assert found == [40 * MS * i for i in range(5)]


def test_this_machines_time_counts_where_the_driver_has_none() -> None:
    clock = ArrivalClock()
    assert [clock.at(None, 1000 + 40 * i) for i in range(3)] == [0, 40, 80]


def test_a_drivers_clock_that_jumps_is_synchronised_again() -> None:
    clock = ArrivalClock()
    driver_ns = [0, 40, 80, 500_000, 500_040]  # ms
    found = [clock.at(each * MS, 40 * MS * i) for i, each in enumerate(driver_ns)]
    assert found == [40 * MS * i for i in range(5)]


def test_timestamps_grow_whatever_the_driver_reports() -> None:
    clock = ArrivalClock()
    found = [clock.at(each * MS, 40 * MS * i) for i, each in enumerate([100, 100, 60, 220])]
    assert found == sorted(set(found))


@pytest.mark.skipif(not BENCHMARKS.is_dir(), reason="the benchmarks are not part of a wheel")
class TestStream:
    """Motion JPEG over HTTP on loopback."""

    def test_full_size_at_thirty_a_second_arrives_whole(self) -> None:
        from mjpeg_server import MjpegServer

        texture = np.random.default_rng(0).integers(0, 60, (360, 640), dtype=np.uint8)
        grain = cv2.resize(texture, (2560, 1440), interpolation=cv2.INTER_NEAREST) // 4
        pictures = [jpeg(numbered(10 * i, 2560, 1440) - grain, 90) for i in range(15)]
        with MjpegServer(pictures, fps=30.0) as server:
            source = open_source(server.url)
            assert (source.width_px, source.height_px, source.is_live) == (2560, 1440, True)
            arrived: list[Frame] = []
            source.listen(arrived.append)
            frames = taken(source, iter(source), 40)
            source.close()
        assert [frame.index for frame in arrived] == list(range(len(arrived)))
        for frame in arrived:
            assert frame.encoded == pictures[(frame.index + 1) % 15], "every byte as it was sent"
        assert all(frame.image.dtype == np.uint8 and frame.image.ndim == 2 for frame in frames)
        span_s = (arrived[-1].timestamp_ns - arrived[0].timestamp_ns) * 1e-9
        assert (len(arrived) - 1) / span_s == pytest.approx(30.0, rel=0.1)

    @pytest.mark.parametrize("with_length", [True, False])
    def test_with_and_without_lengths(self, with_length: bool) -> None:
        from mjpeg_server import MjpegServer

        pictures = [jpeg(numbered(20 * i)) for i in range(6)]
        with MjpegServer(pictures, fps=100.0, sends_length=with_length) as server:
            source = open_source(server.url)
            arrived: list[Frame] = []
            source.listen(arrived.append)
            frames = taken(source, iter(source), 12)
            source.close()
        for frame in arrived:
            assert frame.encoded.rstrip(b"\r\n") == pictures[(frame.index + 1) % 6]
        for frame in frames:
            assert abs(number_of(frame.image) - 20 * ((frame.index + 1) % 6)) <= 1

    def test_colour_when_it_is_requested(self) -> None:
        from mjpeg_server import MjpegServer

        with MjpegServer([jpeg(np.full((48, 64, 3), (200, 40, 90), np.uint8))], fps=100.0) as server:
            source = open_source(server.url)
            source.is_colour = True
            frame = next(iter(source))
            source.close()
        np.testing.assert_allclose(frame.image.reshape(-1, 3).mean(axis=0), [200, 40, 90], atol=2)

    def test_the_servers_time_is_the_timestamp(self) -> None:
        from mjpeg_server import MjpegServer

        with MjpegServer([jpeg(numbered(0))], fps=50.0, sends_time=True) as server:
            source = open_source(server.url)
            frames = taken(source, iter(source), 20)
            source.close()
        lag_ns = np.array([frame.arrived_ns - frame.timestamp_ns for frame in frames])
        assert np.ptp(lag_ns) > 1000, "arrival jitters, the server's time does not follow it"
        assert np.ptp(lag_ns) < 500 * MS

    def test_a_stream_that_breaks_off_is_taken_up_again(self, quick: None) -> None:
        from mjpeg_server import MjpegServer

        with MjpegServer([jpeg(numbered(0))], fps=100.0) as server:
            source = open_source(server.url)
            frames = iter(source)
            taken(source, frames, 10)
            server.unplug()
            deadline = time.monotonic() + 5
            while source.status == "ok" and time.monotonic() < deadline:
                time.sleep(0.005)
            assert "no image from stream-127.0.0.1" in source.status
            server.plug_in()
            after = taken(source, frames, 10)
            source.close()
        assert after[-1].index - after[0].index <= 12

    def test_a_page_is_no_stream(self) -> None:
        class Page(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/html")
                self.end_headers()
                self.wfile.write(b"<html>no camera here</html>")

            def log_message(self, *args: object) -> None:
                pass

        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
            thread = threading.Thread(target=server.serve_forever)
            thread.start()
            try:
                with pytest.raises(SourceError, match="does not open"):
                    open_source(f"http://127.0.0.1:{server.server_port}/")
            finally:
                server.shutdown()
                thread.join()


@pytest.mark.parametrize(
    ("path", "refusal"),
    [("none", "HTTP status 404 Not Found"), ("private", "HTTP status 401 Unauthorized"), ("page", "")],
)
def test_the_status_with_which_a_server_refuses_an_address_is_stated(path: str, refusal: str) -> None:
    class Page(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response({"none": 404, "private": 401}.get(self.path.strip("/"), 200))
            self.end_headers()

        def log_message(self, *args: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/{path}"
        assert refusal_of(address) == refusal
        reason = rf" \({refusal}\)" if refusal else ""
        with pytest.raises(SourceError, match=rf"does not open{reason}: check the address"):
            open_source(address)
        server.shutdown()
    assert refusal_of(address) == "", "nothing answers"
    assert refusal_of("rtsp://127.0.0.1/x") == ""


Answer = Callable[[http.server.BaseHTTPRequestHandler], None]


@contextmanager
def web_camera(answer: Answer) -> Iterator[str]:
    """The address, without "http://", of a server that answers each request with a function."""

    class Camera(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            with contextlib.suppress(OSError):
                answer(self)

        def log_message(self, *args: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Camera) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"127.0.0.1:{server.server_port}"
        server.shutdown()


def answered(handler: http.server.BaseHTTPRequestHandler, status: int = 200, **headers: str) -> None:
    handler.send_response(status)
    for name, value in headers.items():
        handler.send_header(name.replace("_", "-"), value)
    handler.end_headers()


def begun(handler: http.server.BaseHTTPRequestHandler) -> None:
    answered(handler, Content_Type="multipart/x-mixed-replace; boundary=x")


def sent(handler: http.server.BaseHTTPRequestHandler, encoded: bytes, header: str = "") -> None:
    head = f"--x\r\nContent-Length: {len(encoded)}\r\n{header}\r\n"
    handler.wfile.write(head.encode() + encoded + b"\r\n")


@pytest.mark.parametrize("scheme", ["Basic", "Digest"])
def test_user_and_password_of_the_address_open_a_stream(scheme: str) -> None:
    given: list[str] = []

    def answer(handler: http.server.BaseHTTPRequestHandler) -> None:
        authorization = handler.headers.get("Authorization", "")
        if not authorization.startswith(scheme):
            answered(handler, 401, WWW_Authenticate=f'{scheme} realm="cam", nonce="ab", qop="auth"')
        elif handler.path == "/":
            answered(handler, 302, Location="/video")
        else:
            given.append(authorization)
            begun(handler)
            for number in range(20):
                sent(handler, jpeg(numbered(number)))

    with web_camera(answer) as address:
        source = open_source(f"http://me:se%2Fcret@{address}/")
        source.close()
        with pytest.raises(SourceError, match=r"does not open \(HTTP status 401 Unauthorized\)"):
            open_source(f"http://{address}/")
    (authorization,) = given
    if scheme == "Basic":
        assert base64.b64decode(authorization.removeprefix("Basic ")) == b"me:se/cret"
    else:
        assert 'username="me"' in authorization


@pytest.mark.parametrize("scheme", ["Basic", "Digest"])
def test_another_host_gets_no_password(scheme: str) -> None:
    given: dict[str, list[str]] = {"camera": [], "other": []}

    def required(handler: http.server.BaseHTTPRequestHandler, name: str) -> bool:
        given[name].append(handler.headers.get("Authorization", ""))
        if given[name][-1]:
            return True
        answered(handler, 401, WWW_Authenticate=f'{scheme} realm="cam", nonce="ab", qop="auth"')
        return False

    with web_camera(lambda handler: required(handler, "other") and begun(handler)) as other:

        def redirected(handler: http.server.BaseHTTPRequestHandler) -> None:
            if required(handler, "camera"):
                answered(handler, 302, Location=f"http://{other}/video")

        with web_camera(redirected) as address, pytest.raises(SourceError, match="does not open"):
            open_source(f"http://me:secret@{address}/")
    assert any(given["camera"])
    assert given["other"]
    assert not any(given["other"])


@pytest.mark.parametrize("header", ["12:30:01", "1e305", "nan", "-5", "9" * 5000])
def test_a_time_of_the_server_that_is_none_costs_no_image(header: str) -> None:
    def answer(handler: http.server.BaseHTTPRequestHandler) -> None:
        begun(handler)
        for number in range(100):
            sent(handler, jpeg(numbered(number)), f"X-Timestamp: {header}\r\n" if number else "")
            time.sleep(0.01)

    with web_camera(answer) as address:
        source = open_source(f"http://{address}/")
        frames = taken(source, iter(source), 10)
        source.close()
    times_ns = [frame.timestamp_ns for frame in frames]
    assert times_ns == sorted(set(times_ns))
    assert times_ns[-1] < 10 * 10**9


def _never_an_end(handler: http.server.BaseHTTPRequestHandler, data: bytes, pause_s: float) -> None:
    begun(handler)
    while True:
        handler.wfile.write(data)
        time.sleep(pause_s)


@pytest.mark.parametrize(
    ("data", "pause_s"),
    [(b"--y\r\n\r\n" + bytes(2000), 0.001), (bytes(2**16), 0.0), (b"X-A: b\r\n", 0.01)],
    ids=["another boundary", "no boundary", "headers without end"],
)
def test_a_stream_without_an_image_ends_after_some_seconds(
    data: bytes, pause_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream_module, "IMAGE_S", 0.3)
    with (
        web_camera(lambda handler: _never_an_end(handler, data, pause_s)) as address,
        pytest.raises(SourceError, match="opens but gives no image that can be decoded"),
    ):
        open_source(f"http://{address}/")


def test_what_a_server_says_is_not_printed() -> None:
    def answer(handler: http.server.BaseHTTPRequestHandler) -> None:
        if handler.path == "/status":
            handler.wfile.write(b"HTTP/1.0 404 \x1b[2Jgone " + b"x" * 1000 + b"\r\n\r\n")
        elif handler.path == "/loop":
            answered(handler, 302, Location="/loop")
        else:
            answered(
                handler, 200, Content_Type="text/html\x1b[2J" if handler.path == "/type" else "text/html"
            )

    with web_camera(answer) as address:
        assert refusal_of(f"http://{address}/status") == "HTTP status 404 Not Found"
        assert refusal_of(f"http://{address}/loop") == "HTTP status 302 Found"
        assert refusal_of(f"http://{address}/type") == ""
        assert refusal_of(f"http://{address}/page") == "the answer is of the type text/html"
        with pytest.raises(SourceError, match=r"does not open \(the answer is of the type text/html\)"):
            open_source(f"http://{address}/page")


@pytest.mark.parametrize(
    ("answer", "user", "refusal"),
    [
        ("RTSP/1.0 404 Not Found", "", "RTSP status 404 Not Found"),
        ("RTSP/1.0 401 \x1b[2J", "", "RTSP status 401 Unauthorized"),
        (
            "RTSP/1.0 401 Unauthorized",
            "me:secret@",
            "the server requires user and password: these or the path",
        ),
        ("RTSP/1.0 454 Session", "", "RTSP status 454"),
        ("RTSP/1.0 200 OK", "", ""),
        ("SSH-2.0-x", "", ""),
        ("", "", ""),
    ],
)
def test_the_status_of_a_server_of_rtsp_is_stated(answer: str, user: str, refusal: str) -> None:
    asked: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            client, _ = server.accept()
            with client:
                asked.append(client.recv(4096))
                client.sendall(answer.encode() + b"\r\nCSeq: 1\r\n\r\n" if answer else b"")

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        found = refusal_of(f"rtsp://{user}127.0.0.1:{server.getsockname()[1]}/cam?x=1")
        thread.join()
    assert found.startswith(refusal)
    assert bool(found) == bool(refusal)
    assert re.match(rb"DESCRIBE rtsp://127.0.0.1:\d+/cam\?x=1 RTSP/1.0\r\n", asked[0])


def test_why_no_server_answers_is_stated() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert unreachable(f"rtsp://127.0.0.1:{port}/x") == ""
    for scheme in ("rtsp", "http", "https", "rtmp"):
        assert unreachable(f"{scheme}://me:secret@127.0.0.1:{port}/x") == (
            f"no server answers at port {port} of 127.0.0.1: Connection refused"
        )
    assert unreachable("rtsp://no-such-host.invalid/x") == "the host no-such-host.invalid is not known"
    for text in ("rtsp://me:se/cret@127.0.0.1/x", "http://127.0.0.1:99999/x", "rtsp://[::1/x", "http://"):
        found = unreachable(text)
        assert "se/cret" not in found
        assert "%2F" in found
    assert unreachable("udp://127.0.0.1:5000") == ""
    with pytest.raises(SourceError, match=f"does not open \\(no server answers at port {port} of"):
        open_source(f"rtsp://127.0.0.1:{port}/x")
