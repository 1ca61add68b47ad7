"""Quick fixes of the golden mistakes: every help can be followed by a click, and what it says compiles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from foresee_dsl.editor.answers.edits import Fix, applied
from foresee_dsl.editor.answers.fixes import fixes, with_names_of
from foresee_dsl.editor.diagnosing import find
from foresee_dsl.errors import Diagnostic

GOLDENS = Path(__file__).parents[1] / "cases" / "language" / "errors"

NOTHING_TO_WRITE = {
    ("actors_like_junctions", "FS251"): "the new name is for the author",
    ("nothing_defined", "FS014"): "what the file is to define is for its author",
    ("other_languages", "`else` is a word"): "the condition before it is broken too, so its opposite would be",
    (
        "other_languages",
        "`do` is a word",
    ): "whether its actions begin together or one after the other is for the author",
    ("places_of_drawn_cases", "FS252"): "which of the drawn values it leaves out is for the author",
    ("places_of_drawn_cases", "FS256"): "which of the drawn values it leaves out is for the author",
    ("streets_apart", "FS270"): "where the junction can lie is geometry: no text mends it",
    ("too_few", "FS014"): "which place, road or action is missing is for the author",
    ("two_definitions", "this file has a second definition"): "it belongs in another file",
    ("two_on_a_line", "'speed' is not allowed"): "it has a block, which it cannot have where it belongs",
    ("wrong_place", "FS008"): "nothing before it could take it: where it belongs is for the author",
    ("stale_clip", "FS135"): "the child has to be looked at: `foresee repin` is a command, not a text",
    ("uses_itself", "FS133"): "which scenario it is to extend is for its author",
    ("wrong_was", "FS003"): "the mutant's parent is broken too, so it has no pin",
}
"""Golden mistakes without a quick fix: the file, the code or how the message begins; and why."""

OF_THE_GRAMMAR = {"FS003", "FS004", "FS007", "FS008", "FS009", "FS015", "FS065"}


@dataclass(frozen=True)
class Mistake:
    """A golden mistake in a text, and the fixes that are offered for it."""

    file: Path
    text: str
    diagnostic: Diagnostic
    offered: tuple[Fix, ...]
    check: Callable[[str], tuple[Diagnostic, ...]]

    @property
    def name(self) -> str:
        return self.file.parent.name if self.file.parent != GOLDENS else self.file.stem


@pytest.fixture(scope="module")
def mistakes() -> tuple[Mistake, ...]:
    files = [*sorted(GOLDENS.glob("*.foresee")), *sorted(GOLDENS.glob("*/*.foresee"))]
    return tuple(mistake for file in files for mistake in _of(file))


def _of(file: Path) -> Iterator[Mistake]:
    text = file.read_text(encoding="utf-8", errors="replace")

    @cache
    def check(text: str) -> tuple[Diagnostic, ...]:
        found = find(file, text, {}, places=file.parent != GOLDENS)
        return tuple(one for one in found if one.path == str(file))

    for one in check(text):
        if one.span is not None:
            offered = fixes(one, one.span, text, check, with_names_of(file, {}))
            yield Mistake(file, text, one, offered, check)


def test_every_help_can_be_followed_by_a_click(mistakes: tuple[Mistake, ...]) -> None:
    assert len(mistakes) > 350
    without = [mistake for mistake in mistakes if not mistake.offered]
    unexplained = [
        f"{mistake.name}: {mistake.diagnostic.message}; {mistake.diagnostic.help}"
        for mistake in without
        if not any(
            mistake.name == name and (mistake.diagnostic.code == what or mistake.diagnostic.message.startswith(what))
            for name, what in NOTHING_TO_WRITE
        )
    ]
    assert not unexplained
    assert len(without) <= len(NOTHING_TO_WRITE) + 6  # of some there are several


def test_what_is_clicked_mends_the_mistake_and_compiles(mistakes: tuple[Mistake, ...]) -> None:
    """That mistake is gone, and the grammar refuses no more statements than before."""
    for mistake in mistakes:
        before = mistake.check(mistake.text)
        for fix in mistake.offered:
            mended = applied(mistake.text, fix)
            after = mistake.check(mended)
            where = f"{mistake.name}: {mistake.diagnostic.message}; {fix.title}: {mended}"
            refused = [one for one in after if one.code in OF_THE_GRAMMAR]
            assert len(refused) <= sum(one.code in OF_THE_GRAMMAR for one in before), where
            same = [one for one in after if _same(one, mistake.diagnostic)]
            assert len(same) < sum(_same(one, mistake.diagnostic) for one in before) or all(
                one.span != mistake.diagnostic.span for one in same
            ), where


def _same(one: Diagnostic, other: Diagnostic) -> bool:
    return (one.code, one.message) == (other.code, other.message)


def test_an_example_takes_the_names_of_the_file(tmp_path: Path) -> None:
    network = """foresee 1

network crossing {
  junction middle at (0 m, 0 m) signals { stage go for 20 s green [in_road, out_road] }
  junction left_end at (-100 m, 0 m)
  junction right_end at (100 m, 0 m)
  road in_road from left_end to middle
  road out_road from middle to right_end
}
"""
    scenario = """foresee 1

scenario names {
  use network "crossing.foresee"
  ego: car.sedan { route from in_road straight over middle }
  vehicle truck_ahead: truck.rigid {
    route from in_road straight over middle
    start at 40 m along in_road
  }
  Maneuver braking { }
  signal middle stage go for 3 s
  when ego.eta < 3 s { truck_ahead stops }
  expect never collision(ego)
}
"""
    (tmp_path / "crossing.foresee").write_text(network, encoding="utf-8")
    file = tmp_path / "names.foresee"
    file.write_text(scenario, encoding="utf-8")
    titles = {
        mistake.diagnostic.span.line: mistake.offered[0].title for mistake in _of(file) if mistake.diagnostic.span
    }
    assert titles == {
        10: "Write `when time > 5 s { truck_ahead stops }`",
        11: "Write 'elapsed'",
        12: "Write `ego.eta(middle)`",
    }


def test_a_fix_leaves_no_more_mistakes_of_one_name_behind() -> None:
    """The counter is of the place: the same mistake twice in a text is mended one by one."""
    text = "foresee 1\n\nscenario twice {\n  end after 3 m\n  end after 3 m\n}\n"
    file = Path("twice.foresee").absolute()

    def check(text: str) -> tuple[Diagnostic, ...]:
        return find(file, text, {}, places=False)

    wrong = [one for one in check(text) if one.code == "FS010"]
    assert Counter(one.message for one in wrong) == {wrong[0].message: 2}
    for one in wrong:
        assert one.span is not None
        offered = fixes(one, one.span, text, check)
        assert [fix.title for fix in offered] == ["Write `2.5 s`"]


def test_an_alternative_replaces_the_wrong_word_of_a_statement(tmp_path: Path) -> None:
    """The marked text is the whole route or definition, in which one word is wrong."""
    (tmp_path / "north_road.foresee").write_text(
        "foresee 1\n\nnetwork north_road {\n  junction a at (0 m, 0 m)\n  junction b at (100 m, 0 m)\n"
        "  junction c at (200 m, 0 m)\n  road north from a to b\n  road south from c to b\n}\n",
        encoding="utf-8",
    )
    file = tmp_path / "wrong.foresee"
    scenario = """foresee 1

scenario wrong {
  use network "north_road.foresee"
  ego: car.sedan { route [north, south] }
  expect never collision(ego)
}
"""
    file.write_text(scenario, encoding="utf-8")
    fixed = {applied(scenario, fix) for mistake in _of(file) for fix in mistake.offered}
    assert scenario.replace("[north, south]", "[north, south_back]") in fixed
    file.write_text("foresee 1\n\nxyzzy wrong {\n}\n", encoding="utf-8")
    fixed = {applied(file.read_text(encoding="utf-8"), fix) for mistake in _of(file) for fix in mistake.offered}
    assert "foresee 1\n\nmodels wrong {\n}\n" in fixed, "the only definition that may be empty"
