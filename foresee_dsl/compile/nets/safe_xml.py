"""Reads foreign XML safely: rejects entities, opens no other files, and limits the memory that it takes."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager
from io import RawIOBase
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, cast

from foresee_dsl.errors import CompileError, ForeseeError
from foresee_dsl.files import open_outside
from foresee_dsl.limits import most, raised_by

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by defusedxml

MOST_ELEMENTS = 2_000_000
"""Maximum number of elements. Ours: an element takes some 300 bytes, so all elements take about 600 MB; an extract of
100 MB has some 1.5 million elements.
"""
MOST_ATTRIBUTES = 10_000_000
"""Maximum number of attributes. Ours: an attribute takes some 85 bytes, so all attributes take about 850 MB; an extract
of 100 MB has some 6 million attributes.
"""
LONGEST_BYTES = 4_000_000
"""Maximum size of one tag, text or comment, bytes. Ours: the longest tag in the nets of three cities has 4.4 kB. Expat
2.5 reads such a piece again from its beginning for each block of the file: 50 MB took 90 s."""
_GZIP = b"\x1f\x8b"
_BLOCK_BYTES = 1 << 16
"""Size of a block, bytes. Ours: parsing long pieces takes half the time that it takes with blocks of 16 kB, and parsing
others takes the same time.
"""
DEEPEST = 100
"""Maximum depth of nested elements. Ours: elements are nested about 25 deep in OpenSCENARIO, 10 deep in OpenDRIVE and 3
deep in OpenStreetMap.
"""
_FILE_IN_PROJECTION = re.compile(
    r"(?:\binit|grids|\bfile|\bcatalog)\s*=[^\s+]*[/\\]|PARAMETERFILE\[[^\]]*[/\\]", re.IGNORECASE
)
"""A path in the description of a projection, which PROJ would open. Names without a folder are PROJ's own data."""


def parse_net(path: Path) -> Element:
    """Return the root of a SUMO net, as `parse_xml` does."""
    return parse_xml(path, "net", "a SUMO network")


def parse_xml(path: Path, tag: str, what: str, error: type[ForeseeError] = CompileError) -> Element:
    """Return the root of an XML file, which must have the name `tag`; `what` names the format in messages: `an
    OpenDRIVE map`.

    Raises:
        error: the file cannot be read, is too large or too deep, is not XML, declares entities, or has another root.
    """
    with _as_errors(path, what, error):
        root, *_ = _pieces_of(path, error, keep=True)
    if root.tag.startswith("{") and root.tag.endswith(f"}}{tag}"):  # files may name their schema, or not
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]
    _check_root(path, root, tag, what, error)
    return root


def children_of(
    path: Path, tag: str, what: str, error: type[ForeseeError] = CompileError, limit: str | None = "file"
) -> Iterator[Element]:
    """Yield the elements below the root of an XML file, each with its contents, and then release their memory.

    The file may therefore have more elements than fit into memory; otherwise it works as `parse_xml`.

    Args:
        limit: None for a file of any size.
    """
    with _as_errors(path, what, error):
        pieces = _pieces_of(path, error, keep=False, limit=limit)
        _check_root(path, next(pieces), tag, what, error)
        for element in pieces:
            element.tag = element.tag.rpartition("}")[2]
            yield element


def _check_root(path: Path, root: Element, tag: str, what: str, error: type[ForeseeError]) -> None:
    if root.tag.rpartition("}")[2] != tag:
        raise error(f"{path} is not {what}: its root is <{root.tag}>, not <{tag}>")


@contextmanager
def _as_errors(path: Path, what: str, error: type[ForeseeError]) -> Iterator[None]:
    """Convert exceptions from reading a file to an `error` that names the file."""
    import zlib
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException  # imported here: a cached net needs no XML parser

    try:
        yield
    except OSError as err:
        raise unreadable(path, err, error) from err
    except DefusedXmlException as err:
        raise error(f"{path} declares entities, which are not read: write them out") from err
    except (ParseError, ValueError, LookupError, EOFError, zlib.error) as err:  # an unknown encoding raises LookupError
        # the parser reports `no element found` at the end of a truncated file
        line = getattr(err, "position", (0, 0))[0]
        cut_off = line and str(err).startswith("no element found")
        fault = f"it is cut off at line {line}" if cut_off else str(err)
        raise error(f"{path} is not {what}, or a damaged one: {fault}") from err


def unreadable(path: Path, err: OSError, error: type[ForeseeError] = CompileError) -> ForeseeError:
    """Return the error for a file that cannot be opened or is too large."""
    advice = ", or cut out the part that is needed" if err.errno == errno.EFBIG else ""
    return error(f"{path} cannot be read: {err.strerror or err}{advice}")


def open_packed(path: Path, error: type[ForeseeError] = CompileError, limit: str | None = "file") -> BinaryIO:
    """Open a file; a file in gzip format is decompressed while it is read, up to the limit (None: of any size)."""
    file = open_outside(path, limit)
    packed = file.read(len(_GZIP)) == _GZIP
    file.seek(0)
    return cast(BinaryIO, _Unpacked(path, file, error, limit)) if packed else file


def unpacked(path: Path, error: type[ForeseeError] = CompileError) -> bytes:
    """Return a file's bytes, decompressed if the file is in gzip format."""
    with open_packed(path, error) as file:
        return file.read()


class _Unpacked(RawIOBase):
    """A decompressing file, which raises an error beyond a limit."""

    def __init__(self, path: Path, packed: BinaryIO, error: type[ForeseeError], limit: str | None) -> None:
        from gzip import GzipFile  # imported here: most commands read no compressed file

        self._packed, self._file = packed, GzipFile(fileobj=packed)
        self._path, self._error, self._read, self._limit = path, error, 0, limit

    def readable(self) -> bool:
        return True

    def close(self) -> None:
        self._file.close()
        self._packed.close()
        super().close()

    def read(self, size: int | None = -1) -> bytes:
        if self._limit is None:
            return self._file.read(size)
        rest = round(most(self._limit) * 1e6) - self._read + 1
        data = self._file.read(rest if size is None or size < 0 else min(size, rest))
        self._read += len(data)
        if len(data) == rest:
            raise self._error(
                f"{self._path} has more than {most(self._limit):g} MB when it is unpacked: cut out the part that is "
                f"needed; {raised_by(self._limit)}"
            )
        return data


class _FileInBlocks:
    """A file for the parser, in blocks; it raises an error if a tag, text or comment is longer than `LONGEST_BYTES`."""

    def __init__(self, path: Path, file: BinaryIO, error: type[ForeseeError]) -> None:
        self._path, self._file, self._error = path, file, error
        self.pending = 0
        """Number of bytes since the last complete tag."""

    def read(self, _: int = 0, /) -> bytes:
        """Return the next block of `_BLOCK_BYTES`; the parser's size is ignored."""
        if self.pending > LONGEST_BYTES:
            raise self._error(f"{self._path} has a tag, a text or a comment of more than {LONGEST_BYTES / 1e6:.0f} MB")
        data = self._file.read(_BLOCK_BYTES)
        self.pending += len(data)
        return data


def _pieces_of(path: Path, error: type[ForeseeError], *, keep: bool, limit: str | None = "file") -> Iterator[Element]:
    """Parse a file, and check its depth and size meanwhile; yield its root, then the elements below the root.

    `keep`: the root keeps these elements.
    """
    from defusedxml.ElementTree import iterparse

    depth = count = attributes = 0
    root: Element | None = None
    with open_packed(path, error, limit) as file:
        blocks = _FileInBlocks(path, file, error)
        for event, element in iterparse(blocks, events=("start", "end")):
            blocks.pending = 0
            if event == "end":
                depth -= 1
                _check_opens_none(element, path, error)
                if depth == 1:
                    yield element
                if depth == 1 and not keep and root is not None:
                    root.clear()
                    count = attributes = 0
                continue
            if root is None:
                root = element
                yield root
            depth, count, attributes = depth + 1, count + 1, attributes + len(element.attrib)
            if depth > DEEPEST:
                raise error(f"{path} nests more than {DEEPEST} elements in each other")
            if count > MOST_ELEMENTS:
                raise error(f"{path} has more than {MOST_ELEMENTS:,} elements: {_advice(root)}")
            if attributes > MOST_ATTRIBUTES:
                raise error(f"{path} has more than {MOST_ATTRIBUTES:,} attributes: {_advice(root)}")
    if root is None:
        raise ValueError("it is empty")


def _advice(root: Element) -> str:
    how = " by `foresee import sumo FILE --around X,Y,RADIUS`" if root.tag.endswith("net") else ""
    return f"cut out the part that is needed{how}"


def _check_opens_none(element: Element, path: Path, error: type[ForeseeError]) -> None:
    """Check an element for files that SUMO 1.28 would open: inclusions and grids of projections."""
    tag = element.tag
    if tag.endswith("include"):
        named = element.get("file") or element.get("href") or ""
        raise error(
            f"{path} includes another file ({named!r}), which is not opened: replace the inclusion by the "
            "contents of that file"
        )
    if tag.endswith(("geoReference", "location")):
        file = _FILE_IN_PROJECTION.search(element.get("projParameter") or element.text or "")
        if file:
            raise error(f"{path} has a projection that reads a file of this machine ({file[0]!r}), which is not "
                        "opened: leave that out, or name the file without its folder")  # fmt: skip
