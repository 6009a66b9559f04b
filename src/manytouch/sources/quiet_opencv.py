"""OpenCV without its own messages: what is wrong with a file is said once, by the source.

FFmpeg's level is read from the environment when the first video is opened, so it is set on import.
"""

import os

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2

# its home differs between releases of OpenCV
_set_log_level = getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel
_set_log_level(0)  # silent

__all__ = ["cv2"]
