"""Helps: the text that people read carries its edits as data, and loses none of them on the way."""

from __future__ import annotations

import re

import pytest

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.helps import (  # fmt: skip
    Help,
    InBlock,
    Instead,
    OneOf,
    Remove,
    Rewrite,
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
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.parser import parse


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


@pytest.mark.parametrize(
    ("line", "code", "names"),
    [
        ("ego: car.sedan { route from south straight over j4; speed pace }", "FS031", ("pace",)),
        ("when ego within 3 m of nobody { nobody stops }", "FS037", ("nobody",)),
        ("vehicle once: car.compact", "FS049", ("once",)),
    ],
)
def test_a_diagnostic_has_the_name_that_it_is_about_as_data(line: str, code: str, names: tuple[str, ...]):
    diagnostics = check_document(parse(f"foresee 1\nscenario a {{\n  {line}\n}}\n", "x.foresee"))
    assert names in [diagnostic.names for diagnostic in diagnostics if diagnostic.code == code]


def test_the_help_for_open_blocks_counts_them():
    text = "foresee 1\nscenario a {\n" + "".join(f"{'  ' * k}when time > {k} s {{\n" for k in range(1, 7))
    with pytest.raises(InputError) as refused:
        parse(text, "x.foresee")
    blocks = [fix.blocks for d in refused.value.diagnostics for fix in d.fixes if isinstance(fix, Rewrite)]
    assert sum(blocks) == 7
