"""Diagnostics as workflow commands, which GitHub Actions shows beside the lines of a pull request.

The form and its escapes: docs.github.com, "Workflow commands for GitHub Actions" (`::error file=...::message`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from foresee_dsl.errors import Diagnostic
from foresee_dsl.language.codes import Code


def render_github(diagnostics: Iterable[Diagnostic], codes: Mapping[str, Code]) -> str:
    """Return the diagnostics as one command per line, with the titles of their codes."""
    return "\n".join(_command(diagnostic, codes) for diagnostic in diagnostics)


def _command(diagnostic: Diagnostic, codes: Mapping[str, Code]) -> str:
    code = codes.get(diagnostic.code)
    properties: list[tuple[str, str | int]] = [("file", diagnostic.path)] if diagnostic.path else []
    if diagnostic.span is not None:
        properties += [
            ("line", diagnostic.span.line),
            ("endLine", diagnostic.span.end_line),
            ("col", diagnostic.span.column),
        ]
        # GitHub accepts a last column only if the place is within one line.
        if diagnostic.span.line == diagnostic.span.end_line:
            properties.append(("endColumn", diagnostic.span.end_column))
    properties.append(("title", f"{diagnostic.code} {code.title}" if code is not None else diagnostic.code))
    escaped = ((name, _data(str(value)).replace(":", "%3A").replace(",", "%2C")) for name, value in properties)
    options = ",".join(f"{name}={value}" for name, value in escaped)
    message = f"{diagnostic.message}\n{diagnostic.help}" if diagnostic.help else diagnostic.message
    level = "error" if diagnostic.severity == "error" else "warning"
    return f"::{level} {options}::{_data(message)}"


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
