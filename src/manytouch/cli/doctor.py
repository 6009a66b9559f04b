"""`manytouch doctor`: diagnosis of the installation and of a source, from `session.diagnosis`."""

from itertools import chain
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import options
from manytouch.errors import without_password
from manytouch.source_names import require_existing


def doctor(
    source: Annotated[
        str | None,
        Parameter(help=options.SOURCE_WORDS),
    ] = None,
    /,
    *,
    roi: options.RoiPx = None,
) -> int:
    """Diagnose this installation and, if a source is given, how well it can be processed.

    For a camera: reported size, rate, exposure and focus, and the measured frame
    rate. For any source: exposure, dots, contrast, focus, the layout found or why
    there is none, and noise; with a remedy for each problem.

    Example: manytouch doctor press.mp4
    """
    require_existing([] if source is None else [source])
    from rich.console import Console

    from manytouch.session.diagnosis.installation import describe_installation
    from manytouch.session.diagnosis.recording import diagnose
    from manytouch.session.warm_up import warm_up_kernels

    console = Console(highlight=False, soft_wrap=True)
    found = iter(()) if source is None else diagnose(source, roi)
    # opens the source before anything is printed: if that fails, the error is the only message
    first = next(found, None)
    if first is not None:
        # has the kernels of detection and tracking, by which dots and layout are found, and few others
        warm_up_kernels("perimeter")
        console.print(without_password(str(source)), markup=False)
        for line in chain((first,), found):
            console.print(f"  {line}", markup=False)
        console.print("\nthis installation", markup=False)
    for line in describe_installation():
        console.print(line, markup=False)
    return 0
