"""`manytouch doctor`: what works on this machine, and how well a recording can be read."""

from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import options


def doctor(
    source: Annotated[
        str | None,
        Parameter(help=options.SOURCE_WORDS),
    ] = None,
    /,
    *,
    roi: options.RoiPx = None,
) -> int:
    """Say what works on this machine and, with a source, how well its dots can be read.

    Of a camera: what it says of size, rate, exposure and focus, and how many
    pictures really come. Of any source: dots, contrast, focus, exposure, the
    arrangement found or why there is none, noise; each with a remedy where it is
    poor.

    Example: manytouch doctor press.mp4
    """
    from rich.console import Console

    from manytouch.session.diagnosis.installation import describe_installation
    from manytouch.session.diagnosis.recording import diagnose

    console = Console(highlight=False, soft_wrap=True)
    for line in describe_installation():
        console.print(line, markup=False)
    if source is not None:
        console.print(f"\n{source}", markup=False)
        for line in diagnose(source, roi):
            console.print(f"  {line}", markup=False)
    return 0
