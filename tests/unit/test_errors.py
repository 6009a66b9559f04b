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
        ("no http://a:b@cam\nat http://\nme@home", "no http://cam\nat http://\nme@home"),
    ],
)
def test_passwords_are_not_shown(text: str, shown: str) -> None:
    assert without_password(text) == shown
