"""What a file means, as a hash: comments, layout, `doc`, tags, units and file names do not change it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import TypeVar

from foresee_dsl.language.model import (
    Actor,
    Case,
    Cases,
    Clip,
    Doc,
    Ego,
    Expect,
    Fidelity,
    Item,
    Network,
    Param,
    Quantity,
    Require,
    Risk,
    Scenario,
    Tags,
    Traffic,
    UseModels,
    UseNetwork,
    VehicleModel,
    When,
)
from foresee_dsl.language.project.document import TestCase

VERSION = 1
"""Goes into every hash: raised when the meaning of the language itself changes, so that old pins show as stale."""

SIGNIFICANT_DIGITS = 9
"""SI values are compared to this many digits (ours): far finer than any unit's step, coarse enough for the rounding of
a conversion (`50 km/h` is 13.888888888... m/s)."""

_HASH_DIGITS = 12
_NO_MEANING = (Doc, Tags, Risk, Fidelity, UseNetwork, UseModels, Network, Param, Case, Cases, Require)
"""Statements of a scenario or clip that its own part of the hash leaves out (the network and models enter apart)."""

_GROUPS: tuple[tuple[str, tuple[type[Item], ...]], ...] = (
    ("ego", (Ego,)),
    ("actors", (Actor,)),
    ("traffic", (Traffic,)),
    ("whens", (When,)),
)
"""Statements whose order among their like is kept: it gives the actors their ids and the triggers their turn."""

_Json = object
_Kept = TypeVar("_Kept")
_MOST_KEPT = 1000
_KEPT: dict[int, tuple[object, _Json]] = {}
"""The content of items by identity (they are never changed): the children of a clip share nearly all of theirs."""
_PLAIN = frozenset({str, int, float, bool, type(None)})


def meaning_hash(scenario: Scenario, network: Network | Path, models: Mapping[str, VehicleModel]) -> str:
    """Return the hash of what a concrete scenario means: `sha256:` and 12 hexadecimal digits.

    Args:
        scenario: concrete.
        network: in the language (its name and `doc` do not count), or a foreign file (its bytes count).
        models: the catalogue; only the models that the scenario names count.
    """
    named = sorted(models_named(scenario))
    return _digest(
        {
            "scenario": _body(scenario.body),
            "network": _network(network),
            "models": {name: _kept(models[name], _model) if name in models else None for name in named},
        }
    )


def clip_pin(clip: Clip, parent_meaning: str) -> str:
    """Return what a mutant pins: the clip's meaning (without risk, fidelity, doc and name) over its parent's."""
    return _digest({"clip": _body(clip.body), "parent": parent_meaning})


def pin_of(case: TestCase) -> str:
    """Return what a child of this test case pins: a scenario's or mutant's meaning, or the clip's pin."""
    if case.clip is not None and case.mutant is None:
        return clip_pin(case.clip, case.clip.pin)
    return case.meaning


def models_named(scenario: Scenario) -> frozenset[str]:
    """Return the names of all models that the actors and the traffic of a concrete scenario use."""
    own = {actor.model for actor in scenario.actors if isinstance(actor.model, str)}
    return frozenset(own.union(*(traffic.models for traffic in scenario.all(Traffic))))


def same_value(one: object, other: object) -> bool:
    """Return whether two values mean the same: quantities by their SI value and dimension, the rest by equality."""
    return _canonical(one) == _canonical(other)


def _digest(content: dict[str, _Json]) -> str:
    text = json.dumps({"version": VERSION, **content}, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()[:_HASH_DIGITS]}"


def _body(body: Iterable[Item]) -> _Json:
    """Return a block's content: kinds whose order matters in order, all others sorted."""
    items = [item for item in body if not isinstance(item, _NO_MEANING)]
    grouped: dict[str, _Json] = {}
    for name, kinds in _GROUPS:
        grouped[name] = [_canonical(item) for item in items if isinstance(item, kinds)]
    ordered = tuple(kind for _, kinds in _GROUPS for kind in kinds)
    rest = [_canonical(item) for item in items if not isinstance(item, ordered)]
    return grouped | {"rest": sorted(rest, key=_sort_key)}


def _sort_key(content: _Json) -> str:
    return json.dumps(content, sort_keys=True)


def _canonical(value: object) -> _Json:
    """Return a value as JSON in which equal meaning is equal content."""
    if type(value) in _PLAIN:
        return value
    if isinstance(value, Quantity):
        return _quantity(value)
    if isinstance(value, Item):
        return _item(value)
    if isinstance(value, tuple):
        return [_canonical(part) for part in value if not isinstance(part, Doc)]
    return value


def _item(item: Item) -> _Json:
    if isinstance(item, Ego | Actor):
        return _kept(item, _of_actor)
    if isinstance(item, When | Expect):
        return _kept(item, _unlabelled)
    return _fields(item)


def _kept(item: _Kept, make: Callable[[_Kept], _Json]) -> _Json:
    """Return the content of an item, made when it is asked for first; nobody may change it."""
    known = _KEPT.get(id(item))
    if known is None or known[0] is not item:
        if len(_KEPT) >= _MOST_KEPT:
            _KEPT.clear()
        known = _KEPT[id(item)] = item, make(item)
    return known[1]


def _of_actor(actor: Ego | Actor) -> _Json:
    body = sorted((_canonical(part) for part in actor.body), key=_sort_key)
    return _fields(actor.model_copy(update={"body": ()})) | {"body": body}


def _unlabelled(item: When | Expect) -> dict[str, _Json]:
    """A label is for people, and `once` is what a trigger does anyway."""
    fields = _fields(item)
    fields.pop("name", None)
    if fields.get("repeat") == "once":
        del fields["repeat"]
    return fields


def _fields(item: Item) -> dict[str, _Json]:
    # As pydantic keeps them; asking for each takes three times as long. What an item worked out once is kept there too.
    kept = item.__dict__
    present = ((name, kept[name]) for name in _names(type(item)))
    return {name: _canonical(value) for name, value in present if value is not None}


@cache
def _names(kind: type[Item]) -> tuple[str, ...]:
    return tuple(kind.model_fields)


def _quantity(value: Quantity) -> _Json:
    number = value.si + 0.0  # -0 becomes 0
    return f"{number:.{SIGNIFICANT_DIGITS}g} {value.dimension}"


def _network(network: Network | Path) -> _Json:
    if isinstance(network, Network):
        # In order: netconvert numbers what it builds in this order.
        return _kept(network, lambda network: {"body": _canonical(network.body)})
    status = network.stat()
    return {"file": _file_digest(str(network), status.st_mtime_ns, status.st_size)}


@lru_cache(maxsize=64)
def _file_digest(path: str, modified_ns: int, size: int) -> str:  # noqa: ARG001  (they key the cache)
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def _model(model: VehicleModel) -> _Json:
    fields = _fields(model)
    fields.pop("source", None)  # says where the numbers are from; means nothing
    return fields
