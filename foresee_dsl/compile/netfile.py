"""Reads network files that may come from outside, with a hardened parser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.errors import CompileError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by defusedxml


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
        CompileError: it cannot be read, is no XML, uses entities, or has another root.
    """
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException  # here: a net that was read before needs no XML
    from defusedxml.ElementTree import parse

    try:
        root = parse(path).getroot()
    except OSError as err:
        raise CompileError(f"{path} cannot be read: {err.strerror or err}") from err
    except (ParseError, ValueError, LookupError) as err:  # LookupError: an unknown encoding
        detail = "it declares entities" if isinstance(err, DefusedXmlException) else str(err)
        raise CompileError(f"{path} is not {what}: {detail}") from err
    if root is None or root.tag != tag:
        found = "empty" if root is None else f"<{root.tag}>"
        raise CompileError(f"{path} is not {what}: its root is {found}, not <{tag}>")
    return root
