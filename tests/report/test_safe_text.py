"""Text of others, made safe for a terminal."""

from __future__ import annotations

import unicodedata

import pytest

from foresee_dsl.report.safe_text import LONGEST, safe, shortened

HOSTILE = (
    "\x1b[31mred\x1b[0m",
    "\x1b]0;title\x07",
    "\x9b2J",
    "left \u202eturned\u202c back",
    "\u2066isolated\u2069",
    "zero\u200bwidth\ufeff",
    "bell\a backspace\b",
    "<script>alert(1)</script>",
    "a\r\nb\tc\u2028d",
    "surrogate \ud800",
)


@pytest.mark.parametrize("text", HOSTILE)
def test_no_sign_is_left_that_a_terminal_obeys(text: str) -> None:
    shown = safe(text)
    assert not [sign for sign in shown if unicodedata.category(sign)[0] == "C" or sign in "\n\r\u2028\u2029"]
    shown.encode("utf-8")


def test_what_was_there_can_still_be_read() -> None:
    assert safe("\x1b[31mred") == "\\x1b[31mred"
    assert safe("<script>") == "<script>"
    assert safe("a\nb") == "a b"
    assert safe("Zürich 東京 naïve") == "Zürich 東京 naïve"


def test_long_and_stacked_texts_are_cut() -> None:
    assert len(safe("x" * 10_000)) == LONGEST + 1
    assert len(safe("\x1b" * 10_000)) < 5 * LONGEST
    assert safe("e" + "\u0301" * 50).count("\u0301") == 2
    assert shortened("a" * 50, 10) == "a" * 9 + "…"
