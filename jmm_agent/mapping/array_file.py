"""Files of named arrays (.npz without pickle): written whole, and read within declared limits.

An archive's directory and each array's header are compared with each other and with a limit before
anything is unfolded, so that a small file cannot fill the memory.
"""

from __future__ import annotations

import math
import os
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from jmm_agent.errors import AgentError
from mjcf_sandbox.files import whole_file

KINDS = "biufU"
"""Kinds of the elements that a file may hold: truth values, numbers and text."""

MIB = 1 << 20

Arrays = dict[str, NDArray[Any]]


class ArrayFileError(AgentError):
    """A file that does not hold arrays, or more than it may."""


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays to a file, whole or not at all.

    Args:
        path: of the file; its folder is made.
        arrays: by name.
    """
    with whole_file(Path(path)) as beside, beside.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def read_arrays(path: str | os.PathLike[str], most_bytes: int) -> Arrays:
    """Read the arrays of a file that `write_arrays` wrote.

    Args:
        path: of the file.
        most_bytes: that the arrays of the file may take together.

    Returns:
        Arrays by name.

    Raises:
        ArrayFileError: the file is missing, damaged, or holds more or something else.
    """
    if not os.path.isfile(path):  # also where its name is too long
        raise ArrayFileError("there is no such file")
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            _check_directory(members, most_bytes)
            return {
                member.filename.removesuffix(".npy"): _read_array(archive, member)
                for member in members
            }
    except ArrayFileError:
        raise
    except Exception as error:  # zipfile and NumPy raise errors of many types for a damaged file
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise ArrayFileError(f"it is cut off or damaged: {reason}") from error


def _check_directory(members: list[zipfile.ZipInfo], most_bytes: int) -> None:
    """Refuse an archive that declares too much, or is packed in a way that cannot be limited."""
    size = sum(member.file_size for member in members)
    if size > most_bytes:
        raise ArrayFileError(
            f"it unfolds into {size / MIB:.0f} MiB, and {most_bytes / MIB:.0f} are allowed"
        )
    if len({member.filename for member in members}) < len(members):
        raise ArrayFileError("it holds two arrays of the same name")
    for member in members:
        # zipfile unfolds other methods without a limit.
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ArrayFileError(f"{member.filename} is packed by a method that is not deflate")


def _read_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    """One array, whose header must declare just as many bytes as the archive does."""
    with archive.open(member) as packed:
        stream = BytesIO(packed.read(member.file_size))
    version = npy.read_magic(stream)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read_header(stream)
    if dtype.kind not in KINDS or dtype.itemsize == 0:
        raise ArrayFileError(f"{member.filename} holds {dtype}, which is no number and no text")
    size = len(stream.read())
    if math.prod(shape) * dtype.itemsize != size:
        raise ArrayFileError(
            f"{member.filename} has {size} bytes, but its header declares {dtype} of shape {shape}"
        )
    stream.seek(0)
    return np.asarray(npy.read_array(stream, allow_pickle=False))
