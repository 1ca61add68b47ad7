"""Refuses texts that would take minutes to parse, before they are parsed: endless conditions and networks."""

from __future__ import annotations

import re

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.limits import most, raised_by

_SMALL = 10_000
"""Shorter texts are not counted: no limit can be passed in them (a part of a condition takes three characters)."""
_UNCOUNTED = re.compile(r'"[^"\n]*"|#[^\n]*')
_COUNTED = (
    ("conditions", re.compile(r"\b(?:and|or|not)\b"), "conditions of {} parts (`and`, `or`, `not`)"),
    ("network", re.compile(r"^[ \t]*(?:junction|road|building)\b", re.MULTILINE), "{} junctions, roads and buildings"),
)


def check_size(text: str, path: str) -> None:
    """Make sure that a text can be parsed in seconds.

    Raises:
        InputError: it cannot; the message has the option that allows it nevertheless.
    """
    if len(text) < _SMALL:
        return
    counted = _UNCOUNTED.sub("", text)
    for name, pattern, what in _COUNTED:
        found, allowed = len(pattern.findall(counted)), most(name)
        if found > allowed:
            message = f"the file has {what.format(f'{found:,}')}, more than {allowed:,.0f}"
            help = f"divide it into several files; {raised_by(name, found)}"
            raise InputError((Diagnostic("FS002", message, help, path),))
