"""One recording of a batch, whose input does not stay what it was."""

import shutil
from pathlib import Path

import pytest

from manytouch.batch.one_recording import process_recording
from manytouch.batch.settings import settings_for
from manytouch.batch.tasks import Task, TaskState
from manytouch.session import Request


@pytest.mark.parametrize("raises", [False, True])
def test_an_input_that_vanishes_leaves_no_result_of_a_part_of_it(
    recordings: Path, tmp_path: Path, raises: bool
) -> None:
    path, out, calls = recordings / "press0.mp4", tmp_path / "out", []

    def stop() -> bool:
        """Called after each frame."""
        calls.append(path.exists())
        if len(calls) == 3:
            shutil.move(path, tmp_path / "elsewhere.mp4")
            if raises:
                raise OSError("cannot read")
        return False

    done = process_recording(
        settings_for(str(out), Request()), Task(name="press0", input=str(path)), stop=stop
    )
    assert len(calls) >= 3
    assert done.state is TaskState.FAILED
    assert f"{path} changed or vanished while it was processed" in done.reason
    assert not (out / "press0").exists()
