"""Reads XML that comes from outside: no entities, nothing fetched, and no more of it than a machine can hold."""

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
"""Ours: an element takes some 300 bytes in memory, so about 600 MB; an extract of 100 MB has some 1.5 million."""
MOST_ATTRIBUTES = 10_000_000
"""Ours: an attribute takes some 85 bytes in memory, so about 850 MB; an extract of 100 MB has some 6 million."""
LONGEST_BYTES = 4_000_000
"""The most bytes of one element's attributes, one text or one comment. Ours: the longest tag of three nets of cities
has 4.4 kB. Expat 2.5 reads such a piece from its beginning for each block of the file that arrives: 50 MB took 90 s."""
_GZIP = b"\x1f\x8b"
_BLOCK_BYTES = 1 << 16
"""Ours: half of the time that blocks of 16 kB take where a piece is long, and no difference elsewhere."""
DEEPEST = 100
"""How deep elements may nest. Ours: OpenSCENARIO nests about 25 deep, OpenDRIVE 10, OpenStreetMap 3."""
_FILE_IN_PROJECTION = re.compile(
    r"(?:\binit|grids|\bfile|\bcatalog)\s*=[^\s+]*[/\\]|PARAMETERFILE\[[^\]]*[/\\]", re.IGNORECASE
)
"""A path in a text that describes a projection: PROJ opens the file. Names without a folder are PROJ's own data."""


def parse_net(path: Path) -> Element:
    """Return the root of a SUMO net, as `parse_xml` does."""
    return parse_xml(path, "net", "a SUMO network")


def parse_xml(path: Path, tag: str, what: str, error: type[ForeseeError] = CompileError) -> Element:
    """Return the root of an XML file, which must be called `tag`; `what` it should be is for messages: `an OpenDRIVE
    map`.

    An `error` where it cannot be read, is too large or too deep, is no XML, declares entities, or has another root.
    """
    with _as_errors(path, what, error):
        root, *_ = _pieces_of(path, error, keep=True)
    if root.tag.startswith("{") and root.tag.endswith(f"}}{tag}"):  # files may name their schema, or not
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]
    _check_root(path, root, tag, what, error)
    return root


def children_of(path: Path, tag: str, what: str, error: type[ForeseeError] = CompileError) -> Iterator[Element]:
    """Yield the elements below the root of an XML file, each with what is in it, and then forget it.

    So the file may have more elements than memory has room for; the rest is as of `parse_xml`.
    """
    with _as_errors(path, what, error):
        pieces = _pieces_of(path, error, keep=False)
        _check_root(path, next(pieces), tag, what, error)
        for element in pieces:
            element.tag = element.tag.rpartition("}")[2]
            yield element


def _check_root(path: Path, root: Element, tag: str, what: str, error: type[ForeseeError]) -> None:
    if root.tag.rpartition("}")[2] != tag:
        raise error(f"{path} is not {what}: its root is <{root.tag}>, not <{tag}>")


@contextmanager
def _as_errors(path: Path, what: str, error: type[ForeseeError]) -> Iterator[None]:
    """Turn what is raised while a file is read into an `error` that names the file."""
    import zlib
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException  # here: a net that was read before needs no XML

    try:
        yield
    except OSError as err:
        raise unreadable(path, err, error) from err
    except DefusedXmlException as err:
        raise error(f"{path} declares entities, which are not read: write them out") from err
    except (ParseError, ValueError, LookupError, EOFError, zlib.error) as err:  # LookupError: an unknown encoding
        # a file that was cut off has `no element found` at its end
        line = getattr(err, "position", (0, 0))[0]
        cut_off = line and str(err).startswith("no element found")
        fault = f"it is cut off at line {line}" if cut_off else str(err)
        raise error(f"{path} is not {what}, or a damaged one: {fault}") from err


def unreadable(path: Path, err: OSError, error: type[ForeseeError] = CompileError) -> ForeseeError:
    """Return the error for a file that cannot be opened, or is too large."""
    advice = ", or cut out the part that is needed" if err.errno == errno.EFBIG else ""
    return error(f"{path} cannot be read: {err.strerror or err}{advice}")


def open_packed(path: Path, error: type[ForeseeError] = CompileError) -> BinaryIO:
    """Open a file; one that gzip has packed is unpacked while it is read, up to the limit `file`."""
    file = open_outside(path)
    packed = file.read(len(_GZIP)) == _GZIP
    file.seek(0)
    return cast(BinaryIO, _Unpacked(path, file, error)) if packed else file


def unpacked(path: Path, error: type[ForeseeError] = CompileError) -> bytes:
    """Return a file's bytes, unpacked where gzip has packed them."""
    with open_packed(path, error) as file:
        return file.read()


class _Unpacked(RawIOBase):
    """A packed file that is larger than it seems is refused."""

    def __init__(self, path: Path, packed: BinaryIO, error: type[ForeseeError]) -> None:
        from gzip import GzipFile  # a check of files reads none that is packed

        self._packed, self._file = packed, GzipFile(fileobj=packed)
        self._path, self._error, self._read = path, error, 0

    def close(self) -> None:
        self._file.close()
        self._packed.close()
        super().close()

    def read(self, size: int | None = -1) -> bytes:
        rest = round(most("file") * 1e6) - self._read + 1
        data = self._file.read(rest if size is None or size < 0 else min(size, rest))
        self._read += len(data)
        if len(data) == rest:
            raise self._error(
                f"{self._path} has more than {most('file'):g} MB when it is unpacked: cut out the part that is needed; "
                f"{raised_by('file')}"
            )
        return data


class _Pieces:
    """A file that is handed to the parser block by block, as long as its pieces end: tags, texts and comments."""

    def __init__(self, path: Path, file: BinaryIO, error: type[ForeseeError]) -> None:
        self._path, self._file, self._error = path, file, error
        self.pending = 0
        """Bytes since the last tag that the parser has understood."""

    def read(self, _: int = 0, /) -> bytes:
        """Return the next block, of our size."""
        if self.pending > LONGEST_BYTES:
            raise self._error(f"{self._path} has a tag, a text or a comment of more than {LONGEST_BYTES / 1e6:.0f} MB")
        data = self._file.read(_BLOCK_BYTES)
        self.pending += len(data)
        return data


def _pieces_of(path: Path, error: type[ForeseeError], *, keep: bool) -> Iterator[Element]:
    """Parse a file, watching its depth and its size in memory while it grows; yield its root, then what is below that.

    `keep`: the root keeps what is below it.
    """
    from defusedxml.ElementTree import iterparse

    depth = count = attributes = 0
    root: Element | None = None
    with open_packed(path, error) as file:
        pieces = _Pieces(path, file, error)
        for event, element in iterparse(pieces, events=("start", "end")):
            pieces.pending = 0
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
    """Refuse what makes SUMO 1.28 open other files while it reads this one: inclusions, and grids of projections."""
    tag = element.tag
    if tag.endswith("include"):
        named = element.get("file") or element.get("href") or ""
        raise error(f"{path} includes another file ({named!r}), which is not opened: write what it holds in its place")
    if tag.endswith(("geoReference", "location")):
        found = _FILE_IN_PROJECTION.search(element.get("projParameter") or element.text or "")
        if found:
            raise error(f"{path} has a projection that reads a file of this machine ({found[0]!r}), which is not "
                        "opened: leave that out, or name the file without its folder")  # fmt: skip
