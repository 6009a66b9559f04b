"""Which codecs predict pictures from other ones."""

import cv2
import pytest

from cameras import Driver
from manytouch.sources.cameras.capture import FFMPEG, CameraRequest, OpenCvCapture
from manytouch.sources.predicting_codecs import predicts_pictures


@pytest.mark.parametrize("code", ["h264", "avc1", "hevc", "hvc1", "VP90", "AV01", "FMP4", "mp4v", "mpg2"])
def test_codecs_that_predict_pictures(code: str) -> None:
    assert predicts_pictures(float(cv2.VideoWriter.fourcc(*code)))


@pytest.mark.parametrize("code", ["MJPG", "MPNG", "ffv1", "HFYU", "YUYV", "apch", "dvsd", "gif "])
def test_codecs_that_store_each_picture_by_itself(code: str) -> None:
    assert not predicts_pictures(float(cv2.VideoWriter.fourcc(*code)))


@pytest.mark.parametrize("code", [-1.0, 0.0, float("nan"), float("inf"), 1e300])
def test_codes_that_are_not_known(code: float) -> None:
    assert not predicts_pictures(code)


@pytest.mark.parametrize("code", ["h264", "MJPG"])
def test_pictures_of_a_stream_state_whether_they_are_predicted(code: str) -> None:
    driver = Driver(cv2.CAP_FFMPEG, has_jpeg=False)
    driver.values[cv2.CAP_PROP_FOURCC] = float(cv2.VideoWriter.fourcc(*code))
    shot = OpenCvCapture(driver, CameraRequest(is_mjpg=False), FFMPEG).read()
    assert shot is not None
    assert shot.is_predicted == (code == "h264")
