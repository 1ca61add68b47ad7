"""Recognises the comments of other languages: `//` and `/* */`."""

from __future__ import annotations

import re

from foresee_dsl.helps import as_comment, meant_code
from foresee_dsl.language.syntax.phrases import Foreign

_COMMENT = re.compile(r'"[^"\n]*"?|#[^\n]*|(?P<line>//[^\n]*)|(?P<block>/\*(?:.|\n)*?(?:\*/|\Z))')


def without_comments(text: str) -> tuple[str, list[Foreign]]:
    """Return a text in which the comments of other languages (`//`, `/* */`) are blanks, and the message for each."""
    comments: list[Foreign] = []

    def blank(match: re.Match[str]) -> str:
        if match["line"] is None and match["block"] is None:
            return match[0]
        comments.append(_comment(match))
        return re.sub(r"[^\n]", " ", match[0])

    return _COMMENT.sub(blank, text), comments


def _comment(match: re.Match[str]) -> Foreign:
    start, first = match.start(), match[0].split("\n")[0]
    if match["line"] is not None:
        return Foreign(start, start + 2, "`//` does not begin a comment", meant_code("#"))
    behind = match.string[match.end() :].split("\n")[0].strip()
    if behind or "\n" in match[0]:
        help = as_comment("begin each line of it with `#`") + "; a comment goes to the end of its line"
        return Foreign(start, start + len(first), "`/*` does not begin a comment", help)
    remark = first.removeprefix("/*").removesuffix("*/").strip()
    return Foreign(start, start + len(first), f"`{first}` is not a comment", meant_code(f"# {remark}".strip()))
