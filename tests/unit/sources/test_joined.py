"""Several sources as the views of one sheet."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from clips import picture, write_video
from manytouch.errors import SensorError, SourceError
from manytouch.session import prepare
from manytouch.session.results import result_name
from manytouch.simulation.demo_sensor import skin_sensor
from manytouch.source_names import is_camera
from manytouch.sources import open_source
from manytouch.sources.joined import JoinedSource
from manytouch.sources.source import Capabilities
from manytouch.values import Frame

PERIOD_NS = 33_333_333


class Camera:
    """A camera whose frames arrive at given times; the level of an image is the number of its frame."""

    name, fps, frame_count, width_px, height_px, is_live = "camera", 30.0, None, 4, 3, True
    capabilities = Capabilities()

    def __init__(self, arrived_ns: list[int]) -> None:
        self._arrived_ns = arrived_ns

    def __iter__(self) -> Iterator[Frame]:
        for index, arrived_ns in enumerate(self._arrived_ns):
            image = np.full((3, 4), index, dtype=np.uint8)
            yield Frame(index=index, timestamp_ns=arrived_ns, camera="c", image=image, arrived_ns=arrived_ns)


def videos(folder: Path, *, fps: tuple[float, float] = (30.0, 30.0)) -> str:
    for name, rate, frames in zip("ab", fps, (5, 4), strict=True):
        write_video(folder / f"{name}.mp4", (picture(seed=each) for each in range(frames)), fps=rate)
    return f"views:{folder / 'a.mp4'},{folder / 'b.mp4'}"


def test_files_are_joined_frame_by_frame(tmp_path: Path) -> None:
    joined = open_source(videos(tmp_path))
    left, right = (open_source(str(tmp_path / f"{name}.mp4")) for name in "ab")
    assert left.width_px is not None
    assert (joined.width_px, joined.height_px) == (2 * left.width_px, left.height_px)
    frames = list(joined)
    assert len(frames) == 4
    for frame, one, other in zip(frames, left, right, strict=False):
        assert frame.image is not None
        assert np.array_equal(frame.image[:, : left.width_px], one.image)
        assert np.array_equal(frame.image[:, left.width_px :], other.image)
    assert [path.name for path in joined.capabilities.files] == ["a.mp4", "b.mp4"]
    assert result_name(videos(tmp_path)) == "a-b"


def test_frames_of_cameras_are_joined_with_those_of_the_same_time() -> None:
    times = [number * PERIOD_NS for number in range(10)]
    late = [time_ns + PERIOD_NS // 5 for number, time_ns in enumerate(times) if number not in {0, 4, 5}]
    joined = JoinedSource([Camera(times), Camera(late)])
    found = [frame.image for frame in joined]
    left, right = [int(image[0, 0]) for image in found], [int(image[0, -1]) for image in found]
    assert left == [1, 2, 3, 6, 7, 8, 9]
    assert right == list(range(7))


def test_slow_streams_of_unknown_rate_are_joined_by_the_rate_that_is_measured_or_given(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Camera, "fps", None)
    times = [number * 3 * PERIOD_NS for number in range(6)]
    late = [time_ns + PERIOD_NS for time_ns in times]
    assert len(list(JoinedSource([Camera(times), Camera(late)]))) == 5
    assert len(list(JoinedSource([Camera(times), Camera(late)], fps=10.0))) == 6


def test_recorded_are_all_joined_frames_of_cameras() -> None:
    times = [number * PERIOD_NS for number in range(5)]
    joined, taken = JoinedSource([Camera(times), Camera(times)]), []
    joined.listen(taken.append)
    assert taken == list(joined)[: len(taken)]
    assert len(taken) == 5


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("views:{a}", "two sources or more"),
        ("views:{a},gone.mp4", "There is no"),
        ("views:{a},", "is empty"),
    ],
)
def test_views_that_cannot_be_meant_are_refused(tmp_path: Path, text: str, words: str) -> None:
    videos(tmp_path)
    with pytest.raises(SourceError, match=words):
        open_source(text.format(a=tmp_path / "a.mp4"))


def test_views_of_different_rates_are_refused_until_one_is_given(tmp_path: Path) -> None:
    text = videos(tmp_path, fps=(30.0, 25.0))
    with pytest.raises(SourceError, match=r"different frame rates \(a 30, b 25\)"):
        open_source(text)
    assert open_source(text, fps=10.0).fps == 10.0


def test_views_need_a_sensor_file_that_states_where_they_are(tmp_path: Path) -> None:
    text = videos(tmp_path)
    with pytest.raises(SensorError, match=r"needs a sensor file with \[\[views\]\]"):
        prepare(text)
    with pytest.raises(SensorError, match="images of"):
        prepare(text, sensor=skin_sensor(640))
    three = text + "," + text.rpartition(",")[2]
    with pytest.raises(SensorError, match="3 views, but the sensor 'skin' has 2"):
        prepare(three, sensor=skin_sensor(640))
    assert is_camera("views:a.mp4,rtsp://host/b")
    assert not is_camera("views:a.mp4,b.mp4")
