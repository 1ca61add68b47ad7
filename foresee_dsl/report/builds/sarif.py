"""Diagnostics as SARIF 2.1.0 (OASIS, 27 March 2020), which code hosts and review tools read."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from urllib.parse import quote

from foresee_dsl import __version__
from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.language.codes import Code
from foresee_dsl.language.messages.suggest import suggested_fix

_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_BASE = "%SRCROOT%"
"""Base of relative paths: the top folder of the checkout, under the name that code hosts use."""
_FINGERPRINT = "foreseeMistake/v1"
_Json = dict[str, object]


def to_sarif(diagnostics: Sequence[Diagnostic], codes: Mapping[str, Code]) -> _Json:
    """Return a SARIF log with one run; its rules are the codes that occur, with their explanations and examples."""
    rules = sorted({diagnostic.code for diagnostic in diagnostics} & set(codes))
    seen: Counter[str] = Counter()
    results = [_result(diagnostic, rules, seen) for diagnostic in diagnostics]
    driver: _Json = {"name": "foresee", "semanticVersion": __version__, "rules": [_rule(codes[code]) for code in rules]}
    run: _Json = {
        "tool": {"driver": driver},
        "columnKind": "utf16CodeUnits",
        "originalUriBaseIds": {_BASE: {"description": {"text": "the folder from which foresee was called"}}},
        "results": results,
    }
    return {"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}


def _rule(code: Code) -> _Json:
    help_ = f"{code.explanation}\n\nWrong:\n\n{code.wrong}\n\nRight:\n\n{code.right}\n"
    markdown = f"{code.explanation}\n\nWrong:\n\n```\n{code.wrong}\n```\n\nRight:\n\n```\n{code.right}\n```\n"
    return {
        "id": code.code,
        "shortDescription": {"text": code.title},
        "fullDescription": {"text": code.explanation},
        "help": {"text": help_, "markdown": markdown},
        "defaultConfiguration": {"level": code.severity},
    }


def _result(diagnostic: Diagnostic, rules: Sequence[str], seen: Counter[str]) -> _Json:
    text = f"{diagnostic.message} ({diagnostic.help})" if diagnostic.help else diagnostic.message
    result: _Json = {"ruleId": diagnostic.code, "level": diagnostic.severity, "message": {"text": text}}
    if diagnostic.code in rules:
        result["ruleIndex"] = rules.index(diagnostic.code)
    result["locations"] = [{"physicalLocation": _physical(diagnostic)}] if diagnostic.path else []
    result["partialFingerprints"] = {_FINGERPRINT: _fingerprint(diagnostic, seen)}
    fix = _fix(diagnostic)
    return result | ({"fixes": [fix]} if fix is not None else {})


def _physical(diagnostic: Diagnostic) -> _Json:
    artifact: _Json = {"artifactLocation": _artifact(diagnostic.path)}
    if diagnostic.span is None:
        return artifact
    return artifact | {"region": _region(diagnostic.span, diagnostic.source_line)}


def _artifact(path: str) -> _Json:
    """Return a path as a URI, relative to the working folder if the file lies in it."""
    absolute = Path(path).absolute()
    try:
        relative = absolute.relative_to(Path.cwd())
    except ValueError:
        return {"uri": absolute.as_uri()}
    return {"uri": quote(os.fsencode(PurePosixPath(relative))), "uriBaseId": _BASE}


def _region(span: Span, line: str) -> _Json:
    """Return a place with columns in UTF-16 code units; if the place spans several lines, only its first line."""
    first = _utf16(line, span.column)
    last = max(_utf16(line, span.end_column if span.end_line == span.line else len(line) + 1), first)
    return {"startLine": span.line, "startColumn": first, "endLine": span.line, "endColumn": last}


def _utf16(line: str, column: int) -> int:
    """Convert a 1-based column in characters to UTF-16 code units."""
    return column + sum(ord(char) > 0xFFFF for char in line[: column - 1])


def _fingerprint(diagnostic: Diagnostic, seen: Counter[str]) -> str:
    """Return a digest of a diagnostic that stays the same when lines are added above it.

    It is computed from the code, the file, the line's text, the message, and the number of equal diagnostics before it.
    """
    key = "\0".join((diagnostic.code, diagnostic.path, diagnostic.source_line.strip(), diagnostic.message))
    seen[key] += 1
    return hashlib.sha256(f"{key}\0{seen[key]}".encode("utf-8", "surrogatepass")).hexdigest()[:32]


def _fix(diagnostic: Diagnostic) -> _Json | None:
    replacement = suggested_fix(diagnostic)
    if replacement is None:
        return None
    span, text = replacement
    change = {"deletedRegion": _region(span, diagnostic.source_line), "insertedContent": {"text": text}}
    return {
        "description": {"text": diagnostic.help},
        "artifactChanges": [{"artifactLocation": _artifact(diagnostic.path), "replacements": [change]}],
    }
