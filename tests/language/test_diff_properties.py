"""What must hold for all models: nothing differs from itself, and the edit script gives the other model."""

from __future__ import annotations

import contextlib
import json
import os
import random
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any

from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from foresee_dsl.documents import plain
from foresee_dsl.language import model as m
from foresee_dsl.language.diff.compare import diff_models
from foresee_dsl.language.diff.parts import Edit, apply
from foresee_dsl.language.diff.plain import plain_text
from foresee_dsl.language.diff.rendering import render_groups, render_markdown
from foresee_dsl.language.meaning import content_key, meaning_hash
from tests.support.strategies import any_definition
from tests.support.variations import varied

EXAMPLES = 320
"""How many models are compared with others in CI: each with four of its variations, and one more for `git diff`."""
SETTINGS = settings(
    max_examples=int(os.environ.get("FORESEE_EXAMPLES", EXAMPLES)),
    derandomize="FORESEE_EXAMPLES" not in os.environ,
    phases=(Phase.explicit, Phase.generate),  # without shrinking, which takes minutes on models of this size
)
NO_MEANING = (m.Doc, m.Tags, m.Risk, m.Fidelity, m.Expected, m.Origin)
ORDERED = (m.Ego, m.Actor, m.Traffic, m.When)


VALUES = (m.Quantity, *m.EXPRESSIONS)
"""Values, whose meaning is a number: `pa + 0` means the same as `pa - 0`."""


def meaning(model: m.Item) -> Any:
    """A model's meaning, told independently of the comparison: order and texts out of it where they mean nothing."""
    top = isinstance(model, m.Definition)
    fields: dict[str, Any] = {}
    for name in type(model).model_fields:
        value = getattr(model, name)
        if (name == "name" and (top or isinstance(model, m.When | m.Expect))) or (
            name == "source" and isinstance(model, m.VehicleModel)
        ):
            continue
        if name == "repeat" and value == "once":
            value = None  # what a trigger does anyway
        if isinstance(value, m.Item):
            value = value if isinstance(value, VALUES) else meaning(value)
        elif isinstance(value, tuple):
            value = _parts(model, value)
        fields[name] = content_key(value) if isinstance(value, m.Item) else value
    return (type(model).__name__, fields)


def _parts(owner: m.Item, parts: Iterable[Any]) -> Any:
    kept = [part for part in parts if not isinstance(part, NO_MEANING)]
    if isinstance(owner, m.Scenario | m.Clip):
        ordered = [[repr(meaning(part)) for part in kept if isinstance(part, kind)] for kind in ORDERED]
        return (ordered, sorted(repr(meaning(part)) for part in kept if not isinstance(part, ORDERED)))
    made = [repr(meaning(p)) if isinstance(p, m.Item) and not isinstance(p, VALUES) else content_key(p) for p in kept]
    unordered = isinstance(owner, m.Ego | m.Actor | m.Case | m.Catalogue | m.Mutant)
    return sorted(made, key=str) if unordered else made


def edited(a: m.Definition, other: m.Definition, rng: random.Random) -> Iterator[m.Definition]:
    """Models with one statement dropped, added or moved, or one field of one statement changed, in a drawn order."""
    bodies = list(_edited_bodies(a, other))
    rng.shuffle(bodies)
    for body in bodies:
        with contextlib.suppress(ValidationError):  # two fields go together only as they were; a statement is needed
            items = tuple(item if item in a.body else type(item).model_validate(dict(item)) for item in body)
            yield type(a).model_validate(dict(a) | {"body": items})


def _edited_bodies(a: m.Definition, other: m.Definition) -> Iterator[tuple[m.Item, ...]]:
    """Yield all such bodies; a statement with a changed field is not validated."""
    body: tuple[m.Item, ...] = a.body
    for at, item in enumerate(body):
        before, after = body[:at], body[at + 1 :]
        yield (*before, *after)
        yield (item, *before, *after)
        yield from ((*before, changed, *after) for changed in _one_field_changed(item, other.body))
    for at, item in enumerate(other.body):
        place = at % (len(body) + 1)
        yield (*body[:place], item, *body[place:])


def _one_field_changed(item: m.Item, givers: Iterable[m.Item]) -> Iterator[m.Item]:
    giver = next((found for found in givers if type(found) is type(item) and found != item), None)
    for name in type(item).model_fields if giver is not None else ():
        yield item.model_copy(update={name: getattr(giver, name)})


def _edit(data: dict[str, Any]) -> Edit:
    return Edit(data["op"], tuple(data["at"]), data["value"], data["rank"])


def check_script(a: m.Definition, b: m.Definition) -> None:
    changes = diff_models(a, b)
    made = apply(a, changes)
    assert meaning(made) == meaning(b)
    assert diff_models(made, b) == ()
    read_back = [_edit(json.loads(json.dumps(plain(change.edit)))) for change in changes]
    assert meaning(apply(a, reversed(read_back))) == meaning(b)
    assert (meaning(a) == meaning(b)) == (not changes)
    assert all(change.path for change in changes)
    assert all(change.was != change.now or change.note for change in changes if change.kind != "moved")
    render_groups(changes)
    render_markdown(changes)


@SETTINGS
@given(any_definition(), st.integers(0, 2**32))
def test_the_script_makes_one_model_of_another(a: m.Definition, seed: int) -> None:
    networks = [item for item in a.body if isinstance(item, m.Add) and isinstance(item.item, m.Network)]
    assume(len(networks) < 2)  # a scenario has one network, so which of two comes first means nothing
    rng = random.Random(seed)
    b = varied(a, rng, changes=4)
    assert diff_models(a, a) == ()
    assert diff_models(a, type(a).model_validate_json(a.model_dump_json())) == ()
    for other in (varied(a, rng), b, *islice(edited(a, b, rng), 2)):
        check_script(a, other)
    if isinstance(a, m.Scenario) and isinstance(b, m.Scenario):
        nowhere = m.Network(name="none", body=())
        made = apply(a, diff_models(a, b))
        assert meaning_hash(made, nowhere, {}) == meaning_hash(b, nowhere, {})


@settings(SETTINGS, max_examples=SETTINGS.max_examples // 3)
@given(any_definition(), st.integers(0, 2**32))
def test_equal_meaning_is_equal_plain_text(a: m.Definition, seed: int) -> None:
    shuffled = type(a).model_validate(dict(a) | {"body": tuple(sorted(a.body, key=lambda item: item.kind))})
    if not diff_models(a, shuffled):
        assert plain_text(a) == plain_text(shuffled)
    b = varied(a, random.Random(seed))
    if diff_models(a, b):
        names = {"name": "x"}
        assert plain_text(a.model_copy(update=names)) != plain_text(b.model_copy(update=names))
