"""Conversion of names, sentences and numbers from other tools into forms that the language can express."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Collection
from decimal import Decimal
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign import opendrive_geometry
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.model import Quantity
from foresee_dsl.language.units import Dimension

_LONGEST = 40
"""Maximum length of a name, characters. Ours: half of the language's limit, so that campaigns can append to it."""
_LONGEST_FILE_NAME = 120
"""Maximum length of a file name, characters. Ours: most file systems allow 255 bytes, and a letter may take four."""
_LONGEST_SENTENCE = 300
"""Maximum length of a sentence, characters. Ours: a text that can be read at a glance."""
DIGITS = 4
"""Decimals of metres, m/s and degrees, as in clips: they rebuild a run exactly."""
_LARGEST = 1e7
"""Largest value that is accepted, in SI units. Ours: map projections reach 1e7 m."""


def name_of(text: str, otherwise: str) -> str:
    """Return the snake_case name nearest to a text: `NPC Car-1` becomes `npc_car_1`.

    `otherwise` is put in front if the text does not begin with a letter, and used alone if no character remains.
    """
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", plain).lower()
    name = re.sub(r"[^a-z0-9]+", "_", words).strip("_")[:_LONGEST].strip("_")
    if not name or not name[0].isalpha():
        name = f"{otherwise}_{name}".strip("_")
    return f"{name}_{otherwise}" if name in KEYWORDS else name


def sentence(text: str) -> str:
    """Return a text in the form of a `doc`: on one line, without double quotes, not too long."""
    return " ".join(re.sub(r"[\x00-\x1f\x7f]", " ", text.replace('"', "'")).split())[:_LONGEST_SENTENCE]


def file_name(name: str) -> str:
    """Return a file name that a scenario can contain in double quotes; nearly all names remain unchanged."""
    return re.sub(r'["\x00-\x1f\x7f]', "_", name)[-_LONGEST_FILE_NAME:]


def distinct_name(text: str, otherwise: str, taken: Collection[str]) -> str:
    """Return the name nearest to a text, with a number appended if that name is taken."""
    name = name_of(text, otherwise)
    numbered = (f"{name}_{count}" for count in itertools.count(2))
    return next(candidate for candidate in itertools.chain([name], numbered) if candidate not in taken)


def quantity(value_si: float, dimension: Dimension) -> Quantity:
    """Return a quantity in the unit of generated files, rounded, without needless zeros; `ExchangeError` if it is
    larger than any real value."""
    if not abs(value_si) <= _LARGEST:
        raise ExchangeError(f"{value_si:g} is not a plausible {dimension}")
    exact = Quantity.of(value_si, dimension, DIGITS)
    plain = exact.value.normalize()
    if plain.as_tuple().exponent not in range(-DIGITS, 1):  # numbers such as 1E+2 must be written out
        plain = plain.quantize(Decimal(1))
    return Quantity(value=plain, unit=exact.unit)


def number(element: Element, name: str, default: float | None = None) -> float:
    """Return an attribute as a number; `ExchangeError` if `opendrive_geometry.number` refuses it."""
    return opendrive_geometry.number(element, name, default, error=ExchangeError, of="the")
