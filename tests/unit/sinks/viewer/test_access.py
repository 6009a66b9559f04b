"""Which requests are admitted."""

import stat
from pathlib import Path

import pytest

from manytouch.sinks.viewer import access
from manytouch.sinks.viewer.access import COOKIE, Access, access_to, is_loopback, write_token

HERE = Access(host="127.0.0.1", port=8000, token="secret-word", is_token_required=False)
OPEN = Access(host="0.0.0.0", port=8000, token="secret-word", is_token_required=True)
HOST = {"host": "127.0.0.1:8000"}
PAGE = HOST | {"origin": "http://127.0.0.1:8000"}
TOKEN = {COOKIE: "secret-word"}


def test_the_address_to_open() -> None:
    assert HERE.url == "http://127.0.0.1:8000/"
    assert HERE.stream_url == "ws://127.0.0.1:8000/stream"
    assert OPEN.url == "http://127.0.0.1:8000/?token=secret-word"
    assert access_to("::1", 1, None).url == "http://[::1]:1/"


@pytest.mark.parametrize(
    ("host", "is_known"),
    [
        ("127.0.0.1:8000", True),
        ("localhost:8000", True),
        ("[::1]:8000", True),
        ("evil.example:8000", False),
        ("127.0.0.1.evil.example", False),
        ("", False),
    ],
)
def test_foreign_host_names_are_refused(host: str, is_known: bool) -> None:
    assert HERE.is_known_host({"host": host}) is is_known


def test_pages_of_others_are_refused() -> None:
    assert HERE.may_stream(PAGE, {})
    for origin in ("http://evil.example", "null", "http://127.0.0.1:9999", "https://127.0.0.1:8000"):
        assert not HERE.may_stream(HOST | {"origin": origin}, {})
        assert not HERE.may_stream(HOST | {"origin": origin}, TOKEN)


def test_programs_need_the_token() -> None:
    assert not HERE.may_stream(HOST, {})
    assert not HERE.may_stream(HOST | {"authorization": "Bearer secret-wor"}, {})
    assert HERE.may_stream(HOST | {"authorization": "Bearer secret-word"}, {})
    assert HERE.may_stream(HOST, TOKEN)
    assert not HERE.may_stream({"host": "evil.example", "authorization": "Bearer secret-word"}, {})


def test_a_token_is_required_where_other_machines_can_connect() -> None:
    assert not access_to("127.0.0.1", 1, None).is_token_required
    assert not access_to("localhost", 1, None).is_token_required
    assert access_to("127.0.0.1", 1, "chosen-one") == Access(
        host="127.0.0.1", port=1, token="chosen-one", is_token_required=True
    )
    made = [access_to(host, 1, None) for host in ("0.0.0.0", "0.0.0.0", "127.0.0.1")]
    assert made[0].is_token_required
    assert len({access.token for access in made}) == 3
    assert all(len(access.token) >= 20 for access in made)
    assert HERE.may_open_page({})
    assert OPEN.may_open_page(TOKEN)
    assert not OPEN.may_open_page({COOKIE: "secret-wor"})
    assert not OPEN.may_open_page({})
    assert not OPEN.may_stream(PAGE, {})
    assert OPEN.may_stream(PAGE, TOKEN)


def test_the_token_is_in_a_file_that_only_its_user_can_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = {"runtime": tmp_path / "run", "cache": tmp_path / "cache"}
    monkeypatch.setattr(access, "user_runtime_path", lambda _: folders["runtime"])
    monkeypatch.setattr(access, "user_cache_path", lambda _: folders["cache"])
    path = write_token(HERE)
    assert path is not None
    assert path.parent == folders["runtime"]
    assert path.read_text() == "secret-word"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    path.write_text("of a session that was killed")
    path.chmod(0o644)
    assert write_token(HERE) == path
    assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("secret-word", 0o600)
    folders["runtime"].chmod(0o777)
    found = write_token(HERE)
    assert found is not None, "others could replace the file in the first folder"
    assert found.parent == folders["cache"]
    folders["cache"].chmod(0o777)
    assert write_token(HERE) is None


def test_loopback() -> None:
    assert all(map(is_loopback, ("localhost", "127.0.0.1", "127.8.9.1", "::1")))
    assert not any(map(is_loopback, ("0.0.0.0", "192.168.1.2", "example.org", "")))
