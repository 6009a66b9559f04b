"""A video with a timeline: frames in any order, processed from the place that is sought."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from clips import picture, write_video
from manytouch.errors import SourceError
from manytouch.session import Playback, prepare, run
from manytouch.sources import open_source
from manytouch.sources.files.frame_timeline import FrameTimeline, frame_timeline
from manytouch.values import Frame, Reading, Seek, Start, Tune

FRAMES = 20


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clips") / "rest.avi"
    write_video(path, (picture(seed=index) for index in range(FRAMES)))
    return path


@dataclass
class Counted:
    """A source that counts how many frames were decoded."""

    source: object
    decoded: int = 0

    def __getattr__(self, name: str) -> object:
        return getattr(self.source, name)

    def __iter__(self) -> Iterator[Frame]:
        for frame in self.source:
            self.decoded += 1
            yield frame


def test_frames_come_in_any_order_and_are_decoded_once_while_they_are_kept(video: Path) -> None:
    expected = list(open_source(video))
    source = Counted(open_source(video))
    timeline = FrameTimeline(source, FRAMES)
    for place in (0, 1, 7, 3, 19, 0):
        frame = timeline.frame(place)
        assert frame.index == place
        assert frame.timestamp_ns == expected[place].timestamp_ns
        np.testing.assert_array_equal(frame.image, expected[place].image)
    assert source.decoded == FRAMES


def test_what_is_not_kept_is_decoded_again(video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("manytouch.sources.files.frame_timeline.KEPT_BYTES", 1)
    source = Counted(open_source(video))
    timeline = FrameTimeline(source, FRAMES)
    last = timeline.frame(9).image
    assert timeline.frame(2).index == 2
    np.testing.assert_array_equal(timeline.frame(9).image, last)
    assert source.decoded == 10 + 3 + 7


def test_a_file_that_is_shorter_than_it_announces_ends_there(video: Path) -> None:
    timeline = FrameTimeline(open_source(video), 50)
    assert timeline.frame(30).image is None
    assert len(timeline) == FRAMES


def test_a_simulated_sensor_has_no_timeline() -> None:
    source = open_source("sim:")
    assert frame_timeline(source) is None
    with pytest.raises(SourceError, match="no timeline"):
        Playback(Path("sim:"))


class Seeking:
    """Seeks, tunes and stops at given numbers of readings."""

    def __init__(self, playback: Playback, at: dict[int, object]) -> None:
        self.playback, self.at, self.readings = playback, at, list[Reading]()

    def write(self, reading: Reading) -> None:
        self.readings.append(reading)
        if (command := self.at.get(len(self.readings))) is not None:
            self.playback.send(command)

    def close(self) -> None:
        pass


def test_a_video_is_processed_and_stays_at_its_end(video: Path) -> None:
    playback = Playback(prepare(video, fps=500.0), stays=True)
    sink = Seeking(playback, {FRAMES: Seek(frame=5)})
    run(playback, [sink], stop=lambda: len(sink.readings) >= 2 * FRAMES - 5)
    assert [reading.frame.index for reading in sink.readings] == [*range(FRAMES), *range(5, FRAMES)]
    assert all(reading.grid.is_seen.mean() > 0.9 for reading in sink.readings)
    assert playback.health().frame_count == FRAMES
    assert playback.comparison(3) is None


def test_start_at_the_end_begins_again(video: Path) -> None:
    playback = Playback(prepare(video, fps=500.0), stays=True)
    sink = Seeking(playback, {})

    def is_over() -> bool:
        if len(sink.readings) == FRAMES and not playback.health().is_running:
            playback.send(Start())
        return len(sink.readings) > FRAMES

    run(playback, [sink], stop=is_over)
    assert sink.readings[-1].frame.index == 0


def test_a_parameter_is_changed_during_the_playback(video: Path) -> None:
    playback = Playback(prepare(video, fps=500.0), stays=True)
    name = next(each for each, value in playback.health().parameters.items() if isinstance(value, float))
    value = playback.health().parameters[name]
    sink = Seeking(playback, {2: Tune(parameter=name, value=value * 1.01)})
    run(playback, [sink], stop=lambda: playback.health().parameters[name] != value)
    assert playback.health().parameters[name] == pytest.approx(value * 1.01)
