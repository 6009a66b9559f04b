"""Files of object stores and web servers, through fsspec."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

from manytouch.errors import ManytouchError, MissingExtraError, SourceError, without_password
from manytouch.sources.files.images import IMAGE_SUFFIXES
from manytouch.sources.files.video import VIDEO_SUFFIXES

RECORDING_SUFFIXES = (".mcap", *VIDEO_SUFFIXES)
OBJECT_STORES = {"s3": "s3fs", "gs": "gcsfs", "gcs": "gcsfs"}
"""Package that fsspec needs, by the scheme of an address."""
WEB = {"http": "aiohttp", "https": "aiohttp"}


def is_remote(text: str) -> bool:
    """Whether a text is the address of an object, a prefix, or a file on a web server, which are copied.

    Addresses of live streams are not.
    """
    scheme = urlsplit(text).scheme if "://" in text else ""
    if scheme in WEB:
        suffix = PurePosixPath(urlsplit(text).path).suffix.lower()
        return suffix in (".txt", *RECORDING_SUFFIXES, *IMAGE_SUFFIXES)
    return scheme in OBJECT_STORES


def is_in_object_store(text: str) -> bool:
    """Whether a text is the address of an object or of a prefix in an object store."""
    scheme, separator, _ = text.partition("://")
    return bool(separator) and scheme in OBJECT_STORES


def remote_name(url: str) -> str:
    """Path of an address; results are named after it."""
    return urlsplit(url).path


def file_system(url: str) -> tuple[Any, str]:
    """The file system of an address, and the path in it.

    Raises:
        MissingExtraError: its package is not installed.
    """
    package = (OBJECT_STORES | WEB)[urlsplit(url).scheme]
    try:
        import fsspec

        files, path = fsspec.core.url_to_fs(url)
    except ImportError:
        raise MissingExtraError(f"reading and writing {without_password(url)}", package, "batch") from None
    return files, str(path)


def remote_stamp(url: str) -> str | None:
    """Size and version (ETag or time) of an object as one text, which differs once the object has changed.

    None if the server does not state a version.
    """
    files, path = file_system(url)
    with remote_errors(SourceError, f"{without_password(url)} cannot be read"):
        files.invalidate_cache()
        found = files.info(path)
    stated = [found.get(key) for key in ("ETag", "etag", "LastModified", "mtime", "updated", "md5Hash")]
    return None if not any(stated) else f"{found.get('size')} {stated}"


def download(url: str, folder: Path) -> Path:
    """Copy an object to a folder.

    Raises:
        SourceError: it does not exist or cannot be read.
    """
    files, path = file_system(url)
    local = folder / PurePosixPath(remote_name(url)).name
    try:
        with remote_errors(SourceError, f"{without_password(url)} cannot be read"):
            files.get_file(path, str(local))
    except FileNotFoundError:
        raise SourceError(f"there is no {without_password(url)}: check the address") from None
    return local


@contextmanager
def remote_errors(kind: type[ManytouchError], words: str) -> Iterator[None]:
    """Report any failure of a transfer as one sentence; a missing object stays a FileNotFoundError."""
    try:
        yield
    except (FileNotFoundError, ManytouchError):
        raise
    except Exception as error:
        cause = without_password(" ".join(str(error).split())) or type(error).__name__
        raise kind(f"{words}: {cause}; check the address, the connection and the credentials") from error
