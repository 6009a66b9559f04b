"""A video file that browsers play: VP9 in MP4, written with PyAV."""

from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from manytouch.errors import OutputError
from manytouch.sinks.files.atomic_output import output_errors

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream

CODEC = "libvpx-vp9"
# crf is the quality that is aimed at, unless the bit rate limits it.
OPTIONS = {"deadline": "realtime", "row-mt": "1", "crf": "36"}
# Small pictures come from small files, whose bit rate is low: 8 is the fastest, 5 needs a third less bits.
SMALL_PX, CPU_USED, CPU_USED_SMALL = 1_000_000, "8", "5"
LEAST_BITS_PER_S = 40_000


class VideoFile:
    """Writes pictures of one size into a video."""

    def __init__(self, path: Path, fps: float, most_bits_per_s: float | None = None) -> None:
        """Prepare the file; it is created with the first picture.

        Args:
            path: of the file, .mp4.
            fps: frame rate.
            most_bits_per_s: bit rate that lowers the quality; None: no limit.
        """
        self._path = path
        self._rate = Fraction(fps).limit_denominator(1000)
        self._most_bits_per_s = most_bits_per_s
        self._file: OutputContainer | None = None
        self._stream: VideoStream | None = None

    def write(self, picture: np.ndarray) -> None:
        """Add a picture, (h, w, 3) uint8 in B, G, R, with even height and width.

        Raises:
            OutputError: it cannot be written.
        """
        from av import VideoFrame

        with output_errors(self._path):
            if self._file is None or self._stream is None:
                self._file, self._stream = self._open(picture.shape[1], picture.shape[0])
            self._file.mux(self._stream.encode(VideoFrame.from_ndarray(picture, format="bgr24")))

    def close(self) -> None:
        """Complete the file; without pictures there is none.

        Raises:
            OutputError: it cannot be written.
        """
        file, stream, self._file = self._file, self._stream, None
        if file is None or stream is None:
            return
        with output_errors(self._path):
            try:
                file.mux(stream.encode(None))
            finally:
                file.close()

    def _open(self, width_px: int, height_px: int) -> tuple["OutputContainer", "VideoStream"]:
        import av

        file = av.open(str(self._path), "w", format="mp4")
        try:
            cpu_used = CPU_USED_SMALL if width_px * height_px < SMALL_PX else CPU_USED
            options = {**OPTIONS, "cpu-used": cpu_used}
            stream = cast("VideoStream", file.add_stream(CODEC, rate=self._rate, options=options))
        except ValueError as error:
            file.close()
            raise OutputError(
                f"cannot write {self._path}: this PyAV has no VP9 encoder; "
                "install av from PyPI, or omit --annotate"
            ) from error
        stream.width, stream.height, stream.pix_fmt = width_px, height_px, "yuv420p"
        limit = self._most_bits_per_s
        stream.bit_rate = 0 if limit is None else max(round(limit), LEAST_BITS_PER_S)
        return file, stream
