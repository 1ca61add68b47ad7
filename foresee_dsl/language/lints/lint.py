"""Lints: warnings about valid texts that are probably not meant, for one file and its test cases."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import remove, write
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.cases import case_values, needed_by
from foresee_dsl.language.codes import names as c
from foresee_dsl.language.codes.code import every_code
from foresee_dsl.language.lints import dead_text
from foresee_dsl.language.lints.actors import actor_lints, route_lints
from foresee_dsl.language.lints.allowances import without_allowed
from foresee_dsl.language.lints.certain import Limits, always, never
from foresee_dsl.language.lints.finding import LintFinding
from foresee_dsl.language.meaning import file_pin
from foresee_dsl.language.model.scenario import DEFAULT_END_S
from foresee_dsl.language.printer import written
from foresee_dsl.language.project.concretise import SETTLED
from foresee_dsl.language.project.document import Document, TestCase
from foresee_dsl.language.traversal import fields_of, walk

_TOO_FAST = "FS256"
"""The compiler's code for a speed above the model's maximum, which replaces the lint about the same speed."""


def lint(document: Document, cases: Iterable[TestCase]) -> tuple[Diagnostic, ...]:
    """Return the lints of a file without errors, sorted by place, except those that a comment allows.

    `cases`: the test cases of the file (none for a network or a catalogue). A lint of several cases is reported once.
    Clips and mutants have no lints of their own: the lints belong to their parents.
    """
    lints: dict[tuple[Span | None, str], Diagnostic] = {}
    if isinstance(document.model, m.Scenario):
        divisions = _divisions(document.model) if document.calculates else ()
        of_text = (*_unused_parameters(document.model), *_dead_cases(document.model), *divisions)
        for lint_ in (*of_text, *dead_text.dead_requirements(document.model)):
            _add(lints, document, lint_)
    for case in cases:
        if case.clip is None and case.mutant is None:
            places = _places(case, document.model)
            for lint_ in _of_case(case):
                item = places.get(id(lint_.item), lint_.item)
                _add(lints, document, replace(lint_, item=item))
    return without_allowed(document, [*lints.values(), *hidden_characters(document.text, document.path)])


def without_repeated(lints: Sequence[Diagnostic], placements: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Return the lints followed by `placements` (errors found on the network), without the lints that the placements
    repeat."""
    placed = {(d.code, d.path, d.span.line) for d in placements if d.span is not None}

    def repeats(lint: Diagnostic) -> bool:
        if lint.code == c.BROKEN_ROUTE:
            return True  # only the network decides whether a route is possible
        at = (_TOO_FAST, lint.path, lint.span.line) if lint.span is not None else None
        return lint.code == c.OVER_TOP_SPEED and at in placed

    return [*(lint for lint in lints if not repeats(lint)), *placements]


def _add(lints: dict[tuple[Span | None, str], Diagnostic], document: Document, lint_: LintFinding) -> None:
    if document.span(lint_.item) is None:
        return  # it is written in a file that this one extends, which is checked on its own
    diagnostic = document.diagnostic(lint_.item, lint_.field, lint_.code, lint_.message, lint_.help)
    span = diagnostic.span
    # Only the first line is underlined, because a whole underlined block is unreadable.
    if span is not None and span.end_line != span.line:
        end = len(diagnostic.source_line.split("{")[0].rstrip()) + 1
        span = Span(span.line, span.column, span.line, max(end, span.column + 1))
    lints.setdefault((span, lint_.code), replace(diagnostic, span=span, severity=every_code()[lint_.code].severity))


# ---- lints of the text ----------------------------------------------------------------------------------------------


def _unused_parameters(scenario: m.Scenario) -> Iterator[LintFinding]:
    users = (item for item in scenario.body if not isinstance(item, m.Case))
    used = {part.name for item in users for part in walk(item) if isinstance(part, m.Ref)}
    types = {parameter.name: parameter.type for parameter in scenario.all(m.Param)}
    assignments = (assignment for case in scenario.all(m.Case) for assignment in case.values)
    used |= {ref.name for assignment in assignments for ref in needed_by(assignment, types)}
    for parameter in scenario.all(m.Param):
        if parameter.name not in used:
            help = "write " + write(parameter.name) + " where its value belongs, or " + remove("remove it")
            yield LintFinding(parameter, "name", c.UNUSED_PARAMETER, f"nothing uses parameter '{parameter.name}'", help)


def _dead_cases(scenario: m.Scenario) -> Iterator[LintFinding]:
    seen: dict[tuple[tuple[str, object], ...], str] = {}
    for case in scenario.all(m.Case):
        key = tuple(sorted((name, _comparable(value)) for name, value in case_values(scenario, case).items()))
        if key in seen:
            message = f"case '{case.name}' has the same values as case '{seen[key]}'"
            yield LintFinding(
                case, "name", c.DEAD_CASE, message, "change a value, or " + remove("remove one of the two")
            )
        seen.setdefault(key, case.name)


def _divisions(scenario: m.Scenario) -> Iterator[LintFinding]:
    from foresee_dsl.language.lints.arithmetic import divisions_by_zero

    for item, message, help in divisions_by_zero(scenario):
        yield LintFinding(item, "", c.MAY_DIVIDE_BY_ZERO, message, help)


def _comparable(value: m.ParamValue) -> object:
    return f"{value.si:.9g}" if isinstance(value, m.Quantity) else value


# ---- lints of a test case -------------------------------------------------------------------------------------------


def _of_case(case: TestCase) -> Iterator[LintFinding]:
    scenario = case.scenario
    end = scenario.first(m.End)
    end_s = end.after.si if end is not None and isinstance(end.after, m.Quantity) else DEFAULT_END_S
    limits, actions = dead_text.limits_of(case, end_s), dead_text.actions_of(scenario)
    for when in scenario.all(m.When):
        yield from dead_text.dead_triggers(when, limits, actions)
    for expect in scenario.all(m.Expect):
        yield from _expectation(expect, limits)
    yield from _nothing_expected(scenario)
    yield from dead_text.blind_actors(scenario)
    yield from dead_text.of_itself(scenario)
    yield from actor_lints(case)
    yield from route_lints(case)
    yield from _not_pinned(case)


def _expectation(expect: m.Expect, limits: Limits) -> Iterator[LintFinding]:
    until = expect.within.si if isinstance(expect.within, m.Quantity) else limits.end_s
    if until > limits.end_s and expect.within is not None:
        message = (
            f"the run ends after {limits.end_s:g} s, which is before the {written(expect.within)} of this "
            "expectation are over"
        )
        help = "write " + write(f"end after {written(expect.within)}") + ", or give the expectation a shorter time"
        yield LintFinding(expect, "within", c.CUT_SHORT, message, help)
    inside = replace(limits, end_s=min(until, limits.end_s))
    cannot, must = never(expect.condition, inside), always(expect.condition, inside)
    if not (cannot or must):
        yield from dead_text.dead_parts(expect.condition, inside)
        return
    met = bool(cannot) if expect.mode == "never" else bool(must)
    message = f"this {'always holds' if met else 'can never hold'}: {cannot or must}"
    yield LintFinding(
        expect,
        "condition",
        c.DECIDED,
        message,
        "expect something that a driver can meet or miss, or " + remove("remove it"),
    )


def _nothing_expected(scenario: m.Scenario) -> Iterator[LintFinding]:
    named = {getattr(part, field, None) for expect in scenario.all(m.Expect) for part in walk(expect)
             for field in ("actor", "other", "name")}  # fmt: skip
    if "ego" in named:
        return
    message = f"scenario '{scenario.name}' expects nothing of the ego"
    yield LintFinding(
        scenario, "name", c.NOTHING_EXPECTED, message, "add " + write("expect never collision(ego)") + ", for example"
    )


def _not_pinned(case: TestCase) -> Iterator[LintFinding]:
    used = case.scenario.first(m.UseTracks)
    if used is not None and used.pin is None and case.tracks is not None:
        message = f"'{used.path}' is not pinned, so nothing notices when it changes"
        help = "write " + write(f'use tracks "{used.path}" pin {file_pin(case.tracks)}')
        yield LintFinding(used, "", c.NO_PIN, message, help)


# ---- places ---------------------------------------------------------------------------------------------------------


def _places(case: TestCase, model: m.Definition) -> dict[int, m.Item]:
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
            yield Diagnostic(
                c.HIDDEN_CHARACTER,
                (
                    f"the invisible character U+{ord(sign):04X} ({name}) may make this line look different "
                    "from what it says"
                ),
                "delete the character",
                path,
                Span(number, column + 1, number, column + 2),
                line,
                "warning",
            )


def _is_hidden(sign: str) -> bool:
    """Return whether a character is a control code or has no visible shape; tabs and line ends are accepted."""
    return sign not in "\t\r" and unicodedata.category(sign) in ("Cc", "Cf", "Zl", "Zp")
