"""Names, sentences and numbers from other tools, as the language can express them."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Collection
from decimal import Decimal
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign import opendrive_geometry
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.model import Quantity
from foresee_dsl.language.units import Dimension

_LONGEST = 40
"""Ours: half of what the language allows, so that campaigns can add to it."""
_LONGEST_FILE_NAME = 120
"""Ours: most file systems allow 255 bytes, which a letter may have four of."""
_LONGEST_ID = 200
_ID = re.compile(rf'[^"\n\r\\]{{1,{_LONGEST_ID}}}')
"""What `language.model.values.Id` allows."""
_LONGEST_SENTENCE = 300
"""Ours: what is read at a glance."""
DIGITS = 4
"""Decimals of metres, m/s and degrees, as in clips: they rebuild a run exactly."""
_LARGEST = 1e7
"""In SI: map projections come to 1e7 m (ours)."""


def name_of(text: str, otherwise: str) -> str:
    """Return the snake_case name nearest to a text: `NPC Car-1` is `npc_car_1`.

    `otherwise` stands in front when the text begins with no letter, and alone when nothing is left of it.
    """
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", plain).lower()
    name = re.sub(r"[^a-z0-9]+", "_", words).strip("_")[:_LONGEST].strip("_")
    if not name or not name[0].isalpha():
        name = f"{otherwise}_{name}".strip("_")
    return f"{name}_{otherwise}" if name in KEYWORDS else name


def sentence(text: str) -> str:
    """Return a text as a `doc` can hold it: on one line, without double quotes, not too long."""
    return " ".join(re.sub(r"[\x00-\x1f\x7f]", " ", text.replace('"', "'")).split())[:_LONGEST_SENTENCE]


def file_name(name: str) -> str:
    """Return a file's name as a scenario can say it in double quotes; nearly all names are that already."""
    return re.sub(r'["\x00-\x1f\x7f]', "_", name)[-_LONGEST_FILE_NAME:]


def check_network(network: Topology, where: str) -> None:
    """Make sure that cars can drive on a network, and that the language can express its ids; `where` is its file.

    Raises:
        ExchangeError: no lane is for cars, or the id of an edge or junction holds a double quote, a backslash or a line
            break, or is longer than 200 letters.
    """
    if not any(edge.for_kind("car") for edge in network.edges.values()):
        raise ExchangeError(f"{where} has no lanes for cars: nobody could drive on it")
    for name in (*network.edges, *network.junctions):
        if not _ID.fullmatch(name):
            shown = f"'{name[:40]}...' ({len(name)} letters)" if len(name) > _LONGEST_ID else repr(name)
            raise ExchangeError(
                f"{where} calls an edge or junction {shown}, which the language cannot express: ids have at most "
                f"{_LONGEST_ID} letters, and no double quotes, backslashes or line breaks; rename it there"
            )


def distinct_name(text: str, otherwise: str, taken: Collection[str]) -> str:
    """Return the same, with a number behind it where the name is taken."""
    name = name_of(text, otherwise)
    numbered = (f"{name}_{count}" for count in itertools.count(2))
    return next(found for found in itertools.chain([name], numbered) if found not in taken)


def quantity(value_si: float, dimension: Dimension) -> Quantity:
    """Return a quantity in the unit of generated files, rounded, without needless zeros; an `ExchangeError` for one
    that is larger than anything that is driven."""
    if not abs(value_si) <= _LARGEST:
        raise ExchangeError(f"{value_si:g} is no {dimension} that can be meant")
    exact = Quantity.of(value_si, dimension, DIGITS)
    plain = exact.value.normalize()
    if plain.as_tuple().exponent not in range(-DIGITS, 1):  # 1E+2
        plain = plain.quantize(Decimal(1))
    return Quantity(value=plain, unit=exact.unit)


def number(element: Element, name: str, default: float | None = None) -> float:
    """Return an attribute as a number; an `ExchangeError` where `opendrive_geometry.number` has its error."""
    return opendrive_geometry.number(element, name, default, error=ExchangeError, of="the")
