"""Which requests are admitted."""

import pytest

from manytouch.sinks.viewer.access import Access, is_loopback, required_token

HERE = Access(host="127.0.0.1", port=8000, token=None)
OPEN = Access(host="0.0.0.0", port=8000, token="secret-word")


def test_the_address_to_open() -> None:
    assert HERE.url == "http://127.0.0.1:8000/"
    assert OPEN.url == "http://127.0.0.1:8000/?token=secret-word"
    assert Access(host="::1", port=1, token=None).url == "http://[::1]:1/"


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
    assert HERE.is_own_origin({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:8000"})
    assert HERE.is_own_origin({"host": "127.0.0.1:8000"})
    for origin in ("http://evil.example", "null", "http://127.0.0.1:9999", "https://127.0.0.1:8000"):
        assert not HERE.is_own_origin({"host": "127.0.0.1:8000", "origin": origin})


def test_a_token_is_required_where_other_machines_can_connect() -> None:
    assert required_token("127.0.0.1", None) is None
    assert required_token("localhost", None) is None
    assert required_token("127.0.0.1", "chosen-one") == "chosen-one"
    made = {required_token("0.0.0.0", None) for _ in range(3)}
    assert len(made) == 3
    assert all(token is not None and len(token) >= 20 for token in made)
    assert HERE.has_token(None)
    assert OPEN.has_token("secret-word")
    assert not OPEN.has_token("secret-wor")
    assert not OPEN.has_token(None)


def test_loopback() -> None:
    assert all(map(is_loopback, ("localhost", "127.0.0.1", "127.8.9.1", "::1")))
    assert not any(map(is_loopback, ("0.0.0.0", "192.168.1.2", "example.org", "")))
