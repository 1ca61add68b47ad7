"""Reads the arrays of an `.npz` file that may come from someone else: no pickles, and a limit on the unpacked size.

`numpy.load` has no such limit: a file of 3 MB may unpack to 5 GB of zeros, and the header of an array may claim any
size, for which numpy allocates memory before it reads a byte.
"""

from __future__ import annotations

import math
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from foresee_dsl.files import open_outside
from foresee_dsl.limits import most, raised_by

_MOST_MEMBERS = 100
"""Maximum number of arrays in a file. Ours: the file of a trace has nine."""
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""The compression methods that numpy writes."""


def read_arrays(path: Path | BinaryIO) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file by their names.

    Raises:
        ValueError: the file is not an `.npz` file, is damaged, or exceeds the limit `trace` when unpacked.
        OSError: the file cannot be read.
    """
    try:
        with _opened(path) as file, zipfile.ZipFile(file) as packed:
            members = packed.infolist()
            _check(members)
            return {member.filename.removesuffix(".npy"): _array(packed, member) for member in members}
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OverflowError) as err:
        raise ValueError(str(err)) from err


def _opened(file: Path | BinaryIO) -> BinaryIO:
    return open_outside(file, "trace") if isinstance(file, Path) else file


def _check(members: list[zipfile.ZipInfo]) -> None:
    size, allowed = sum(member.file_size for member in members), most("trace") * 1e6
    if size > allowed:
        raise TooLargeError(
            f"it takes {size / 1e6:,.0f} MB when it is unpacked, more than {allowed / 1e6:,.0f} MB; "
            f"{raised_by('trace', size / 1e6)}"
        )
    if len(members) > _MOST_MEMBERS or any(member.compress_type not in _METHODS for member in members):
        raise ValueError("it is compressed with a method that files of traces do not use")


class TooLargeError(ValueError):
    """An array file would take more memory than the limit; the message names the option that allows more."""


def _array(packed: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    with packed.open(member) as stream:
        shape, by_column, dtype = _head(stream)
        count = math.prod(shape)
        if dtype.hasobject or count * dtype.itemsize > member.file_size or min(shape, default=0) < 0:
            raise ValueError(f"its array {member.filename} does not have the size that the header of the array states")
        data = stream.read(count * dtype.itemsize + 1)  # zipfile never returns more than `file_size` bytes
    if len(data) != count * dtype.itemsize:
        raise ValueError(f"its array {member.filename} is cut off, or has too many bytes")
    return np.frombuffer(bytearray(data), dtype).reshape(shape, order="F" if by_column else "C")


def _head(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = npy.read_magic(stream)
    read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
    if read is None:
        raise ValueError(f"one of its arrays has the unsupported format {version}")
    try:
        shape, by_column, dtype = read(stream)
    except (SyntaxError, tokenize.TokenError) as err:  # numpy 2 parses the header as a Python literal
        raise ValueError("the header of an array is damaged") from err
    return shape, by_column, dtype
