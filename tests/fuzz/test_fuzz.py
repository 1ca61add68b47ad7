"""A short run of the fuzzer, with a seed of its own (the long one: `python -m tests.fuzz.run --help`)."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from lark import Token, Tree
from lark.exceptions import UnexpectedInput

from foresee_dsl.language.syntax.grammar import parse_tree, parser
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.syntax.nodes import NodeMaker
from foresee_dsl.language.syntax.reading import read
from tests.fuzz.derivations import derivation
from tests.fuzz.generators import GENERATORS, make
from tests.fuzz.minimise import minimise
from tests.fuzz.oracle import Judge, peak_mb
from tests.fuzz.run import fuzz

INPUTS = 200


@pytest.mark.parametrize("name", GENERATORS)
def test_nothing_is_wrong_with_any_input(name: str, tmp_path: Path):
    result = fuzz(Judge(tmp_path, others_mb=peak_mb()), [name], 20, range(INPUTS), set())
    assert result.inputs[name] == INPUTS
    assert not {key: (which, details, content) for key, (which, details, content) in result.findings.items()}


def test_inputs_are_reproducible_and_differ():
    for name in GENERATORS:
        assert make(name, 3, 7) == make(name, 3, 7)
        assert len({make(name, 3, number) for number in range(40)}) > 25


def test_derivations_reach_every_statement():
    """The generator follows the grammar as it is: each keyword of it turns up (the rarest 2 times in 20,000)."""
    rng = random.Random(1)
    missing = {t.pattern.value for t in parser().terminals if t.pattern.type == "str"}
    for _ in range(60000):
        missing.difference_update(derivation(rng).split())
        if not missing:
            break
    assert not missing


def test_statements_that_are_read_one_by_one_are_what_the_grammar_says_of_the_whole():
    """Cutting a text into statements loses nothing and adds nothing, with separators wherever they may stand."""
    rng = random.Random(1)
    accepted = 0
    for _ in range(200):
        text = derivation(rng)
        at = rng.randrange(len(text))
        text = text[:at] + rng.choice(("", "", ";", "\n", "# ]};\n", "{", "]")) + text[at:]
        reading = read(text)
        try:
            whole = parse_tree(text, "file")
        except UnexpectedInput:
            assert reading.errors, text
            continue
        accepted += 1
        assert not reading.errors, text
        assert _nodes(reading.tree) == _nodes(whole), text
    assert accepted > 50


def _nodes(tree: Tree[Token]) -> list[Node]:
    maker = NodeMaker(tree)
    return [maker.make(part) for part in tree.children if isinstance(part, Tree) and part.data != "header"]


def test_an_oracle_that_can_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A fault that is put in is found, with its place, and made small."""
    from foresee_dsl.language import parser as parsing

    good = parsing.parse

    def faulty(text: str, path: str):
        if "sedan" in text:
            raise RuntimeError("put in by the test")
        return good(text, path)

    monkeypatch.setattr("tests.fuzz.oracle.parse", faulty)
    judge = Judge(tmp_path, others_mb=peak_mb())
    content = b"foresee 1\n\nscenario a {\n  ego: car.sedan\n  end after 3 s\n}\n"
    found = judge.judge(content)
    assert found is not None and found.key.startswith("RuntimeError")
    assert minimise(content, lambda small: judge.judge(small) is not None) == b"sedan"
