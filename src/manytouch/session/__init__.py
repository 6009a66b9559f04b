"""A source, a pipeline and its sinks, put together and run by one loop.

`prepare` opens an input and determines its sensor; `run` drives a prepared job, a `Live` session with
commands, or a `Playback` of a recording. Formats of files and the viewer are in `manytouch.sinks`, not here.

    from manytouch import process
    folder = process("video.mp4", out="out/video")
"""

from manytouch.session.live import Live
from manytouch.session.methods import METHODS, kernels, pipeline_for
from manytouch.session.playback import Playback
from manytouch.session.prepare import Job, prepare
from manytouch.session.result_hashes import Pitch, Request, request_hashes
from manytouch.session.results import RESULTS, ResultFiles, process, process_job, result_name
from manytouch.session.run import Observer, Readings, StopCondition, run
from manytouch.session.sensors.determine_sensor import START_FRAMES
from manytouch.session.sensors.source_checks import require_region

__all__ = [
    "METHODS",
    "RESULTS",
    "START_FRAMES",
    "Job",
    "Live",
    "Observer",
    "Pitch",
    "Playback",
    "Readings",
    "Request",
    "ResultFiles",
    "StopCondition",
    "kernels",
    "pipeline_for",
    "prepare",
    "process",
    "process_job",
    "request_hashes",
    "require_region",
    "result_name",
    "run",
]
