"""Diagnostics as workflow commands, which GitHub Actions shows beside the lines of a pull request.

The form and its escapes: docs.github.com, "Workflow commands for GitHub Actions" (`::error file=...::message`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from foresee_dsl.errors import Diagnostic
from foresee_dsl.language.codes.code import Code


def render_github(diagnostics: Iterable[Diagnostic], codes: Mapping[str, Code]) -> str:
    """Return one command a line, in the order given; `codes` gives each its title."""
    return "\n".join(_command(found, codes) for found in diagnostics)


def _command(found: Diagnostic, codes: Mapping[str, Code]) -> str:
    code = codes.get(found.code)
    properties: list[tuple[str, str | int]] = [("file", found.path)]
    if found.span is not None:
        properties += [("line", found.span.line), ("endLine", found.span.end_line), ("col", found.span.column)]
        if found.span.line == found.span.end_line:  # GitHub takes a last column only on the same line
            properties.append(("endColumn", found.span.end_column))
    properties.append(("title", f"{found.code} {code.title}" if code is not None else found.code))
    escaped = ((name, _data(str(value)).replace(":", "%3A").replace(",", "%2C")) for name, value in properties)
    options = ",".join(f"{name}={value}" for name, value in escaped)
    message = f"{found.message}\n{found.help}" if found.help else found.message
    level = "error" if found.severity == "error" else "warning"
    return f"::{level} {options}::{_data(message)}"


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
