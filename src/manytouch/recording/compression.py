"""Compression with zstd; sizes stated in a file are checked before they are allocated."""

from manytouch.limits import MAX_MESSAGE_BYTES

LEVEL = 9  # 3 % smaller than the default level for readings


def compressed(data: bytes) -> bytes:
    """Data compressed with zstd."""
    import zstandard

    return zstandard.compress(data, level=LEVEL)


def decompressed(compression: str, data: bytes, size: int) -> bytes:
    """Data of a stated size.

    Args:
        compression: as MCAP names it, "zstd" or "" for none.
        data: compressed.
        size: in bytes, as stated in the file.

    Raises:
        ValueError: the size is wrong or too large, the data are damaged, or the compression is another one.
    """
    import zstandard

    if type(size) is not int or not 0 <= size <= MAX_MESSAGE_BYTES:
        raise ValueError(f"{size!r} bytes are stated, and at most {MAX_MESSAGE_BYTES} are read")
    if compression == "":
        found = bytes(data)
    elif compression == "zstd":
        try:
            if zstandard.frame_content_size(data) != size:
                raise ValueError(f"the compressed data have another size than the stated {size} bytes")
            found = zstandard.ZstdDecompressor().decompress(data) if size else b""
        except zstandard.ZstdError as error:
            raise ValueError(f"the compressed data are damaged: {error}") from error
    else:
        raise ValueError(f"the compression {compression[:20]!r} is unknown")
    if len(found) != size:
        raise ValueError(f"{len(found)} bytes instead of the stated {size}")
    return found
