"""A video with a timeline: frames in any order, processed from the place that is sought."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from clips import picture, pressed_video, write_video
from manytouch.errors import SourceError
from manytouch.session import Live, Playback, pipeline_for, prepare, run
from manytouch.sources import open_source
from manytouch.sources.files.frame_timeline import FrameTimeline, frame_timeline
from manytouch.sources.source import Source
from manytouch.values import Frame, Pause, Phase, Reading, Resume, Seek, Tune

FRAMES = 20


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clips") / "rest.avi"
    write_video(path, (picture(seed=index) for index in range(FRAMES)))
    return path


@dataclass
class Counted:
    """A source that counts how many frames were decoded."""

    source: Source
    decoded: int = 0

    def __post_init__(self) -> None:
        # Python 3.12 looks up the members of a protocol without __getattr__
        for name in ("name", "fps", "frame_count", "width_px", "height_px", "is_live", "capabilities"):
            setattr(self, name, getattr(self.source, name))

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
            playback.send(Resume())
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


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pressed_video(tmp_path_factory.mktemp("clips") / "pressed.avi")


class Waiting(Seeking):
    """Waits at the given number of readings until what was requested is prepared."""

    def __init__(self, playback: Playback, at: dict[int, object], waits_at: int) -> None:
        super().__init__(playback, at)
        self.waits_at = waits_at

    def write(self, reading: Reading) -> None:
        super().write(reading)
        deadline_s = time.monotonic() + 30.0
        while len(self.readings) == self.waits_at and self.playback.health().is_preparing:
            assert time.monotonic() < deadline_s
            time.sleep(0.01)


@pytest.mark.parametrize(
    ("method", "parameter", "value"),
    [
        ("paper", "estimate.formula", "printed"),
        pytest.param("paper", "estimate.padding", "zero", marks=pytest.mark.slow),
        pytest.param("paper", "estimate.contact_depth_pitch", 0.3, marks=pytest.mark.slow),
        pytest.param("paper", "interpolation.iterations", 80.0, marks=pytest.mark.slow),
        pytest.param("paper", "interpolation.power", 3.0, marks=pytest.mark.slow),
        ("perimeter", "track.damping", 0.4),
    ],
)
def test_a_changed_parameter_keeps_identities_and_shows_the_present_frame_again(
    pressed: Path, method: str, parameter: str, value: float | str
) -> None:
    playback = Playback(prepare(pressed, method=method, fps=500.0))
    sink = Waiting(playback, {28: Tune(parameter=parameter, value=value)}, waits_at=32)
    run(playback, [sink])
    assert playback.health().parameters[parameter] == value
    indices = [reading.frame.index for reading in sink.readings]
    again = next(place for place in range(1, len(indices)) if indices[place] == indices[place - 1])
    assert 28 <= again <= 33
    ids = [{contact.id for contact in each.contacts.touching} for each in sink.readings[27:37]]
    assert ids[0]
    assert all(ids[0] <= each for each in ids), str(ids)
    # contacts that start once more would begin in the frame that is shown again
    assert {contact.phase for contact in sink.readings[again].contacts.contacts if contact.id in ids[0]} == {
        Phase.MOVE
    }
    assert not any(each.grid.new_ids for each in sink.readings)
    assert min(each.grid.is_seen.mean() for each in sink.readings) == 1.0


def test_another_place_starts_without_identities_also_while_a_parameter_is_changed(pressed: Path) -> None:
    playback = Playback(prepare(pressed, method="paper", fps=500.0))
    tune = Tune(parameter="estimate.formula", value="printed")
    sink = Waiting(playback, {28: tune, 31: Seek(frame=0)}, waits_at=31)
    run(playback, [sink])
    indices = [reading.frame.index for reading in sink.readings]
    found = [contact for each in sink.readings[indices.index(0, 1) :] for contact in each.contacts.contacts]
    begun = [contact.id for contact in found if contact.phase is Phase.START]
    before = [contact.id for each in sink.readings[:31] for contact in each.contacts.contacts]
    assert begun[0] == max(before) + 1  # the parameter is another: these are other contacts


def found_in(reading: Reading) -> list[tuple[object, ...]]:
    return [
        (contact.id, contact.phase, *contact.centre_mm.tolist(), contact.depth_mm)
        for contact in reading.contacts.contacts
    ]


@pytest.mark.parametrize("method", ["perimeter", pytest.param("paper", marks=pytest.mark.slow)])
def test_a_frame_has_the_same_contacts_after_a_jump_as_from_playing(pressed: Path, method: str) -> None:
    job = prepare(pressed, method=method, fps=500.0)
    played = {reading.frame.index: found_in(reading) for reading in job.readings()}
    touched = next(place for place, contacts in played.items() if contacts) + 8
    playback = Playback(prepare(pressed, method=method, fps=500.0), stays=True)
    playback.send(Pause())
    wanted = [touched, 2, touched - 3, touched + 17, touched]
    sink = Seeking(playback, {1: Seek(frame=wanted[0])})
    arrived: list[Reading] = []

    class Next(Seeking):
        def write(self, reading: Reading) -> None:
            super().write(reading)
            if len(arrived) < len(wanted) and reading.frame.index == wanted[len(arrived)]:
                arrived.append(reading)
                if len(arrived) < len(wanted):
                    playback.send(Seek(frame=wanted[len(arrived)]))

    sink = Next(playback, sink.at)
    run(playback, [sink], stop=lambda: len(arrived) == len(wanted))
    assert len(played[touched]) > 0
    for reading in sink.readings:
        assert found_in(reading) == played[reading.frame.index], reading.frame.index
    indices = [reading.frame.index for reading in sink.readings]
    assert indices[: touched + 1] == list(range(touched + 1))  # what was not processed yet is shown
    assert len(indices) < 2 * (touched + 18)  # what was processed before is not


def test_what_was_shown_already_waits_at_its_end(video: Path) -> None:
    live = Live(prepare(video, fps=500.0))
    run(live, [])
    playback = Playback(live.job, stays=True, shown=live.meter)
    assert not playback.health().is_running
    assert playback.health().frame == FRAMES - 1
    assert playback.health().markers_seen == live.health().markers_seen > 0
    sink = Seeking(playback, {})
    waits = iter(range(5))
    run(playback, [sink], stop=lambda: next(waits, None) is None)
    assert sink.readings == []


def test_the_estimation_is_prepared_once_for_each_setup(video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    playback = Playback(prepare(video, fps=500.0), stays=True)
    estimator = type(pipeline_for(playback.health().method).estimate)
    starts: list[object] = []
    start = estimator.start

    def counted(self: object, sensor: object) -> object:
        starts.append(self)
        return start(self, sensor)

    monkeypatch.setattr(estimator, "start", counted)
    sink = Seeking(playback, {FRAMES: Seek(frame=0)})
    run(playback, [sink], stop=lambda: len(sink.readings) >= 2 * FRAMES)
    assert len(starts) == 1
