"""Inputs with which the fuzzer or the property tests found an error that is fixed now: one file each.

`NAME.foresee` is the input, made small; `NAME.txt` holds the first messages about it, or the formatted text where it
has no errors. `pytest --rewrite-goldens` writes the messages and texts again.
"""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from foresee_dsl.errors import InputError
from foresee_dsl.language.messages.diagnostics import render_concise
from foresee_dsl.language.parser import format_text, parse
from foresee_dsl.language.project.loading import Project
from tests.fuzz.oracle import Judge, peak_mb
from tests.support.goldens import Golden

_SHOWN = 6
CASES = sorted((Path(__file__).parents[1] / "cases" / "language" / "fuzz").glob("*.foresee"))


@pytest.mark.parametrize("file", CASES, ids=lambda file: file.stem)
def test_the_messages_are_those_of_the_golden_file(file: Path, golden: Golden, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(file.parent)
    golden(_shown(file.name), file.with_suffix(".txt"))


@pytest.mark.parametrize("file", CASES, ids=lambda file: file.stem)
def test_nothing_is_wrong_any_more(file: Path, tmp_path: Path):
    assert Judge(tmp_path, others_mb=peak_mb()).judge(file.read_bytes()) is None


def _shown(name: str) -> str:
    try:
        Project().definition(name)
    except InputError as error:
        lines = [render_concise(diagnostic) for diagnostic in error.diagnostics]
        more = [f"... and {len(lines) - _SHOWN} more"] if len(lines) > _SHOWN else []
        return "".join(f"{line}\n" for line in (*lines[:_SHOWN], *more))
    return format_text(Path(name).read_text(encoding="utf-8"), name)


def test_a_long_word_costs_no_more_than_its_length():
    """Found by the fuzzer: the word before a mistake was looked for from every one of its characters."""
    head = "foresee 1\n\nscenario a {\n  ego: car.sedan {\n    route from west straight "

    def cost(letters: int) -> float:
        begun = time.process_time()
        with pytest.raises(InputError):
            parse(f"{head}{'over' * (letters // 4)} j4\n  }}\n}}\n", "x")  # begins with a keyword, and is not the last
        return time.process_time() - begun

    cost(10)
    # ten times the length, at most thirty times the time: with a search from every letter it is a hundred
    assert min(cost(20_000) for _ in range(3)) < 30 * min(cost(2_000) for _ in range(3))
