"""Hashes of files and values."""

import hashlib

from manytouch.sinks.files.hashing import files_hash, result_hash, values_hash


def test_a_file_has_the_hash_of_its_bytes_however_long(tmp_path):
    content = bytes(range(256)) * 9000
    (tmp_path / "a").write_bytes(content)
    assert files_hash([tmp_path / "a"]) == hashlib.sha256(content).hexdigest()


def test_several_files_depend_on_content_names_and_order(tmp_path):
    for name, content in (("a", b"1"), ("b", b"2"), ("c", b"1")):
        (tmp_path / name).write_bytes(content)
    a, b, c = (tmp_path / name for name in "abc")
    assert len({files_hash(paths) for paths in ([a, b], [b, a], [c, b], [a, c], [a, b, c], [a])}) == 6


def test_values_have_the_same_hash_in_any_order_of_keys():
    assert values_hash({"a": 1, "b": [1.5, None]}) == values_hash({"b": [1.5, None], "a": 1})
    assert values_hash({"a": 1}) != values_hash({"a": 2})


def test_a_result_of_unknown_input_has_no_hash():
    parts = {"input": "1", "sensor": "2", "parameters": "3", "version": "4"}
    assert len(result_hash(parts)) == 64
    assert all(result_hash(parts) != result_hash(parts | {name: "changed"}) for name in parts)
    assert result_hash(parts | {"input": None}) is None
