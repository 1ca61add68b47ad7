"""The replacement that a diagnostic's help spells out (`did you mean 'km/h'?`), for tools that offer to make it."""

from __future__ import annotations

import re

from foresee_dsl.errors import Diagnostic, Span

_MEANT = re.compile(r"did you mean ['`]([^'`]+)['`]\?")
_QUOTED = re.compile(r"['`]([^'`]+)['`]")


def mend(diagnostic: Diagnostic) -> tuple[Span, str] | None:
    """Return which part of the file to replace, and by what; None where the help names no replacement."""
    span = diagnostic.span
    if span is None or span.end_line != span.line:
        return None
    written = diagnostic.source_line[span.column - 1 : span.end_column - 1]
    found = replacement(f"{diagnostic.message}\n{diagnostic.help}", written)
    if found is None:
        return None
    start, end, text = found
    return Span(span.line, span.column + start, span.line, span.column + end), text


def replacement(message: str, written: str) -> tuple[int, int, str] | None:
    """Return what to replace in the underlined text (start, end) and by what; None where nothing can be said.

    Args:
        message: the mistake and its help, as shown.
        written: the text that is underlined.
    """
    meant = _MEANT.search(message)
    if meant is None:
        return None
    if len(written) > 2 and written[0] == written[-1] == '"':
        start = written.rfind("/") + 1 or 1  # of a file, the help names the last part of the path
        return start, len(written) - 1, meant[1]
    wrong = next((word for word in _QUOTED.findall(message[: meant.start()]) if written.count(word) == 1), None)
    if wrong is not None:
        return written.index(wrong), written.index(wrong) + len(wrong), meant[1]
    return (0, len(written), meant[1]) if re.fullmatch(r"\S+", written) else None
