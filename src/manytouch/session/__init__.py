"""A source, a pipeline and its sinks, put together and run.

    from manytouch import process
    folder = process("video.mp4", out="out/video")

`prepare` opens an input and finds or fits its sensor. `process` reads every frame of it into tables;
`Live` reads it at its own pace while people watch and steer, `Playback` shows a recording again.
"""

from manytouch.session.live import Live
from manytouch.session.methods import METHODS, kernels, pipeline_for
from manytouch.session.playback import Playback
from manytouch.session.prepare import REST_FRAMES, Job, Observer, Pitch, check_region, prepare
from manytouch.session.run import RESULTS, files_in, process, read_all, read_into, result_name

__all__ = [
    "METHODS",
    "REST_FRAMES",
    "RESULTS",
    "Job",
    "Live",
    "Observer",
    "Pitch",
    "Playback",
    "check_region",
    "files_in",
    "kernels",
    "pipeline_for",
    "prepare",
    "process",
    "read_all",
    "read_into",
    "result_name",
]
