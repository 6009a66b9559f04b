"""OpenCV without its own messages: the source reports what is wrong with a file, once.

FFmpeg's level is read from the environment when the first video is opened, so it is set on import; and so
is how long a silent camera is waited for on Linux.
"""

import os

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "2")  # seconds

import cv2

# its home differs between releases of OpenCV
_set_log_level = getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel
_set_log_level(0)  # silent

__all__ = ["cv2"]
