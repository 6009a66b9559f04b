"""`manytouch recording`: what of a recording is whole, and a copy of it."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from manytouch.source_names import require_file

app = App(name="recording", help="Check and repair recordings.")

File = Annotated[Path, Parameter(metavar="FILE.mcap", help="Recording of manytouch run --record.")]


@app.command
def check(file: File, /) -> int:
    """Check every checksum, message and reading of a recording, and list what is whole.

    The exit status is 1 if something is damaged or missing.

    Example: manytouch recording check press.mcap
    """
    require_file(file, "a recording (.mcap)")
    from manytouch.errors import SourceError
    from manytouch.recording.repair import check as check_recording

    report = check_recording(file)
    for line in report.lines():
        print(line)
    if not report.is_whole:
        raise SourceError(
            f"{file} is not whole: manytouch recording repair {file} writes a copy of what can be saved"
        )
    print("whole")
    return 0


@app.command
def repair(
    file: File,
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(metavar="FILE.mcap", help="Copy to write. [default: FILE-repaired.mcap]"),
    ] = None,
) -> int:
    """Write a copy of a recording that contains everything that is whole, with an index.

    A recording without an end, such as that of a killed process, gets one. The
    original is not changed.

    Example: manytouch recording repair press.mcap --out saved.mcap
    """
    require_file(file, "a recording (.mcap)")
    from manytouch.errors import OutputError
    from manytouch.recording.repair import repair as repair_recording
    from manytouch.sinks.files.atomic_output import atomic_file, check_file_writable

    repaired = out or file.with_name(f"{file.stem}-repaired{file.suffix}")
    check_file_writable(repaired)
    if repaired.exists():
        raise OutputError(f"{repaired} exists already: choose another name with --out")
    with atomic_file(repaired) as partial:
        count = repair_recording(file, partial)
    print(f"{count} messages saved in {repaired}")
    return 0
