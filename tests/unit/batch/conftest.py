"""Short recordings, and a batch of them in this process."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from batch_work import Notes, Serial, never
from clips import picture, write_video
from manytouch.batch.inputs import tasks_of
from manytouch.batch.run_batch import BatchReport, run_batch
from manytouch.batch.settings import settings_for
from manytouch.session import Request
from measured_once import layouts_measured_once

FRAMES, FEW = 18, (4, 6)


@pytest.fixture(scope="session", autouse=True)
def layouts() -> Iterator[None]:
    with layouts_measured_once():
        yield


@pytest.fixture(scope="session")
def three_videos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("videos")
    for number in range(3):
        pictures = (picture(seed=each, shape=FEW) for each in range(FRAMES + number))
        write_video(folder / f"press{number}.mp4", pictures)
    return folder


@pytest.fixture
def recordings(tmp_path: Path, three_videos: Path) -> Path:
    """A folder with three recordings, of this test alone."""
    return Path(shutil.copytree(three_videos, tmp_path / "recordings"))


@pytest.fixture
def batch(tmp_path: Path) -> Callable[..., tuple[BatchReport, Notes]]:
    """Runs a batch into `tmp_path / "out"`."""

    def run(
        *words: object,
        engine: Any = None,
        out: str | Path | None = None,
        shard: tuple[int, int] | None = None,
        stop: Callable[[], bool] = never,
        **options: Any,
    ) -> tuple[BatchReport, Notes]:
        kept = {name: options.pop(name) for name in ("surface", "is_verifying") if name in options}
        settings = settings_for(str(out or tmp_path / "out"), Request(**options), **kept)
        notes, tasks = Notes(), tasks_of([str(word) for word in words])
        tasks = tasks if shard is None else tasks[shard[0] :: shard[1]]
        report = run_batch(tasks, settings, engine or Serial(), observer=notes, stop=stop, shard=shard)
        return report, notes

    return run
