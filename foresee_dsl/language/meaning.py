"""Computes a hash of what a file means, which comments, layout, `doc`, tags, units and file names do not change."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import TypeVar

from foresee_dsl.files import read_outside
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.document import TestCase

VERSION = 1
"""Version of the hash. It is raised when the meaning of the language itself changes, so that all old pins become
stale."""

SIGNIFICANT_DIGITS = 9
"""Number of significant digits to which SI values are compared (ours): far finer than any unit's step, coarse enough
for the rounding of a conversion (`50 km/h` is 13.888888888... m/s)."""

_HASH_DIGITS = 12
_NO_MEANING = (
    *m.FOR_PEOPLE,
    *(m.UseNetwork, m.UseModels, m.UseTracks, m.Network),
    *(m.Param, m.Case, m.Cases, m.Require),
)
"""Statements of a scenario or clip that the hash's part for the scenario omits (the network, the models and the tracks
have parts of their own in the hash)."""

ORDERED: Mapping[type[m.Item], str] = {m.Ego: "ego", m.Actor: "actors", m.Traffic: "traffic", m.When: "whens"}
"""Statements whose order among their kind matters, with their key in the hash: the order gives the actors their ids
and the triggers their turn."""


def order_counts(item: object) -> type[m.Item] | None:
    """Return the kind of statements among which the order of this statement of a scenario counts; None if it does not.

    Parameters with grids are such a kind: the first of them changes fastest from one drawn case to the next.
    """
    if isinstance(item, m.Param) and isinstance(item.distribution, m.Grid):
        return m.Grid
    return next((kind for kind in ORDERED if isinstance(item, kind)), None)


_Json = object
_T = TypeVar("_T")
_CACHE_SIZE = 1000
_CACHE: dict[int, tuple[object, _Json]] = {}
"""The content of each item, by `id(item)`, so that it is computed once: items are immutable, and the mutants of a clip
share nearly all of their items."""
_PLAIN = frozenset({str, int, float, bool, type(None)})


def meaning_hash(
    scenario: m.Scenario, network: m.Network | Path, models: Mapping[str, m.VehicleModel], tracks: Path | None = None
) -> str:
    """Return the hash of a concrete scenario's meaning: `sha256:` and 12 hexadecimal digits.

    The name and `doc` of a network in the language do not count; for a foreign network and for recorded
    tracks the file's bytes count. Only the models that the scenario names count.
    """
    named = sorted(models_named(scenario))
    used = {name: _cached(models[name], _model) if name in models else None for name in named}
    recorded = {} if tracks is None else {"tracks": file_digest(tracks)}
    return _digest({"scenario": _body(scenario.body), "network": _network(network), "models": used, **recorded})


def clip_pin(clip: m.Clip, parent_meaning: str) -> str:
    """Return the pin for a mutant of this clip: a hash of the clip (without risk, fidelity, doc and name) and its
    parent's meaning."""
    return _digest({"clip": _body(clip.body), "parent": parent_meaning})


def pin_of(case: TestCase) -> str:
    """Return the pin for files derived from this test case: a scenario's or mutant's meaning, or the clip's pin."""
    if case.clip is not None and case.mutant is None:
        return clip_pin(case.clip, case.clip.pin)
    return case.meaning


def models_named(scenario: m.Scenario) -> frozenset[str]:
    """Return the names of all models that the actors and the traffic of a concrete scenario use."""
    own = {actor.model for actor in scenario.actors if isinstance(actor.model, str)}
    return frozenset(own.union(*(traffic.models for traffic in scenario.all(m.Traffic))))


def same_value(first: object, second: object) -> bool:
    """Return whether two values mean the same: quantities by their SI value and dimension, the rest by equality."""
    return first is second or _canonical(first) == _canonical(second)


def content_key(value: object) -> str:
    """Return a text that is the same for two values if and only if they mean the same."""
    return _sort_key(_canonical(value))


def _digest(content: dict[str, _Json]) -> str:
    text = json.dumps({"version": VERSION, **content}, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()[:_HASH_DIGITS]}"


def _body(body: Iterable[m.Item]) -> _Json:
    """Return a block's content: statements of kinds whose order matters stay in their order, all others are sorted."""
    items = [item for item in body if not isinstance(item, _NO_MEANING)]
    grouped = {name: [_canonical(item) for item in items if isinstance(item, kind)] for kind, name in ORDERED.items()}
    rest = [_canonical(item) for item in items if not isinstance(item, tuple(ORDERED))]
    return grouped | {"rest": sorted(rest, key=_sort_key)}


def _sort_key(content: _Json) -> str:
    return json.dumps(content, sort_keys=True)


def _canonical(value: object) -> _Json:
    """Return a value as JSON; two values of equal meaning give equal JSON."""
    if type(value) in _PLAIN:
        return value
    if isinstance(value, m.Quantity):
        return f"{value.si + 0.0:.{SIGNIFICANT_DIGITS}g} {value.dimension}"  # adding 0.0 turns -0 into 0
    if isinstance(value, tuple):
        return [_canonical(part) for part in value if not isinstance(part, m.Doc)]
    if isinstance(value, m.Ego | m.Actor):
        return _cached(value, _of_actor)
    if isinstance(value, m.When | m.Expect):
        return _cached(value, _unlabelled)
    return _expression(value) if isinstance(value, m.EXPRESSIONS) else _plain(value)


def _plain(value: object) -> _Json:
    return _fields(value) if isinstance(value, m.Item) else value


def _expression(value: m.Expression) -> _Json:
    """Return an expression's content; an expression without parameters has the content of its value, and `1 * gap` that
    of `gap`."""
    from foresee_dsl.language.arithmetic.evaluate import evaluate
    from foresee_dsl.language.arithmetic.normal import normal_form

    names = {ref.name for ref in references(value)}
    if not names:
        try:
            return _canonical(evaluate(value))
        except ExpressionError:
            return _fields(value)
    form = normal_form(value)
    alone = [m.Ref(name=name) for name in names if len(names) == 1]
    return _canonical(alone[0]) if alone and form == normal_form(alone[0]) else {"expression": form}


def _cached(item: _T, make: Callable[[_T], _Json]) -> _Json:
    """Return the content of an item, computed once; callers must not change it."""
    entry = _CACHE.get(id(item))
    if entry is None or entry[0] is not item:
        if len(_CACHE) >= _CACHE_SIZE:
            _CACHE.clear()
        entry = _CACHE[id(item)] = item, make(item)
    return entry[1]


def _of_actor(actor: m.Ego | m.Actor) -> _Json:
    body = sorted((_canonical(part) for part in actor.body), key=_sort_key)
    return _fields(actor.model_copy(update={"body": ()})) | {"body": body}


def _unlabelled(item: m.When | m.Expect) -> dict[str, _Json]:
    """Return the content of a trigger or an expectation without its label, which is for people, and without `once`, the
    default of a trigger."""
    fields = _fields(item)
    fields.pop("name", None)
    if fields.get("repeat") == "once":
        del fields["repeat"]
    return fields


def _fields(item: m.Item) -> dict[str, _Json]:
    # Straight from pydantic's dict: `getattr` takes three times as long. Cached properties of an item are in it too.
    values = item.__dict__
    present = ((name, values[name]) for name in _names(type(item)))
    return {name: _canonical(value) for name, value in present if value is not None}


@cache
def _names(kind: type[m.Item]) -> tuple[str, ...]:
    return tuple(kind.model_fields)


def _network(network: m.Network | Path) -> _Json:
    if isinstance(network, m.Network):
        # The order matters, because netconvert numbers what it builds in this order.
        return _cached(network, lambda network: {"body": _canonical(network.body)})
    return {"file": file_digest(network)}


def file_digest(file: Path) -> str:
    """Return the SHA-256 of a file's bytes, 64 hexadecimal digits; raises `OSError` as `files.read_outside` does."""
    status = file.stat()
    return _file_digest(str(file), status.st_mtime_ns, status.st_size)


def file_pin(file: Path) -> str:
    """Return the pin of a file: `sha256:` and the first 12 digits of the hash of its bytes; raises as `file_digest`."""
    return f"sha256:{file_digest(file)[:_HASH_DIGITS]}"


@lru_cache(maxsize=64)
def _file_digest(path: str, modified_ns: int, size: int) -> str:  # noqa: ARG001  (they key the cache)
    return hashlib.sha256(read_outside(Path(path))).hexdigest()


def _model(model: m.VehicleModel) -> _Json:
    # The source of the numbers has no effect on a run.
    return {name: value for name, value in _fields(model).items() if name != "source"}
