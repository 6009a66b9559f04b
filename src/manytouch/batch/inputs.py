"""Inputs of a batch: globs, folders, text lists and addresses, as one list of recordings with their names."""

import glob
import os
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

from manytouch.batch.remote_files import (
    RECORDING_SUFFIXES,
    file_system,
    is_in_object_store,
    is_remote,
    remote_errors,
    remote_name,
)
from manytouch.batch.storage import SUMMARY
from manytouch.batch.tasks import Task
from manytouch.errors import SourceError
from manytouch.session.results import result_names
from manytouch.sources.files.images import IMAGE_SUFFIXES, natural_key

LIST_SUFFIX = ".txt"
MAX_LIST_BYTES = 2**30
_MAGIC = set("*?[")


def tasks_of(words: Sequence[str]) -> list[Task]:
    """All recordings that words name, each once, in the order of the words.

    Args:
        words: paths of recordings, folders, patterns (`*`, `?`, `[...]`, `**`), text lists with one input
            per line, `s3://`, `gs://` and `https://` addresses, or `sim:`. A folder stands for all
            recordings below it; a folder of images is one recording. Result folders are left out.

    Returns:
        The tasks; their names are those that `process` gives to these inputs.

    Raises:
        SourceError: a folder, a list or a pattern contains no recording.
    """
    found: dict[str, str] = {}
    for word in words:
        for text in _expand(word):
            found.setdefault(_identity(text), text)
    inputs = list(found.values())
    names = result_names([remote_name(text) if is_remote(text) else text for text in inputs])
    return [Task(name=name, input=text) for name, text in zip(names, inputs, strict=True)]


def shard_of(tasks: Sequence[Task], shard: tuple[int, int] | None) -> list[Task]:
    """Every N-th task, beginning with number I of (I, N); all without a shard."""
    return list(tasks) if shard is None else list(tasks[shard[0] % shard[1] :: shard[1]])


def absolute(text: str) -> str:
    """An input in a form that other processes of another folder understand."""
    if "://" in text:
        return text
    if text.startswith("sim:"):
        scene = Path(text.removeprefix("sim:")).expanduser()
        return f"sim:{scene.resolve()}" if scene.is_file() else text
    return str(Path(text).expanduser().absolute())


def _expand(word: str) -> Iterator[str]:
    """The recordings that one word names."""
    path = Path(word).expanduser()
    if word.lower().endswith(LIST_SUFFIX) and (is_remote(word) or path.is_file()):
        yield from _listed(word, path)
    elif is_in_object_store(word):
        yield from _remote(word)
    elif "://" in word or word.startswith("sim:") or path.is_file():
        yield word
    elif path.is_dir():
        yield from _some(map(str, _below(path)), word, "contains no recording and no images")
    elif _MAGIC & set(word):
        matches = (each for each in glob.iglob(os.fspath(path), recursive=True))  # noqa: PTH207 - may be absolute
        kept = sorted((Path(each) for each in matches if not _is_result(Path(each))), key=_path_key)
        yield from _some(map(str, kept), word, "matches no file")
    else:
        yield word  # its own failure states what is wrong


def _listed(word: str, path: Path) -> Iterator[str]:
    if is_remote(word):
        files, place = file_system(word)
        with remote_errors(SourceError, f"{word} cannot be read"):
            content = bytes(files.cat_file(place))
        base = word.rsplit("/", 1)[0] + "/"
    else:
        if path.stat().st_size > MAX_LIST_BYTES:
            raise SourceError(f"the list {word} has more than {MAX_LIST_BYTES // 2**30} GiB: split it")
        content = path.read_bytes()
        base = f"{path.parent}{os.sep}" if path.parent != Path() else ""
    try:
        lines = [line.strip() for line in content.decode("utf-8-sig").splitlines()]
    except UnicodeDecodeError:
        raise SourceError(f"the list {word} is not a text in UTF-8: write one input per line") from None
    kept = [line for line in lines if line and not line.startswith("#")]
    inputs = (line if _is_whole(line) else base + line for line in kept)
    yield from _some((text for line in inputs for text in _expand(line)), word, "names no recording")


def _is_whole(line: str) -> bool:
    """Whether a line of a list does not depend on the place of the list."""
    return "://" in line or line.startswith("sim:") or Path(line).expanduser().is_absolute()


def _remote(word: str) -> Iterator[str]:
    files, path = file_system(word)
    scheme = word.partition("://")[0]
    with remote_errors(SourceError, f"{word} cannot be read"):
        if _MAGIC & set(path):
            found = [str(each) for each in files.glob(path)]
        elif PurePosixPath(path).suffix.lower() in (*RECORDING_SUFFIXES, *IMAGE_SUFFIXES):
            found = [path]
        else:
            found = [str(each) for each in files.find(path)]
            done = {each.rsplit("/", 1)[0] for each in found if each.endswith(f"/{SUMMARY}")}
            found = [
                each
                for each in found
                if each.lower().endswith(RECORDING_SUFFIXES)
                and not any(each.startswith(f"{folder}/") for folder in done)
            ]
    yield from _some((f"{scheme}://{each}" for each in sorted(found)), word, "contains no recording")


def _below(folder: Path) -> Iterator[Path]:
    """Recordings and folders of images, in natural order; not those in hidden and in result folders."""
    if _is_result(folder):
        return
    entries = sorted((each for each in folder.iterdir() if not each.name.startswith(".")), key=natural_key)
    if any(each.suffix.lower() in IMAGE_SUFFIXES and each.is_file() for each in entries):
        yield folder
    for entry in entries:
        if entry.is_dir():
            yield from _below(entry)
        elif entry.suffix.lower() in RECORDING_SUFFIXES:
            yield entry


def _is_result(path: Path) -> bool:
    return (path / SUMMARY).is_file() or (path.parent / SUMMARY).is_file()


def _path_key(path: Path) -> list[tuple[list[str | int], str]]:
    return [natural_key(Path(part)) for part in path.parts]


def _some(inputs: Iterator[str], word: str, why_not: str) -> Iterator[str]:
    is_empty = True
    for text in inputs:
        is_empty = False
        yield text
    if is_empty:
        raise SourceError(f"{word!r} {why_not}: give recordings, folders of them, patterns or text lists")


def _identity(text: str) -> str:
    return text if "://" in text or text.startswith("sim:") else os.path.realpath(Path(text).expanduser())
