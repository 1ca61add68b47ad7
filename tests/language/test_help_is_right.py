"""What a mistake's help says compiles: it is followed at its place, and that mistake is gone and no other is there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from lark.exceptions import UnexpectedInput

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.messages.suggest import suggested_fix
from foresee_dsl.language.parser import parse
from foresee_dsl.language.syntax.grammar import STARTS, parse_tree

ERRORS = sorted((Path(__file__).parents[1] / "cases" / "language" / "errors").glob("*.foresee"))
_LIKE = re.compile(r"write it like `([^`]+)`")


def _mistakes(text: str, path: Path) -> tuple[Diagnostic, ...]:
    try:
        return check_document(parse(text, str(path)))
    except InputError as error:
        return error.diagnostics


def _replaced(text: str, diagnostic: Diagnostic) -> str | None:
    fix = suggested_fix(diagnostic)
    if fix is None:
        return None
    span, new = fix
    lines = text.split("\n")
    line = lines[span.line - 1]
    lines[span.line - 1] = line[: span.column - 1] + new + line[span.end_column - 1 :]
    return "\n".join(lines)


def _place(diagnostic: Diagnostic) -> tuple[int, int] | None:
    return (diagnostic.span.line, diagnostic.span.column) if diagnostic.span is not None else None


@pytest.mark.parametrize("file", ERRORS, ids=lambda file: file.stem)
def test_following_the_help_mends_the_mistake(file: Path):
    text = file.read_text(encoding="utf-8")
    found = _mistakes(text, file)
    for diagnostic in found:
        mended = _replaced(text, diagnostic)
        if mended is None:
            continue
        left = _mistakes(mended, file)
        at = _place(diagnostic)
        before = {d.message for d in found} - {diagnostic.message}
        there = [other for other in left if _place(other) == at and other.message not in before]
        if any(d.code == "FS007" and _place(d) == at for d in found):  # its block is not closed, whatever it is called
            there = [other for other in there if other.code != "FS007"]
        assert not there, f"{diagnostic.message}; {diagnostic.help}: {there[0].message}"


def test_a_help_of_did_you_mean_can_be_followed():
    """It says which words to replace, for the editor's and SARIF's fixes too."""
    for diagnostic in _all():
        if "did you mean" in diagnostic.help:
            assert suggested_fix(diagnostic) is not None, f"{diagnostic.message}; {diagnostic.help}"


def test_every_example_in_a_help_is_a_statement():
    for example in {found[1] for diagnostic in _all() for found in _LIKE.finditer(diagnostic.help)}:
        assert _is_written_somewhere(example), example


def _all() -> Iterator[Diagnostic]:
    for file in ERRORS:
        yield from _mistakes(file.read_text(encoding="utf-8"), file)


def _is_written_somewhere(example: str) -> bool:
    """Whether it is a statement of some block, or a part of one that is shown with `expect never` or `param` around."""
    text = example.replace("{ ... }", "{}").replace("{ ...", "{")
    for start in STARTS:
        for form in ("{}", "expect never {}", "end after {}", "expect never {} < 4 s"):
            try:
                parse_tree(form.replace("{}", text, 1), start)
            except UnexpectedInput:
                continue
            return True
    return False
