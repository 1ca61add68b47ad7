"""A short run of the fuzzer, with a seed of its own (the long one: `python -m tests.fuzz.run --help`)."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.language.syntax.grammar import parser
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
    """The generator follows the grammar as it is: each keyword of it turns up."""
    import random

    rng = random.Random(1)
    words = set(" ".join(derivation(rng) for _ in range(20000)).split())
    missing = {t.pattern.value for t in parser().terminals if t.pattern.type == "str"} - words
    assert not missing


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
