"""A kind of statement is stated once, in its class: whoever adds one is told here what is still missing."""

from __future__ import annotations

import inspect
import re
from typing import Any, get_args

import pytest

from foresee_dsl.derive.clipping import clip, conditions
from foresee_dsl.derive.clipping.triggers import Resumed
from foresee_dsl.language import model as m
from foresee_dsl.language.keywords import KEYWORDS, keywords_in
from foresee_dsl.language.model.item import Group
from foresee_dsl.language.model.pattern import Slot, form_of, read_pattern, slots_of, words_before
from foresee_dsl.language.printer import layout, written
from foresee_dsl.language.syntax.grammar import parser
from foresee_dsl.simulate.triggers import director, kinds
from tests.support.strategies import STATEMENTS

RULES = {rule.alias or rule.origin.name for rule in parser().rules}
WRITTEN_BY_HAND = {
    m.Quantity: "a number and its unit",
    m.Measure: "its pattern depends on what it measures",
}
MADE_FROM = {m.Sum: "calculation", m.Product: "calculation", m.Calculated: "calculation"}
"""Rules that make several classes."""
NOT_IN_PATTERNS = {
    m.EdgeRoute: {"shortest"},  # the three dots
    m.Calculated: {"value", "unit"},  # what its expression comes to
}


def members(union: Any) -> set[str]:
    """The names of the classes in a union of the model."""
    return {kind.__name__ for kind in get_args(get_args(union)[0])}


def slots(kind: type[m.Item]) -> set[str]:
    pattern = read_pattern(kind.pattern)
    every = [slot for parts in (pattern.head, *pattern.settings) for slot in slots_of(parts)]
    return {slot.field for slot in every} | {pattern.body} - {""}


@pytest.mark.parametrize("kind", m.ITEMS, ids=lambda kind: kind.__name__)
def test_a_class_has_a_rule_and_a_pattern_with_its_fields(kind: type[m.Item]) -> None:
    rule = m.rule_of(kind)
    assert rule in RULES or kind in MADE_FROM, f"grammars/foresee.lark has no rule `{rule}` for {kind.__name__}"
    if kind in WRITTEN_BY_HAND:
        return
    assert kind.pattern, f"{kind.__name__} has no pattern"
    fields = {name for name in kind.model_fields if name != "kind"} - NOT_IN_PATTERNS.get(kind, set())
    assert fields <= slots(kind), f"the pattern of {kind.__name__} is without {fields - slots(kind)}"
    assert slots(kind) <= set(kind.model_fields)


@pytest.mark.parametrize("kind", m.ITEMS, ids=lambda kind: kind.__name__)
def test_every_word_of_a_pattern_has_a_meaning(kind: type[m.Item]) -> None:
    plain = re.sub(r"\{\w+(:[^}]*)?\}|\.\.\.\w+", " ", kind.pattern)
    missing = set(re.findall(r"[a-z_]+", plain)) - KEYWORDS.keys() - {"junction", "route"}
    assert not missing, f"add to `words` of {kind.__name__}: {missing}"


def test_no_word_is_explained_twice() -> None:
    words = [keyword.word for kind in m.ITEMS for keyword in keywords_in(kind.words)]
    assert len(words) == len(set(words))


@pytest.mark.parametrize("kind", m.ITEMS, ids=lambda kind: kind.__name__)
def test_every_word_has_a_group(kind: type[m.Item]) -> None:
    found = list(keywords_in(kind.words))
    assert len(found) == kind.words.count("|"), "write it as `word (group): meaning | example`"
    assert {keyword.group for keyword in found} <= set(get_args(Group))


def test_every_statement_is_printed_and_read_back() -> None:
    """`test_properties` does so with every statement that a block can hold: here, that it knows all of them."""
    tried = {kind for _, kind in STATEMENTS}
    statements = {kind for kind in m.ITEMS if not issubclass(kind, m.Phrase)} - set(get_args(m.Definition))
    assert statements <= tried | {m.Stage, m.Assignment}  # tried inside junctions and cases
    assert not [kind for kind in tried if issubclass(kind, m.Phrase)]


def test_triggers_and_clips_handle_every_class() -> None:
    """mypy says so too (`assert_never`); here for whoever runs the tests alone."""
    sources = {module: inspect.getsource(module) for module in (clip, conditions, kinds, director)}
    handled = {module: set(re.findall(r"\bm\.(\w+)\(", source)) for module, source in sources.items()}
    assert members(m.ScenarioItem) | members(m.ActorItem) <= handled[clip]
    assert members(m.Condition) <= handled[conditions] | handled[kinds]
    assert members(m.Action) - {"Wait", "Then"} <= handled[director]


def test_a_clip_states_the_rest_of_every_action_that_lasts() -> None:
    kinds_ = get_args(get_args(m.Action)[0])
    last = {kind for kind in kinds_ if {"duration", "over"} & set(kind.model_fields)} - {m.Wait}
    assert last <= set(get_args(Resumed)), "a clip that begins during the action loses it: add it to `Resumed`"


@pytest.mark.parametrize("kind", get_args(get_args(m.Action)[0]), ids=lambda kind: kind.__name__)
def test_it_is_said_when_an_action_is_complete(kind: type[m.Item]) -> None:
    words = {keyword.word for keyword in keywords_in(kind.words)}
    words |= set(re.findall(r"[a-z]+", re.sub(r"\{\w+\}", " ", kind.pattern))) - {"for", "at", "with"}
    said = inspect.cleandoc(m.Then.__doc__ or "").partition("An action is complete:")[2]
    assert kind in (m.Wait, m.Then) or words & set(re.findall(r"\w+", said)), (
        f"add it to the docstring of Then: {words}"
    )


def test_what_may_change_is_a_field_of_the_class_that_holds_it() -> None:
    for name, rule in m.PROPERTIES.items():
        kind, field = rule.statement or (m.Actor, name)
        assert field in kind.model_fields
        assert form_of(kind, field).dimension == rule.dimension
    for name, owner in m.OWNERS.items():
        kinds = [kind for kind in m.ITEMS if name in {keyword.word for keyword in keywords_in(kind.words)}]
        assert kinds and set(owner.properties) <= set(kinds[0].model_fields)
        assert {form_of(kinds[0], field).dimension for field in owner.properties} <= {owner.dimension}


def test_the_notation_of_patterns() -> None:
    pattern = read_pattern("road {name} [from {start}] [{ lanes; via {via}; ...parts }]")
    assert pattern.head[:2] == ("road ", Slot("name"))
    assert [slot.field for slot in pattern.slots] == ["name", "start"]
    assert (len(pattern.settings), pattern.body, pattern.braces) == (2, "parts", "filled")
    assert list(words_before(pattern)) == [("road", "name"), ("from", "start"), ("lanes", "lanes"), ("via", "via")]
    route = m.Route(start="south", legs=())
    assert written(route) == "route from south"
    assert layout(m.Then(actions=(m.Starts(actor="a"),))).head == "then"
    assert written(m.EdgeRoute(edges=("a",), shortest=True)) == "route [a, ...]"
