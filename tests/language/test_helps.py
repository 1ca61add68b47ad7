"""Helps: the text that people read carries its edits as data, and loses none of them on the way."""

from __future__ import annotations

import re

import pytest

from foresee_dsl.errors import Diagnostic
from foresee_dsl.helps import (  # fmt: skip
    Help,
    InBlock,
    Instead,
    OneOf,
    Remove,
    Write,
    expanded,
    in_block,
    instead,
    meant_code,
    one_of,
    remove,
    rename,
    write,
)


def test_a_help_is_added_up_with_its_edits() -> None:
    help = "write " + write("a") + ", or " + remove("remove it") + "; known are " + one_of(["b", "c", "d"], " or ")
    assert help == Help("write `a`, or remove it; known are b, c or d", (Write("a"), Remove(), OneOf(("b", "c", "d"))))
    diagnostic = Diagnostic.of("FS003", "wrong", help, "x.foresee")
    assert (diagnostic.help, diagnostic.fixes) == (help.text, help.edits)
    assert Diagnostic.of("FS003", "wrong", "only words", "x.foresee").fixes == ()


def test_a_help_refuses_to_become_a_text_that_has_lost_its_edits() -> None:
    with pytest.raises(TypeError, match="add helps"):
        _ = f"write {write('a')}"


def test_a_pattern_with_gaps_and_values_with_units_are_only_shown() -> None:
    assert write("when ... { ... }") == Help("`when ... { ... }`")
    assert one_of(["1 s", "2 s"]) == Help("1 s, 2 s")
    assert rename("give it another name").text == "give it another name"


def test_a_help_of_a_table_is_filled_in_with_its_edits() -> None:
    found = re.match(r"(?P<a>\w+) (?P<b>\w+)", "lead stops")
    assert found is not None
    help = in_block(r"\g<b>", "lead") + " or " + instead(r"\g<a>", r"\g<b>") + " or " + meant_code(r"\g<a>")
    filled = expanded(help, found.expand)
    assert isinstance(filled, Help)
    assert filled.text == "write `stops` in the block of 'lead' or `lead` instead of `stops` or did you mean `lead`?"
    assert filled.edits[:2] == (InBlock("stops", "lead"), Instead("lead", "stops"))
    assert expanded(r"only \g<a>", found.expand) == "only lead"
