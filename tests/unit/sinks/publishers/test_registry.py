"""Addresses of outputs: what is accepted, and one sentence for what is not."""

import re
from dataclasses import replace

import pytest

from manytouch.errors import ManytouchError, OutputError
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.registry import SCHEMES, check_addresses, open_outputs


def test_the_parts_of_an_address() -> None:
    address = parse_address("TUIO://[::1]:3333/some%20path?version=2.0&force-N=4")
    assert (address.scheme, address.host, address.port, address.path) == ("tuio", "::1", 3333, "some path")
    assert address.options == {"version": "2.0", "force-N": "4"}
    assert address.number("force-N", 10.0, (0.0, 100.0)) == 4.0
    assert address.number("depth-pitch", 10.0, (0.0, 100.0)) == 10.0
    named = parse_address("midi://IAC%20Driver%20Bus%201")
    assert (named.host, named.port) == ("IAC Driver Bus 1", None)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("127.0.0.1:3333", "not the address of an output"),
        ("smoke://127.0.0.1", "no output smoke://.*tuio://.*osc://"),
        ("tuio://127.0.0.1:99999", "the port is not a number from 0 to 65535"),
        ("tuio://127.0.0.1?colour=red", "no option 'colour': known are version"),
        ("osc://127.0.0.1:9000?colour=red", "no option 'colour': it has none"),
        ("osc://[::1:9000", "an IPv6 address has brackets"),
        ("osc://host", "'osc://host' has no port: add one, such as osc://host:9000"),
        ("osc://[::1]", "add one, such as osc://\\[::1\\]:9000"),
        ("tuio://host?version=3", "choose 1.1 or 2.0"),
        ("tuio://host?force-N=strong", "force-N is 'strong'; give a number"),
        ("midi://PORT?notes=many", "notes is 'many'; give a number from 0 to 127"),
        ("midi://PORT?depth-pitch=0", "depth-pitch is '0'; give a number"),
        ("ros2://1st skin", "'1st skin' is not a name of ROS"),
        ("ros2://skin?domain=9999", "domain is '9999'; give a number from 0 to 232"),
        ("ros2://skin?images=many", "images is 'many'; give a number from 0.1 to 1000"),
        ("ros2://skin?parent=tool0", "expected parent=FRAME&pose="),
        ("foxglove://127.0.0.1:8765?images=0", "images is '0'; give a number from 0.1 to 1000"),
    ],
)
def test_a_wrong_address_is_one_sentence(url: str, words: str) -> None:
    with pytest.raises(ManytouchError, match=words):
        check_addresses([url])


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("tuio://127.0.0.1:0", "has no port: add one"),
        ("osc://no-such-host.invalid:9000", "the host 'no-such-host.invalid' is not known"),
        ("midi:///no/such/folder/take.mid", "cannot be written"),
    ],
)
def test_an_output_that_cannot_be_opened_is_one_sentence(url: str, words: str, session) -> None:
    with pytest.raises(ManytouchError, match=words):
        open_outputs(["osc://127.0.0.1:9000", url], session)


def test_an_internal_error_names_the_output(session, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ValueError("buffer source array is read-only")

    monkeypatch.setitem(SCHEMES, "osc", replace(SCHEMES["osc"], open_publisher=fail))
    words = "^'osc://h:1' cannot be opened: internal error: ValueError: buffer source .*; please report it$"
    with pytest.raises(OutputError, match=words):
        open_outputs(["osc://h:1"], session)


@pytest.mark.parametrize(
    "rest", ["host:99999", "[::1", "host?colour=red", "host:9000?version=3", "no-such-host.invalid"]
)
def test_an_error_shows_no_password(rest: str, session) -> None:
    for scheme in ("tuio", "smoke"):
        with pytest.raises(ManytouchError) as error:
            open_outputs([f"{scheme}://me:secret@{rest}"], session)
        assert "secret" not in str(error.value)
        assert rest in str(error.value)


def test_the_name_of_an_output_has_no_password(session) -> None:
    (output,) = open_outputs(["osc://me:secret@127.0.0.1:9000"], session)
    output.close()
    assert output.state.name == "osc://127.0.0.1:9000"
    assert "secret" not in output.description


def test_every_example_is_an_address_of_its_scheme() -> None:
    for name, scheme in SCHEMES.items():
        assert parse_address(scheme.example).scheme == name
        check_addresses([scheme.example])


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("osc://127.0.0.1:9000", "sends bundles of OSC to UDP port 9000 of 127.0.0.1"),
        ("tuio://", "sends bundles of OSC to UDP port 3333 of 127.0.0.1"),
        ("midi:///{folder}/take.mid", "writes notes to .*take.mid$"),
    ],
)
def test_an_output_describes_where_it_sends(url: str, words: str, session, tmp_path) -> None:
    url = url.format(folder=tmp_path)
    (output,) = open_outputs([url], session)
    output.close()
    assert output.description.startswith(f"{url}: ")
    assert re.search(words, output.description)
