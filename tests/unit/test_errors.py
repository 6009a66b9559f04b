"""What errors show of what was given."""

import pytest

from manytouch.errors import without_password


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("rtsp://me:secret@cam.local:554/x?y=1", "rtsp://cam.local:554/x?y=1"),
        ("views:rtsp://me:secret@left,rtsp://me:se@cret@right", "views:rtsp://left,rtsp://right"),
        ("http://me:secret@[::1", "http://[::1"),
        ("http://cam.local/a@b", "http://cam.local/a@b"),
        ("/dev/video0", "/dev/video0"),
        ("rtsp://me:sec/r#e?t@cam.local:554/x", "rtsp://cam.local:554/x"),
        ("'rtsp://me:se/cret@left' rtsp://right:554/a@b", "'rtsp://left' rtsp://right:554/a@b"),
        ("http://cam.local/video?user=me&pwd=secret&size=1", "http://cam.local/video?user=me&pwd=***&size=1"),
        ("http://cam.local/v?loginuse=me&loginpas=secret", "http://cam.local/v?loginuse=me&loginpas=***"),
        ("rtsp://cam/user=me_password=secret_channel=1", "rtsp://cam/user=me_password=***_channel=1"),
        ("rtsp://cam/user=me&password=&channel=1", "rtsp://cam/user=me&password=&channel=1"),
        ("s3://day/a?X-Amz-Signature=ab12#x", "s3://day/a?X-Amz-Signature=***#x"),
        ("views:http://l?token=secret,http://r?key=secret", "views:http://l?token=***,http://r?key=***"),
        ("'http://cam/v?access_token=secret' x=1", "'http://cam/v?access_token=***' x=1"),
        ("http://cam/v?compass=1&design=2&monkey=3", "http://cam/v?compass=1&design=2&monkey=3"),
        ("password=1/press.mp4", "password=1/press.mp4"),
        ("no http://a:b@cam\nat http://\nme@home", "no http://cam\nat http://\nme@home"),
    ],
)
def test_passwords_are_not_shown(text: str, shown: str) -> None:
    assert without_password(text) == shown
