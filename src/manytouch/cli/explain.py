"""`manytouch explain`: the method `paper` (docs/paper.md) on one frame, step by step."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from manytouch.cli.terminal import method_options, options
from manytouch.sinks.files.atomic_output import check_writable
from manytouch.source_names import require_existing


def explain(
    video: Annotated[
        str,
        Parameter(
            name="VIDEO", negative=(), help="Video, image, folder of images, .mcap recording, or sim:."
        ),
    ],
    /,
    *,
    out: Annotated[Path, options.folder("Folder for the page and the pictures.")],
    frame: Annotated[
        int | None,
        Parameter(
            negative=(),
            metavar="N",
            validator=validators.Number(gte=0),
            help="Frame to explain, from 0. [default: the one with most contacts]",
        ),
    ] = None,
    sensor: options.SensorFile = None,
    pitch_mm: options.PitchMm = None,
    hfov_deg: options.HfovDeg = None,
    roi: options.RoiPx = None,
    fps: options.Fps = None,
    interpolation: method_options.WithInterpolation = method_options.InterpolationOptions(),  # noqa: B008 - immutable
    paper: method_options.Paper = method_options.PaperOptions(),  # noqa: B008 - immutable
) -> int:
    """Explain the method of the paper on one frame: a page with a picture of every step.

    These are the steps of --method paper: camera image, grey image, threshold,
    opening, contours, midpoints, identities, perimeters, padded grid and surface,
    each with its numbers on this frame. Open DIR/index.html. The sheet must be
    untouched for half a second at any time in the recording.

    Example: manytouch explain press.mp4 --out explained
    """
    options.refuse_two_scales("explain", sensor, pitch_mm, hfov_deg)
    parameters = interpolation.parameters("explain", "paper") | paper.parameters("explain", "paper")
    check_writable(out)
    require_existing([video])
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.evaluation.published.steps.collect import collect_steps
    from manytouch.evaluation.published.steps.page import write_steps
    from manytouch.evaluation.report.page import require_packages
    from manytouch.session import prepare
    from manytouch.session.results import require_finite
    from manytouch.values.display.text import count_of

    require_packages()
    require_finite(video)
    with StopOnSignal() as stop, Reporter() as reporter:
        job = prepare(
            video,
            sensor=sensor,
            method="paper",
            pitch_mm=pitch_mm,
            hfov_deg=hfov_deg,
            roi_px=roi,
            fps=fps,
            parameters=parameters,
            whole_recording=True,
            observer=reporter,
        )
        try:
            steps = collect_steps(job, frame=frame, observer=reporter, stop=stop)
        finally:
            job.close()
    page = write_steps(steps, out)
    reading = steps.reading
    reporter.print(
        f"frame {reading.frame.index}: {int(steps.stages.is_marker.sum())} dots, status {reading.status}"
    )
    reporter.print(f"{count_of(len(reading.contacts.touching), 'contact')}; page in {page}")
    return 0
