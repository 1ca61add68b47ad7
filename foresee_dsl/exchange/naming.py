"""Names of the language for things that are called otherwise elsewhere."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection

from foresee_dsl.language.keywords import KEYWORDS

_LONGEST = 40
"""Ours: half of what the language allows, so that campaigns can add to it."""
_LONGEST_SENTENCE = 300
"""Ours: what is read at a glance."""


def name_of(text: str, otherwise: str) -> str:
    """Return the snake_case name nearest to a text: `NPC Car-1` is `npc_car_1`.

    Args:
        text: anything.
        otherwise: what stands in front when the text begins with no letter, and alone when nothing is left of it.
    """
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", plain).lower()
    name = re.sub(r"[^a-z0-9]+", "_", words).strip("_")[:_LONGEST].strip("_")
    if not name or not name[0].isalpha():
        name = f"{otherwise}_{name}".strip("_")
    return f"{name}_{otherwise}" if name in KEYWORDS else name


def sentence(text: str) -> str:
    """Return a text as a `doc` can hold it: on one line, without double quotes, not too long."""
    return " ".join(text.replace('"', "'").split())[:_LONGEST_SENTENCE]


def distinct_name(text: str, otherwise: str, taken: Collection[str]) -> str:
    """Return the same, with a number behind it where the name is taken."""
    name, count = name_of(text, otherwise), 1
    found = name
    while found in taken:
        count += 1
        found = f"{name}_{count}"
    return found
