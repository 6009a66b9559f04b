"""`manytouch calibrate`: the camera from views of a board."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, Parameter

from manytouch.cli import options

if TYPE_CHECKING:
    from manytouch.calibration.board_views import ViewCollection
    from manytouch.values import Frame

app = App(name="calibrate", help="From pictures to a sensor that is known: camera, rest, sheet.")

VIDEO_STEP_S = 0.2
SAY_EVERY_S = 2.0


@app.command
def camera(
    images: Annotated[
        list[str],
        Parameter(name="IMAGES", negative=(), help="Pictures, folders of pictures, a video, or a camera."),
    ],
    /,
    *,
    board: Annotated[
        str,
        Parameter(
            metavar="KIND:CxR",
            help="chessboard:9x6 (inner corners), charuco:8x6 (squares), circles:9x6 or "
            "circles-asymmetric:4x11.",
        ),
    ],
    square_mm: Annotated[
        float, Parameter(metavar="MM", help="Side of a square, or distance of neighbouring circles.")
    ],
    out: Annotated[Path, Parameter(metavar="FILE", help="The sensor file to write; it holds [camera] only.")],
    model: Annotated[Literal["pinhole", "fisheye"], Parameter(help="Kind of lens.")] = "pinhole",
    report: Annotated[
        Path | None,
        options.folder("Also write coverage.png, calibration.json and camera_info.yaml (ROS) here."),
    ] = None,
    name: Annotated[str, Parameter(help="What the camera is called.")] = "camera",
) -> int:
    """Calibrate a camera from views of a board, and say how well it is known.

    Sharp views that differ are chosen by themselves; each picture that is refused is
    named with the reason, and what is missing is said while looking. Take 15 or more:
    tilted in different directions, near and far, in the middle and in every corner.

    Example: manytouch calibrate camera views/*.jpg --board chessboard:9x6 --square-mm 25 --out camera.toml
    """
    from rich.console import Console

    from manytouch.calibration.board import board_of
    from manytouch.calibration.camera import calibrate_camera
    from manytouch.calibration.camera_report import in_words, write_report
    from manytouch.cli.stopping import Stop
    from manytouch.values import Sensor
    from manytouch.values.sensor_file import save_sensor

    console = Console(highlight=False, soft_wrap=True)
    wanted = board_of(board, square_mm)
    with Stop() as stop:
        look = _Looking(console.print, stop, is_live=any(not Path(text).exists() for text in images))
        found = calibrate_camera(_pictures(images), wanted, model=model, look=look)
    for line in in_words(found):
        console.print(f"  {line}", markup=False)
    if report is not None:
        write_report(found, report, name)
        console.print(f"  report in {report}", markup=False)
    provenance = {
        "camera": f"calibrated from {len(found.views)} views of a {wanted}, square {square_mm:g} mm",
        "camera_rms_px": round(found.intrinsics.rms_px, 4),
        **{f"camera_std_{key}": value for key, value in found.intrinsics.std.items()},
        "new_camera_matrix": found.intrinsics.new_matrix.tolist(),
    }
    save_sensor(Sensor(name=name, camera=found.intrinsics.camera, provenance=provenance), out)
    console.print(f"  camera in {out}", markup=False)
    return 0


def _pictures(texts: list[str]) -> Iterator[tuple[str, "Frame"]]:
    """The pictures of some inputs with names; of a video or camera five per second.

    A file that cannot be decoded counts as one bad picture when there are others.
    """
    from manytouch.errors import SourceError
    from manytouch.sources import open_source
    from manytouch.sources.images import ImagesSource
    from manytouch.values import Frame

    for text in texts:
        try:
            source = open_source(text)
        except SourceError:
            if len(texts) == 1 or not Path(text).is_file():
                raise
            yield Path(text).name, Frame(index=0, timestamp_ns=0, camera=text, image=None)
            continue
        if isinstance(source, ImagesSource):
            for path, frame in zip(source.paths, source, strict=True):
                yield path.name, frame
            continue
        next_ns = None
        for frame in source:
            if next_ns is None or frame.timestamp_ns >= next_ns:
                next_ns = frame.timestamp_ns + int(VIDEO_STEP_S * 1e9)
                yield f"frame {frame.index}", frame


class _Looking:
    """Says while pictures come what is still missing; it has seen enough of a camera once nothing is."""

    def __init__(self, say: Callable[[str], object], stop: Callable[[], bool], *, is_live: bool) -> None:
        self._say, self._stop, self._is_live = say, stop, is_live
        self._said_s = time.monotonic()

    def __call__(self, collection: "ViewCollection", reason: str | None) -> bool:
        missing = collection.missing()
        if time.monotonic() - self._said_s > SAY_EVERY_S or (self._is_live and reason is None):
            self._said_s = time.monotonic()
            last = "" if reason is None else f" (this one {reason})"
            wanted = "; missing: " + "; ".join(missing) if missing else ""
            self._say(f"  {len(collection.views)} good views{last}{wanted}")
        return self._stop() or (self._is_live and not missing)
