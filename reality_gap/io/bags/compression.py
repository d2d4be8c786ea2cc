"""Decompression of what can be decompressed of cut off or damaged data."""

from __future__ import annotations

import bz2
import sys
from collections.abc import Callable, Iterable
from typing import Any, BinaryIO

PIECE = 1 << 16
"""Number of bytes that are decompressed at once; nothing of a damaged piece is kept."""


class CompressionError(ValueError):
    """An unknown kind of compression, as a sentence."""


def expand(kind: str, data: bytes, limit: int) -> tuple[bytes, bool]:
    """Decompress data as far as possible.

    Args:
        kind: "bz2", "lz4" or "zstd".
        data: compressed data.
        limit: largest number of bytes to return.

    Returns:
        The bytes, and whether the data were whole.

    Raises:
        CompressionError: the kind is unknown.
    """
    found = bytearray()
    pieces = (data[i : i + PIECE] for i in range(0, len(data), PIECE))
    whole = _expand(kind, pieces, found.extend, limit)
    return bytes(found), whole


def expand_file(kind: str, source: BinaryIO, target: BinaryIO, limit: int) -> bool:
    """Decompress a file as far as possible, and return whether it was whole.

    Args:
        kind: "bz2", "lz4" or "zstd".
        source: the file, open for reading.
        target: a file, open for writing.
        limit: largest number of bytes to write.

    Raises:
        CompressionError: the kind is unknown.
    """
    return _expand(kind, iter(lambda: source.read(PIECE), b""), target.write, limit)


def _expand(
    kind: str, pieces: Iterable[bytes], write: Callable[[bytes], object], limit: int
) -> bool:
    """Decompress pieces, which may hold several frames, and return whether they were whole."""
    opened, damaged = _library(kind)
    decompressor = opened()
    for piece in pieces:
        while piece or not (decompressor.eof or decompressor.needs_input):
            if decompressor.eof:
                decompressor = opened()
            try:
                found = decompressor.decompress(piece, limit)
            except damaged:
                return False
            write(found)
            limit -= len(found)
            if limit <= 0:
                return bool(decompressor.eof)
            piece = decompressor.unused_data if decompressor.eof else b""
    return bool(decompressor.eof)


def _library(kind: str) -> tuple[Callable[[], Any], tuple[type[Exception], ...]]:
    """Return what makes a decompressor, and the errors that it raises for damaged data."""
    if kind == "bz2":
        return bz2.BZ2Decompressor, (OSError, ValueError, EOFError)
    if kind == "lz4":
        import lz4.frame

        return lz4.frame.LZ4FrameDecompressor, (RuntimeError, EOFError)
    if kind == "zstd":
        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd
        return zstd.ZstdDecompressor, (zstd.ZstdError, EOFError)
    raise CompressionError(f"the compression {kind!r} is unknown; valid are bz2, lz4, zstd")
