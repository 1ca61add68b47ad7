"""The result of a lint, before it has its place in the file."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.helps import HelpText
from foresee_dsl.language import model as m


@dataclass(frozen=True)
class LintFinding:
    """A lint before it has its place: the item and its field, the code, what is unusual, what to write instead."""

    item: m.Item
    field: str
    code: str
    message: str
    help: HelpText = ""
