"""TOML that would take much time or memory is refused before it is parsed; other TOML is read as it is."""

import re
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from manytouch.errors import SensorError
from manytouch.limits import MAX_TOML_BYTES, MAX_TOML_DEPTH, MAX_TOML_KEYS
from manytouch.values.sensor_file.toml_file import complexity_mistake, read_toml


def refusal(text: str | bytes, folder: Path) -> str:
    path = folder / "a.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(SensorError) as caught:
        read_toml(path, "a sensor file", SensorError)
    return str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "[" + ".".join(["a"] * 50_000) + "]\nx = 1",
        ".".join(["a"] * 50_000) + " = 1",
        "x = " + "[" * 50_000,
        "x = " + "{a=" * 50_000,
        "x = " + "[" * 50_000 + "]" * 50_000,
        'name = "\\"" # "\nx = ' + "[" * 50_000,
        "name = '''\n''''\nx = " + "[" * 50_000,
        'a."b"' + ". c " * 50_000 + "= 1",
    ],
)
def test_deep_nesting_is_refused(text: str, tmp_path: Path) -> None:
    assert f"at most {MAX_TOML_DEPTH}" in refusal(text, tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("".join(f"[a{number}]\n" for number in range(MAX_TOML_KEYS + 1)), "keys"),
        ("".join(f"a{number}=1\n" for number in range(MAX_TOML_KEYS + 1)), "keys"),
        ("#" * (MAX_TOML_BYTES + 1), "too large"),
        ("x = [" + "[0,0]," * 120_000 + "]", "lists"),
        ("x = [" + "0," * 700_000 + "]", "values"),
        (b"name = '\xff'", "cannot be read"),
        ("x = " + "9" * 5000, "not valid TOML"),
        ("x = 1\nx = 2", "not valid TOML"),
        ('"""' + '\\"""' * 300_000, "not valid TOML"),
    ],
)
def test_other_unusable_files_are_refused(text: str | bytes, words: str, tmp_path: Path) -> None:
    assert words in refusal(text, tmp_path)


def test_text_in_another_encoding_is_refused_with_what_to_do(tmp_path: Path) -> None:
    assert "it is not text in UTF-8; save it as such" in refusal('name = "é"'.encode("latin-1"), tmp_path)


def test_a_picture_is_refused_as_no_text(tmp_path: Path) -> None:
    _, png = cv2.imencode(".png", np.zeros((8, 8), np.uint8))
    assert "is not a text file: give the path of a sensor file (.toml)" in refusal(png.tobytes(), tmp_path)
    assert "it is not text in UTF-8; save it as such" in refusal("name = 1".encode("utf-16"), tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("seconds = 1.0", "is a scene file, not a sensor file: manytouch simulate .*a.toml --out DIR"),
        ("[board]", "is a scene file, not a sensor file: "),
        ("[[sensors]]", "is a rig file, not a sensor file: manytouch run .*a.toml"),
    ],
)
def test_a_file_of_another_kind_is_refused_with_what_it_is_for(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    assert re.search(words, refusal(text, tmp_path))
    assert read_toml(path, words.split(",", maxsplit=1)[0].removeprefix("is "), SensorError)
    with pytest.raises(SensorError, match=words.partition(",")[0]):
        read_toml(path, "SLURM options", SensorError)
    path.write_text(f"{text}\n[camera]")
    assert read_toml(path, "a sensor file", SensorError)


def test_a_file_that_may_not_be_read_is_refused_in_one_sentence(tmp_path: Path, monkeypatch) -> None:
    def refuse(self: Path, *_: object) -> None:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(SensorError) as caught:
        read_toml(tmp_path / "a.toml", "a sensor file", SensorError)
    sentence = f"{tmp_path / 'a.toml'} cannot be read: Permission denied; give a sensor file that can be read"
    assert str(caught.value) == sentence


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SensorError, match="folder"):
        read_toml(tmp_path, "a sensor file", SensorError)


@pytest.mark.parametrize(
    "text",
    [
        'x = "[[[[[[[[[[[[[[[[" # [[[[[[[[[[[[[[',
        "x = '''\n[[[[[[[[[[[[[[[[[['''",
        'x = """[[[[[[[[[[\\"""[[[[[[""""',
        "x = ['a.a.a.a.a.a.a.a.a.a', 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8.5, 9.5]",
        "x = [" + "[1.0, 2.0],\n" * 20_000 + "]",
    ],
)
def test_text_and_long_tables_are_not_nested(text: str, tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(text)
    assert read_toml(path, "a sensor file", SensorError) == tomllib.loads(text)


@given(
    st.recursive(st.just("1"), lambda inner: st.lists(inner, max_size=3).map(lambda a: f"[{', '.join(a)}]"))
)
def test_the_depth_of_lists_is_found(value: str) -> None:
    depth = 0
    for place in range(len(value)):
        depth = max(depth, value[: place + 1].count("[") - value[: place + 1].count("]"))
    assert (complexity_mistake(f"x = {value}") is not None) == (depth > MAX_TOML_DEPTH)
