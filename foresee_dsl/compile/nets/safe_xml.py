"""Reads XML files that may come from outside: with defusedxml, and within limits of size and depth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.errors import CompileError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by defusedxml


MOST_BYTES = 100_000_000
"""Larger files are refused before they are read. Ours: the largest town of CARLA that we know has 4 MB, a net of a city
some 50 MB; the tree of a file takes ten times its size in memory."""
MOST_DEPTH = 60
"""How deep elements may nest. Ours: OpenDRIVE and OpenSCENARIO come to about 20."""


def parse_net(path: Path) -> Element:
    """Return the root of a SUMO net.

    Raises:
        CompileError: it cannot be read, or is no SUMO net.
    """
    return parse_xml(path, "net", "a SUMO network")


def parse_xml(path: Path, tag: str, what: str) -> Element:
    """Return the root of an XML file.

    Args:
        path: the file.
        tag: what the root element must be called.
        what: what the file should be, for the message: `an OpenDRIVE map`.

    Raises:
        CompileError: it cannot be read, is too large or nested too deeply, is no XML, uses entities, or has another
            root.
    """
    check_size(path)
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException  # here: a net that was read before needs no XML
    from defusedxml.ElementTree import parse

    try:
        root = parse(path).getroot()
    except OSError as err:
        raise CompileError(f"{path} cannot be read: {err.strerror or err}") from err
    except (ParseError, ValueError, LookupError) as err:  # LookupError: an unknown encoding
        detail = "it declares entities" if isinstance(err, DefusedXmlException) else what_is_wrong(err)
        raise CompileError(f"{path} is not {what}: {detail}") from err
    if root is None or root.tag != tag:
        found = "empty" if root is None else f"<{root.tag}>"
        raise CompileError(f"{path} is not {what}: its root is {found}, not <{tag}>")
    if _depth(root) > MOST_DEPTH:
        raise CompileError(f"{path} is not {what}: its elements are nested more than {MOST_DEPTH} deep")
    return root


def what_is_wrong(err: Exception) -> str:
    """Return what an XML parser says of a file, in words: a file that was cut off has `no element found` at its end."""
    line = getattr(err, "position", (0, 0))[0]
    return f"it is cut off at line {line}" if str(err).startswith("no element found") and line else str(err)


def check_size(path: Path) -> None:
    """Make sure that a file may be read into memory.

    Raises:
        CompileError: it cannot be looked at, is no file, or is larger than `MOST_BYTES`.
    """
    try:
        size = path.stat().st_size
    except OSError as err:
        raise CompileError(f"{path} cannot be read: {err.strerror or err}") from err
    if not path.is_file():
        raise CompileError(f"{path} cannot be read: it is no file")
    if size > MOST_BYTES:
        most = MOST_BYTES // 1_000_000
        raise CompileError(
            f"{path} has {size / 1e6:.0f} MB, more than the {most} MB that are read: cut out what you need"
        )


def _depth(root: Element) -> int:
    """How deep elements nest, level by level: nothing recursive, whatever the file holds."""
    depth, level = 0, [root]
    while level and depth <= MOST_DEPTH:
        depth, level = depth + 1, [child for element in level for child in element]
    return depth
