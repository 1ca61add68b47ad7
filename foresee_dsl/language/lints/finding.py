"""The record of a lint before its place in the file is known; the rules return it and `lint` adds the place."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.helps import HelpText
from foresee_dsl.language import model as m


@dataclass(frozen=True)
class LintFinding:
    """What a lint found: the item and its field, the code, the message and the help."""

    item: m.Item
    field: str
    code: str
    message: str
    help: HelpText = ""
