"""OpenCV without its own messages: what is wrong with a file is said once, by the source.

FFmpeg's level is read from the environment when the first video is opened, so it is set on import.
"""

import os

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2

cv2.utils.logging.setLogLevel(0)  # silent

__all__ = ["cv2"]
