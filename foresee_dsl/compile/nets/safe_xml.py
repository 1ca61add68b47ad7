"""Reads XML that comes from outside: no entities, nothing fetched, and no more of it than a machine can hold."""

from __future__ import annotations

from io import RawIOBase
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, cast

from foresee_dsl.errors import CompileError, ForeseeError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by defusedxml

MOST_BYTES = 100_000_000
"""Larger files are refused before they are read. Ours: an OpenStreetMap extract of a town's centre has 5 to 30 MB, the
largest town of CARLA that we know 4 MB, a net of a city some 50 MB; the tree of a file takes ten times its size."""
MOST_ELEMENTS = 2_000_000
"""Ours: an element takes some 300 bytes in memory, so about 600 MB; an extract of 100 MB has some 1.5 million."""
_GZIP = b"\x1f\x8b"
DEEPEST = 100
"""How deep elements may nest. Ours: OpenSCENARIO nests about 25 deep, OpenDRIVE 10, OpenStreetMap 3."""


def parse_net(path: Path) -> Element:
    """Return the root of a SUMO net, as `parse_xml` does."""
    return parse_xml(path, "net", "a SUMO network")


def parse_xml(path: Path, tag: str, what: str, error: type[ForeseeError] = CompileError) -> Element:
    """Return the root of an XML file, which must be called `tag`; `what` it should be is for messages: `an OpenDRIVE
    map`.

    An `error` where it cannot be read, is too large or too deep, is no XML, declares entities, or has another root.
    """
    check_size(path, error)
    import zlib
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException  # here: a net that was read before needs no XML

    try:
        root = _parsed(path, error)
    except OSError as err:
        raise error(f"{path} cannot be read: {err.strerror or err}") from err
    except DefusedXmlException as err:
        raise error(f"{path} declares entities, which are not read: write them out") from err
    except (ParseError, ValueError, LookupError, EOFError, zlib.error) as err:  # LookupError: an unknown encoding
        # a file that was cut off has `no element found` at its end
        line = getattr(err, "position", (0, 0))[0]
        cut_off = line and str(err).startswith("no element found")
        fault = f"it is cut off at line {line}" if cut_off else str(err)
        raise error(f"{path} is not {what}, or a damaged one: {fault}") from err
    if root.tag.startswith("{") and root.tag.endswith(f"}}{tag}"):  # files may name their schema, or not
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]
    if root.tag != tag:
        raise error(f"{path} is not {what}: its root is <{root.tag}>, not <{tag}>")
    return root


def check_size(path: Path, error: type[ForeseeError] = CompileError) -> None:
    """Make sure that a file may be read into memory: it is there, a file, and no larger than `MOST_BYTES`."""
    try:
        size = path.stat().st_size
    except OSError as err:
        raise error(f"{path} cannot be read: {err.strerror or err}") from err
    if not path.is_file():
        raise error(f"{path} cannot be read: it is no file")
    if size > MOST_BYTES:
        raise error(
            f"{path} has {size / 1e6:.0f} MB, more than the {MOST_BYTES / 1e6:.0f} MB that are read: "
            "cut out the part that is needed"
        )


def open_packed(path: Path, error: type[ForeseeError] = CompileError) -> BinaryIO:
    """Open a file; one that gzip has packed is unpacked while it is read, up to `MOST_BYTES`."""
    with path.open("rb") as file:
        packed = file.read(2) == _GZIP
    return cast(BinaryIO, _Unpacked(path, error)) if packed else path.open("rb")


def unpacked(path: Path, error: type[ForeseeError] = CompileError) -> bytes:
    """Return a file's bytes, unpacked where gzip has packed them."""
    with open_packed(path, error) as file:
        return file.read()


class _Unpacked(RawIOBase):
    """A packed file that is larger than it seems is refused."""

    def __init__(self, path: Path, error: type[ForeseeError]) -> None:
        from gzip import GzipFile  # a check of files reads none that is packed

        self._file = GzipFile(path)
        self._path, self._error, self._read = path, error, 0

    def close(self) -> None:
        self._file.close()
        super().close()

    def read(self, size: int | None = -1) -> bytes:
        most = MOST_BYTES - self._read + 1
        data = self._file.read(most if size is None or size < 0 else min(size, most))
        self._read += len(data)
        if self._read > MOST_BYTES:
            raise self._error(f"{self._path} has more than {MOST_BYTES / 1e6:.0f} MB when it is unpacked: cut out the "
                              "part that is needed")  # fmt: skip
        return data


def _parsed(path: Path, error: type[ForeseeError]) -> Element:
    """Parse a file, watching its depth and its size in memory while it grows."""
    from defusedxml.ElementTree import iterparse

    depth = count = 0
    root: Element | None = None
    with open_packed(path, error) as file:
        for event, element in iterparse(file, events=("start", "end")):
            if event == "end":
                depth -= 1
                continue
            root = element if root is None else root
            depth, count = depth + 1, count + 1
            if depth > DEEPEST:
                raise error(f"{path} nests more than {DEEPEST} elements in each other")
            if count > MOST_ELEMENTS:
                raise error(f"{path} has more than {MOST_ELEMENTS:,} elements: cut out the part that is needed")
    if root is None:
        raise ValueError("it is empty")
    return root
