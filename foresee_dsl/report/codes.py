"""Every code that a diagnostic may have, whichever layer finds it."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

from foresee_dsl.errors import Diagnostic
from foresee_dsl.language.codes.code import Code

_SAID_BETTER = {"FS309": "FS250", "FS308": "FS256"}
"""Lints for which the network gives a mistake of its own: where that is reported, the lint is left out."""


def every_code() -> MappingProxyType[str, Code]:
    """Return all codes by name, in order."""
    from foresee_dsl.campaign.codes import CODES as OF_CAMPAIGNS
    from foresee_dsl.compile.codes import CODES as OF_PLACES  # here: a check without mistakes needs no explanations
    from foresee_dsl.language.codes import CODES as OF_TEXT

    codes = [*OF_TEXT.values(), *OF_PLACES, *OF_CAMPAIGNS]
    return MappingProxyType({code.code: code for code in sorted(codes, key=lambda code: code.code)})


def joined(lints: Sequence[Diagnostic], placements: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Put what the network shows (`placements`) beside the rest; each mistake is said once."""
    said = {(d.code, d.path, d.span.line) for d in placements if d.span is not None}

    def again(lint: Diagnostic) -> bool:
        better = _SAID_BETTER.get(lint.code)
        if better == "FS250":
            return True  # the network has the last word on whether a route is possible
        return lint.span is not None and (better, lint.path, lint.span.line) in said

    return [*(lint for lint in lints if not again(lint)), *placements]
