"""Reads XML that comes from outside: no entities, nothing fetched, and no more of it than a machine can hold."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.compile.foreign.opendrive_geometry import plain_number
from foresee_dsl.compile.nets.safe_xml import what_is_wrong
from foresee_dsl.exchange.outcome import ExchangeError

if TYPE_CHECKING:
    from collections.abc import Collection
    from xml.etree.ElementTree import Element  # the type only; files are parsed by defusedxml

MOST_BYTES = 100_000_000
"""Ours: an extract of a town's centre has 5 to 30 MB; more is a district that nobody tests in one scenario."""
MOST_ELEMENTS = 2_000_000
"""Ours: an element takes some 300 bytes in memory, so about 600 MB; an extract of 100 MB has some 1.5 million."""
DEEPEST = 100
"""Ours: OpenSCENARIO nests about 25 deep, OpenDRIVE 10, OSM 3."""


def read_xml(path: Path, roots: Collection[str], what: str) -> Element:
    """Return the root of a foreign XML file.

    Args:
        path: the file.
        roots: what the root element may be called.
        what: what the file should be, for messages: `an OpenSCENARIO file`.

    Raises:
        ExchangeError: it cannot be read, is too large or too deep, is no XML, declares entities, or has another root.
    """
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException

    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise ExchangeError(
                f"{path} has {size / 1e6:.0f} MB, more than the {MOST_BYTES / 1e6:.0f} MB that are read: "
                "cut out the part that is needed"
            )
        root = _parsed(path)
    except OSError as err:
        raise ExchangeError(f"{path} cannot be read: {err.strerror or err}") from err
    except DefusedXmlException as err:
        raise ExchangeError(f"{path} declares entities, which are not read: write them out") from err
    except (ParseError, ValueError, LookupError) as err:  # LookupError: an unknown encoding
        raise ExchangeError(f"{path} is not {what}, or a damaged one: {what_is_wrong(err)}") from err
    if root.tag not in roots:
        raise ExchangeError(f"{path} is not {what}: its root is <{root.tag}>, not <{' or <'.join(roots)}>")
    return root


def number(element: Element, name: str, default: float | None = None) -> float:
    """Return an attribute as a number.

    Raises:
        ExchangeError: it is missing (and there is no default), no number, or larger than anything that is meant.
    """
    try:
        return plain_number(element, name, default)
    except ValueError as err:
        raise ExchangeError(f"the {err}") from err


def _parsed(path: Path) -> Element:
    """Parse a file, watching its depth and its size in memory while it grows."""
    from defusedxml.ElementTree import iterparse

    depth = count = 0
    root: Element | None = None
    with path.open("rb") as file:
        for event, element in iterparse(file, events=("start", "end")):
            if event == "end":
                depth -= 1
                continue
            root = element if root is None else root
            depth, count = depth + 1, count + 1
            if depth > DEEPEST:
                raise ExchangeError(f"{path} nests more than {DEEPEST} elements in each other")
            if count > MOST_ELEMENTS:
                raise ExchangeError(f"{path} has more than {MOST_ELEMENTS:,} elements: cut out the part that is needed")
    if root is None:
        raise ValueError("it is empty")
    return root
