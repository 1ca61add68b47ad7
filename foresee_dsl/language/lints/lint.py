"""Lints: warnings about valid texts that are probably not meant, for one file and its test cases."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Iterable, Iterator, Mapping

from foresee_dsl.errors import Diagnostic, MessageText, Span
from foresee_dsl.helps import HelpText, remove, write
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.cases import case_values, needed_by
from foresee_dsl.language.codes import diagnostic_of
from foresee_dsl.language.document import Document, TestCase
from foresee_dsl.language.lints.actors import actor_lints, route_lints
from foresee_dsl.language.lints.allowances import without_allowed
from foresee_dsl.language.lints.arithmetic import divisions_by_zero
from foresee_dsl.language.lints.dead_text import certain_conditions, dead_requirements, odd_measures
from foresee_dsl.language.meaning import file_pin, same_value
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.printer import value_text
from foresee_dsl.language.project.concretise import SETTLED
from foresee_dsl.language.traversal import fields_of, walk


def lint(document: Document, cases: Iterable[TestCase]) -> tuple[Diagnostic, ...]:
    """Return the lints of a file without errors, sorted by place, except those that a comment allows.

    `cases`: the test cases of the file (none for a network or a catalogue). A lint of several cases is reported once.
    A clip has only the lint of its window, and a mutant only those of its changes: the others belong to their parents.
    """
    lints = _Lints(document)
    if isinstance(document.model, m.Scenario):
        for scenario_lint in _SCENARIO_LINTS:
            scenario_lint(lints, document.model)
    for case in cases:
        if case.clip is not None and case.clip is document.model:
            _beyond_the_end(lints, case.clip, case.parent_ends_s)
        if case.mutant is not None and case.mutant is document.model:
            _without_effect(lints, case.mutant, case.scenario.first(m.End))
        if case.clip is None and case.mutant is None:
            lints.statements = _statements(case, document.model)
            for case_lint in _CASE_LINTS:
                case_lint(lints, case)
    return without_allowed(document, [*lints.each_once(), *hidden_characters(document.text, document.path)])


class _Lints(Collector):
    """Collects the lints of a file.

    Attributes:
        statements: the statement in the file for each item of a concrete scenario, by the id of the concrete item.
    """

    def __init__(self, document: Document) -> None:
        super().__init__(document)
        self.statements: Mapping[int, m.Item] = {}
        self._file = document

    def add(
        self, item: m.Item | None, field: str, code: str, message: MessageText, help: HelpText = "",
        *, head_only: bool = True,
    ) -> None:  # fmt: skip
        """Add a lint, unless its item is written in a file that this one extends, which is checked on its own."""
        statement = self.statements.get(id(item), item)
        if statement is not None and self._file.span(statement) is not None:
            super().add(statement, field, code, message, help, head_only=head_only)

    def each_once(self) -> Iterable[Diagnostic]:
        """Return the first lint of each place and code: several cases may have the same one in other words."""
        lints: dict[tuple[Span | None, str], Diagnostic] = {}
        for diagnostic in self:
            lints.setdefault((diagnostic.span, diagnostic.code), diagnostic)
        return lints.values()


# ---- lints of the text ----------------------------------------------------------------------------------------------


def _unused_parameters(lints: Collector, scenario: m.Scenario) -> None:
    users = (item for item in scenario.body if not isinstance(item, m.Case))
    used = {part.name for item in users for part in walk(item) if isinstance(part, m.Ref)}
    types = {parameter.name: parameter.type for parameter in scenario.all(m.Param)}
    assignments = (assignment for case in scenario.all(m.Case) for assignment in case.values)
    used |= {ref.name for assignment in assignments for ref in needed_by(assignment, types)}
    for parameter in scenario.all(m.Param):
        if parameter.name not in used:
            help = "write " + write(parameter.name) + " where its value belongs, or " + remove("remove it")
            lints.add(parameter, "name", "FS301", f"nothing uses parameter '{parameter.name}'", help)


def _dead_cases(lints: Collector, scenario: m.Scenario) -> None:
    seen: dict[tuple[tuple[str, object], ...], str] = {}
    for case in scenario.all(m.Case):
        key = tuple(sorted((name, _comparable(value)) for name, value in case_values(scenario, case).items()))
        if key in seen:
            message = f"case '{case.name}' has the same values as case '{seen[key]}'"
            lints.add(case, "name", "FS302", message, "change a value, or " + remove("remove one of the two"))
        seen.setdefault(key, case.name)


def _comparable(value: m.ParamValue) -> object:
    return f"{value.si:.9g}" if isinstance(value, m.Quantity) else value


# ---- lints of a test case -------------------------------------------------------------------------------------------


def _nothing_expected(lints: Collector, case: TestCase) -> None:
    scenario = case.scenario
    named = {getattr(part, field, None) for expect in scenario.all(m.Expect) for part in walk(expect)
             for field in ("actor", "other", "name")}  # fmt: skip
    if "ego" in named:
        return
    message = f"scenario '{scenario.name}' expects nothing of the ego"
    lints.add(scenario, "name", "FS310", message, "add " + write("expect never collision(ego)") + ", for example")


def _not_pinned(lints: Collector, case: TestCase) -> None:
    used = case.scenario.first(m.UseTracks)
    if used is not None and used.pin is None and case.tracks is not None:
        message = f"'{used.path}' is not pinned, so nothing notices when it changes"
        help = "write " + write(f'use tracks "{used.path}" pin {file_pin(case.tracks)}')
        lints.add(used, "", "FS317", message, help)


def _without_effect(lints: Collector, mutant: m.Mutant, end: m.End | None) -> None:
    """Report the changes of a mutant that change nothing; `end`: that of its clip."""
    end_s = end.after.si if end is not None and isinstance(end.after, m.Quantity) else math.inf
    for change in mutant.changes:
        what = f"{change.actor}.{change.property}"
        if same_value(change.was, change.now):
            message = f"{what} stays {value_text(change.now)}, so this change has no effect"
            lints.add(change, "now", "FS318", message, "write another value, or " + remove("remove the change"))
        elif isinstance(change.start, m.Quantity) and change.start.si >= end_s:
            message = f"the clip ends after {end_s:g} s, so {what} never changes"
            help = "write an earlier time, or " + remove("remove the change")
            lints.add(change, "start", "FS318", message, help)


def _beyond_the_end(lints: Collector, clip: m.Clip, parent_ends_s: float) -> None:
    """Report a window with seconds that the run of the clip's parent never reaches."""
    if (window := clip.first(m.Window)) is not None and clip.end_s > parent_ends_s:
        message = f"the parent's run ends after {parent_ends_s:g} s, and this window goes beyond that"
        help: HelpText = "write times of the parent's run"
        if clip.start_s < parent_ends_s:
            help = "let it end then: " + write(f"window {value_text(window.start)}..{parent_ends_s:g} s")
        lints.add(window, "", "FS319", message, help)


_SCENARIO_LINTS = (_unused_parameters, _dead_cases, divisions_by_zero, dead_requirements)
"""All lints of a scenario as it is written."""
_CASE_LINTS = (certain_conditions, _nothing_expected, odd_measures, actor_lints, route_lints, _not_pinned)
"""All lints of a test case."""


# ---- places ---------------------------------------------------------------------------------------------------------


def _statements(case: TestCase, model: m.Definition) -> dict[int, m.Item]:
    """Return the statement in the file for each item of a concrete scenario, by the id of the concrete item."""
    written_items: dict[int, m.Item] = {id(case.scenario): model}
    if not isinstance(model, m.Scenario):
        return written_items
    left: dict[int, m.Item] = {id(item): item for item in model.body if not isinstance(item, SETTLED)}
    for item in case.scenario.body:
        same = left.get(id(item)) or next((line for line in left.values() if _same(line, item)), None)
        if same is not None:
            del left[id(same)]
            _pair(item, same, written_items)
    return written_items


def _same(line: m.Item, item: m.Item) -> bool:
    """Return whether a concrete statement can come from a written one: both have the same kind and name."""
    if type(line) is not type(item):
        return False
    if isinstance(line, m.When | m.Expect) and line.name is None:
        return line == item or any(isinstance(part, m.Ref | m.Expression) for part in walk(line))
    return getattr(line, "name", None) == getattr(item, "name", None)


def _pair(item: m.Item, line: m.Item, written_items: dict[int, m.Item]) -> None:
    # A statement without parameters is the same object in the concrete scenario.
    if type(item) is type(line) and item is not line:
        written_items[id(item)] = line
        inner = dict(fields_of(line))
        for name, part in fields_of(item):
            if name in inner:
                _pair(part, inner[name], written_items)


# ---- hidden characters -----------------------------------------------------------------------------------------------


def hidden_characters(text: str, path: str) -> Iterator[Diagnostic]:
    """Yield a warning for the first hidden character of each line, also in comments and texts.

    A character that changes the direction of writing (U+202E) lets an editor show a line differently from how it is
    read. A byte order mark at the beginning of the file is accepted.
    """
    for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        if line.isprintable():
            continue
        column = next((k for k, sign in enumerate(line) if _is_hidden(sign)), None)
        if column is not None:
            sign = line[column]
            name = unicodedata.name(sign, "a control character").lower()
            message = f"the invisible character U+{ord(sign):04X} ({name}) may make this line look different "
            message += "from what it says"
            span = Span(number, column + 1, number, column + 2)
            yield diagnostic_of("FS313", message, "delete the character", path, span, line)


def _is_hidden(sign: str) -> bool:
    """Return whether a character is a control code or has no visible shape; tabs and line ends are accepted."""
    return sign not in "\t\r" and unicodedata.category(sign) in ("Cc", "Cf", "Zl", "Zp")
