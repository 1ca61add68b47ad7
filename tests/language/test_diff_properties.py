"""What must hold for all models: nothing differs from itself, and the edit script gives the other model."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterable, Iterator
from typing import Any

from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from strategies import STATEMENTS, definitions

from foresee_dsl.language import model as m
from foresee_dsl.language.diff import (
    apply,
    diff_models,
    edit_from_dict,
    edit_to_dict,
    plain_text,
    render_groups,
    render_markdown,
)
from foresee_dsl.language.diff.matching import signature
from foresee_dsl.language.meaning import meaning_hash

EXAMPLES = int(os.environ.get("FORESEE_EXAMPLES", "8"))
"""Pairs of models that are drawn, each with some ten edits to compare (drawing costs forty times the comparison)."""
NO_MEANING = (m.Doc, m.Tags, m.Risk, m.Fidelity, m.Origin)
ORDERED = (m.Ego, m.Actor, m.Traffic, m.When)


def meaning(model: m.Item) -> Any:
    """A model's meaning, told independently of the comparison: order and texts out of it where they mean nothing."""
    top = isinstance(model, m.Scenario | m.Clip | m.Mutant | m.Network | m.Catalogue | m.Extension)
    fields: dict[str, Any] = {}
    for name in type(model).model_fields:
        value = getattr(model, name)
        if (name == "name" and top) or (name == "source" and isinstance(model, m.VehicleModel)):
            continue
        if isinstance(value, m.Item):
            value = value if isinstance(value, m.Quantity) else meaning(value)
        elif isinstance(value, tuple):
            value = _parts(model, value)
        fields[name] = signature(value) if isinstance(value, m.Item) else value
    return (type(model).__name__, fields)


def _parts(owner: m.Item, parts: Iterable[Any]) -> Any:
    kept = [part for part in parts if not isinstance(part, NO_MEANING)]
    if isinstance(owner, m.Scenario | m.Clip):
        ordered = [[repr(meaning(part)) for part in kept if isinstance(part, kind)] for kind in ORDERED]
        return (ordered, sorted(repr(meaning(part)) for part in kept if not isinstance(part, ORDERED)))
    made = [repr(meaning(p)) if isinstance(p, m.Item) and not isinstance(p, m.Quantity) else signature(p) for p in kept]
    unordered = isinstance(owner, m.Ego | m.Actor | m.Case | m.Catalogue | m.Mutant)
    return sorted(made, key=str) if unordered else made


@st.composite
def two_of_a_kind(draw: st.DrawFn) -> tuple[m.Definition, m.Definition]:
    host, kind = draw(st.sampled_from(STATEMENTS))
    return draw(definitions(host, kind)), draw(definitions(host, kind))


def edits(a: m.Definition, other: m.Definition) -> Iterator[m.Definition]:
    """The model with one statement dropped, added or moved, or one field of one statement changed."""
    body: tuple[m.Item, ...] = a.body
    bodies: list[tuple[m.Item, ...]] = []
    for at, item in enumerate(body):
        rest = (*body[:at], *body[at + 1 :])
        bodies += [rest, (item, *rest)]
        bodies += [(*body[:at], new, *body[at + 1 :]) for new in _one_field_changed(item, other.body)]
    bodies += [
        (*body[: at % (len(body) + 1)], item, *body[at % (len(body) + 1) :]) for at, item in enumerate(other.body)
    ]
    for edited in bodies:
        with contextlib.suppress(ValidationError):  # a definition may need the statement
            yield type(a).model_validate(dict(a) | {"body": edited})


def _one_field_changed(item: m.Item, givers: Iterable[m.Item]) -> Iterator[m.Item]:
    giver = next((found for found in givers if type(found) is type(item) and found != item), None)
    for name in type(item).model_fields if giver is not None else ():
        with contextlib.suppress(ValidationError):  # two fields that go together only as they were
            yield type(item).model_validate(dict(item) | {name: getattr(giver, name)})


def check_script(a: m.Definition, b: m.Definition) -> None:
    changes = diff_models(a, b)
    made = apply(a, changes)
    assert meaning(made) == meaning(b)
    assert diff_models(made, b) == ()
    read_back = [edit_from_dict(json.loads(json.dumps(edit_to_dict(change.edit)))) for change in changes]
    assert meaning(apply(a, reversed(read_back))) == meaning(b)
    assert (meaning(a) == meaning(b)) == (not changes)
    assert all(change.path and change.was != change.now for change in changes if change.kind != "moved")
    render_groups(changes)
    render_markdown(changes)


@settings(max_examples=EXAMPLES, derandomize="FORESEE_EXAMPLES" not in os.environ, phases=(Phase.generate,))
@given(two_of_a_kind())
def test_the_script_makes_one_model_of_another(both: tuple[m.Definition, m.Definition]) -> None:
    a, b = both
    assert diff_models(a, a) == ()
    assert diff_models(a, type(a).model_validate_json(a.model_dump_json())) == ()
    check_script(a, b)
    for edited in edits(a, b):
        check_script(a, edited)
    if isinstance(a, m.Scenario) and isinstance(b, m.Scenario):
        nowhere = m.Network(name="none", body=())
        made = apply(a, diff_models(a, b))
        assert meaning_hash(made, nowhere, {}) == meaning_hash(b, nowhere, {})


@settings(max_examples=EXAMPLES, derandomize="FORESEE_EXAMPLES" not in os.environ, phases=(Phase.generate,))
@given(two_of_a_kind())
def test_equal_meaning_is_equal_plain_text(both: tuple[m.Definition, m.Definition]) -> None:
    a, b = both
    shuffled = type(a).model_validate(dict(a) | {"body": tuple(sorted(a.body, key=lambda item: item.kind))})
    if not diff_models(a, shuffled):
        assert plain_text(a) == plain_text(shuffled)
    if diff_models(a, b):
        names = {"name": "x"}
        assert plain_text(a.model_copy(update=names)) != plain_text(b.model_copy(update=names))
