"""Compares two definitions of one kind, statement by statement, which are paired by equality, name or similarity."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from foresee_dsl.errors import with_article
from foresee_dsl.language import model as m
from foresee_dsl.language.diff import wording as w
from foresee_dsl.language.diff.parts import At, Difference, Edit, Group, kind_of, renamed
from foresee_dsl.language.meaning import content_key, order_counts, same_value
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project.addresses import mistake
from foresee_dsl.language.traversal import is_condition

_UNORDERED_BODIES = (m.Ego, m.Actor, m.Case, m.Catalogue, m.Mutant)


@dataclass(frozen=True)
class _PathInModel:
    """The place that the comparison has reached, in words and as a path in the first model."""

    words: str
    at: At
    group: Group

    def inside(self, *steps: str | int, words: str | None = None) -> _PathInModel:
        return replace(self, words=self.words if words is None else words, at=(*self.at, *steps))


def diff_models(a: m.Definition, b: m.Definition) -> tuple[Difference, ...]:
    """Return the differences in meaning, in the order of the first file; additions come last in their block.

    These differences are ignored: names of the definitions, `doc`, tags, comments, layout, units, the order of
    statements where it has no meaning, and the origin of a mutant. To compare a clip or a mutant with its parent,
    expand both (`expand.expanded_model`), or see `compare_addresses`.

    Raises:
        InputError: the two are of different kinds.
    """
    if type(a) is not type(b):
        message = f"'{a.name}' is {with_article(a.kind)}, but '{b.name}' is {with_article(b.kind)}"
        help = "compare two files of one kind, or a clip or mutant with its expanded parent"
        raise mistake("FS140", message, help, "")
    after, names = _renames(a, b)
    place = _PathInModel("", (), _group_of_file(a))
    renamings = (
        Difference(_group(place, after, item), w.label(item), "renamed", old, new, "", Edit("rename", (), (old, new)))
        for old, new in names
        for item in (next(item for item in getattr(after, "body", ()) if w.name_of(item) == new),)
    )
    return (*renamings, *_settings(place, after, b))


def _group_of_file(model: m.Item) -> Group:
    if isinstance(model, m.Network):
        return "network"
    return "environment" if isinstance(model, m.Catalogue) else "parent"


def _group(place: _PathInModel, owner: m.Item, item: m.Item) -> Group:
    """Return the group of a statement; a statement inside another one has the group of the outer statement."""
    return place.group if place.words or isinstance(owner, m.Network | m.Catalogue) else w.group_of(item)


def _apart(a: m.Item, b: m.Item) -> list[str]:
    """Return the fields in which two items of one class differ in meaning."""
    nothing = set(_means_nothing(a)) & set(_means_nothing(b))
    fields = (name for name in type(a).model_fields if name not in nothing)
    return [name for name in fields if not same_value(getattr(a, name), getattr(b, name))]


def _no_field(item: m.Item) -> tuple[str, ...]:
    """Return the fields of an item that are not compared as settings: the fields that its label shows, and the fields
    that have no meaning."""
    if isinstance(item, m.Definition):
        return ("kind", "name")
    if isinstance(item, m.VehicleModel):
        return ("kind", "name", "source")
    if isinstance(item, m.SignalState):
        return ("kind", "junction")
    return () if isinstance(item, m.Actor) else ("kind",)


def _item(place: _PathInModel, a: m.Item, b: m.Item) -> Iterator[Difference]:
    """Compare two items at one place."""
    if same_value(a, b):
        return
    if type(a) is not type(b):
        alike = w.is_statement(a) and w.label(a) == w.label(b)
        yield _changed(place, a, b, _text_of(a), _text_of(b)) if alike else _changed(place, a, b, w.text(a), w.text(b))
    elif w.is_statement(a):
        yield from _statement(place, a, b)
    elif is_condition(a):
        yield from _condition(place, a, b)
    elif "kind" not in type(a).model_fields and not w.is_value(a):
        yield from _settings(place, a, b)
    else:
        yield _changed(place, a, b, w.text(a), w.text(b))


def _text_of(item: m.Item) -> str:
    return w.tail(item) if w.is_statement(item) else w.text(item)


def _statement(place: _PathInModel, a: m.Item, b: m.Item) -> Iterator[Difference]:
    if w.by_settings(a) or all(is_condition(getattr(a, name)) for name in _apart(a, b)):
        yield from _settings(place, a, b)
    else:
        yield _changed(place, a, b, w.tail(a), w.tail(b) if w.label(a) == w.label(b) else w.text(b))


def _settings(place: _PathInModel, a: m.Item, b: m.Item) -> Iterator[Difference]:
    """Compare two items of one class field by field."""
    for name in _apart(a, b):
        if name in _no_field(a):
            continue
        before, after = getattr(a, name), getattr(b, name)
        inner, named = place.inside(name), place.inside(name, words=w.field_path(place.words, a, name))
        items = isinstance(before, m.Item) and isinstance(after, m.Item)
        if _all_parts(w.is_statement, before, after):
            yield from _block(inner, a, before, after)
        elif items and (is_condition(before) or w.is_statement(before)):
            yield from _item(inner, before, after)
        elif items and type(before) is type(after):
            yield from _item(named, before, after)
        else:
            was = None if _absent(before, after) else w.setting(a, name)
            now = None if _absent(after, before) else w.setting(b, name)
            yield _changed(named, before, after, was, now)


def _absent(value: object, other: object) -> bool:
    """Return whether a value counts as not written when the other file has `other`: for a junction, a bare `crossings`
    is an empty list, and no `crossings` is None."""
    return value is None or value is False or (value == () and other is not None)


def _changed(place: _PathInModel, a: object, b: object, was: str | None, now: str | None) -> Difference:
    kind = kind_of(was, now)
    note = w.note(a, b) if kind == "changed" else ""
    if kind == "changed" and was == now:  # different values can have equal texts
        note = "a parameter in one of the two"
    return Difference(place.group, place.words, kind, was, now, note, Edit("set", place.at, b))


# ---- conditions ----------------------------------------------------------------------------------------------------


def _condition(place: _PathInModel, a: m.Item, b: m.Item) -> Iterator[Difference]:
    """Compare two conditions of one class, down to the smallest parts that can be printed on their own."""
    apart = [(name, getattr(a, name), getattr(b, name)) for name in _apart(a, b)]
    for _, before, after in apart:
        if not (is_condition(before) and is_condition(after)) and not _all_parts(is_condition, before, after):
            yield _changed(place, a, b, w.text(a), w.text(b))
            return
    for name, before, after in apart:
        if isinstance(before, tuple):
            yield from _block(place.inside(name), a, before, after)
        else:
            yield from _item(place.inside(name), before, after)


def _all_parts(test: Callable[[object], bool], a: object, b: object) -> bool:
    """Return whether two values of a field are both lists whose parts all pass a test."""
    return isinstance(a, tuple) and isinstance(b, tuple) and all(map(test, (*a, *b)))


# ---- blocks --------------------------------------------------------------------------------------------------------


def _block(place: _PathInModel, owner: m.Item, a: Sequence[m.Item], b: Sequence[m.Item]) -> Iterator[Difference]:
    """Compare the statements of two blocks, or the parts of two conditions."""
    pairs = match(a, b)
    words = _labels(a)
    for i, item in enumerate(a):
        if isinstance(item, m.FOR_PEOPLE):
            continue
        there = _PathInModel(_inside(place.words, item, words[i]), (*place.at, i), _group(place, owner, item))
        if i in pairs:
            yield from _item(there, item, b[pairs[i]])
        else:
            yield Difference(there.group, there.words, "removed", _text_of(item), None, "", Edit("remove", there.at))
    yield from _orders(place, owner, a, b, pairs)
    yield from _inserted(place, owner, b, pairs)


def _inside(owner: str, item: m.Item, words: str) -> str:
    return w.join(owner, words) if w.is_statement(item) else owner


def _labels(items: Sequence[m.Item]) -> list[str]:
    """Return every statement's label; equal labels get a number."""
    seen: Counter[str] = Counter()
    labels = []
    for words in (w.label(item) if w.is_statement(item) else "" for item in items):
        seen[words] += 1
        labels.append(words if seen[words] == 1 else f"{words} ({seen[words]})")
    return labels


def _inserted(place: _PathInModel, owner: m.Item, b: Sequence[m.Item], pairs: dict[int, int]) -> Iterator[Difference]:
    back = {j: i for i, j in pairs.items()}
    words = _labels(b)
    last: dict[object, int] = {}
    for j, item in enumerate(b):
        family = _family(owner, item)
        if j in back:
            last[family] = back[j]
        elif not isinstance(item, m.FOR_PEOPLE):
            edit = Edit("insert", (*place.at, last.get(family, -1)), item, j)
            where = _inside(place.words, item, words[j])
            yield Difference(_group(place, owner, item), where, "added", None, _text_of(item), "", edit)


def _family(owner: m.Item, item: m.Item) -> object:
    """Return a key shared by the statements whose order among each other has a meaning; None if a statement's order has
    none."""
    if isinstance(owner, _UNORDERED_BODIES):
        return None
    if isinstance(owner, m.Scenario | m.Clip):
        return order_counts(item)
    return "all"


def _orders(
    place: _PathInModel, owner: m.Item, a: Sequence[m.Item], b: Sequence[m.Item], pairs: dict[int, int]
) -> Iterator[Difference]:
    """Yield the changes of order that have a meaning."""
    families: dict[object, list[int]] = {}
    for i, j in pairs.items():
        families.setdefault(_family(owner, b[j]), []).append(i)
    for family, numbers in families.items():
        before = sorted(numbers)
        after = sorted(numbers, key=lambda i: pairs[i])
        if family is None or before == after:
            continue
        group = _group(place, owner, a[before[0]])
        was, now = (", ".join(_short(a[i]) for i in order) for order in (before, after))
        edit = Edit("order", place.at, tuple(after))
        yield Difference(group, w.join(place.words, "order"), "moved", was, now, "", edit)


def _short(item: m.Item) -> str:
    return w.name_of(item) or w.label(item) if w.is_statement(item) else w.text(item)


_T = TypeVar("_T", bound=m.Item)

_LIKE_ENOUGH = 0.5
"""Smallest share of common words at which two statements count as one changed statement (ours: below it more words are
new than old)."""


def match(a: Sequence[m.Item], b: Sequence[m.Item]) -> dict[int, int]:
    """Return the index in `b` of the partner of each element of `a`; elements without a partner are absent.

    Equal elements are paired first, then named statements by name, then the most similar ones of a kind. Statements
    without meaning have no partner.
    """
    pairs: dict[int, int] = {}
    for key_of in (lambda item: None if isinstance(item, m.FOR_PEOPLE) else content_key(item), _name_key):
        before = _places(map(key_of, a), pairs)
        after = _places(map(key_of, b), pairs.values())
        for key, places in before.items():
            pairs.update(zip(places, after.get(key, ()), strict=False))
    pairs.update(_alike(a, b, pairs))
    return pairs


def _means_nothing(item: m.Item) -> tuple[str, ...]:
    """Return the fields of an item that have no meaning, as `language.meaning` defines it."""
    if isinstance(item, m.When) and item.repeat in (None, "once"):  # `once` is the default of a trigger
        return ("name", "repeat")
    return ("name",) if isinstance(item, m.When | m.Expect) else ()


def _renames(a: _T, b: m.Item) -> tuple[_T, tuple[tuple[str, str], ...]]:
    """Return `a` with the new name of each statement that changed only its name, and the pairs of old and new names."""
    pairs: list[tuple[str, str]] = []
    while pair := _one_rename(a, b):
        a = renamed(a, *pair)
        pairs.append(pair)
    return a, tuple(pairs)


def _one_rename(a: m.Item, b: m.Item) -> tuple[str, str] | None:
    before, after = _named(a), _named(b)
    gone = [item for key, item in before.items() if key not in after]
    new = [item for key, item in after.items() if key not in before]
    used = {w.name_of(item) for item in after.values()}
    for item in gone:
        for other in (other for other in new if type(other) is type(item)):
            old_name, new_name = w.name_of(item) or "", w.name_of(other) or ""
            # `renamed` also renames statements of other kinds. If one of those keeps the old name in `new`, it is
            # renamed back, and the two renames alternate forever.
            if (
                old_name not in used
                and not same_value(item, other)
                and same_value(renamed(item, old_name, new_name), other)
            ):
                return old_name, new_name
    return None


def _named(definition: m.Item) -> dict[Hashable, m.Item]:
    body: Iterable[m.Item] = getattr(definition, "body", ())
    named = (item for item in body if w.name_of(item) is not None and not isinstance(item, m.Network))
    return {(type(item), w.name_of(item)): item for item in named}


def _name_key(item: m.Item) -> Hashable:
    if isinstance(item, m.Change):
        return ("change", item.actor, item.property)
    if isinstance(item, m.SignalState):
        return ("signal", content_key(item.junction))
    if isinstance(item, m.Network):
        return "network"
    held = getattr(item, "item", None)  # for `add STATEMENT`, the added statement counts
    key = _name_key(held) if isinstance(held, m.Item) else w.name_of(item)
    return None if key is None or isinstance(item, m.FOR_PEOPLE) else (type(item).__name__, key)


def _places(keys: Iterable[Hashable], taken: Iterable[int]) -> dict[Hashable, list[int]]:
    done = set(taken)
    places: dict[Hashable, list[int]] = defaultdict(list)
    for number, key in enumerate(keys):
        if key is not None and number not in done:
            places[key].append(number)
    return places


def _alike(a: Sequence[m.Item], b: Sequence[m.Item], pairs: dict[int, int]) -> dict[int, int]:
    """Return pairs of the remaining statements, the most similar ones of each kind first.

    If both blocks have exactly one statement of a kind, those two are a pair even if they are not similar.
    """
    before = _places(map(_slot, a), pairs)
    after = _places(map(_slot, b), pairs.values())
    partners: dict[int, int] = {}
    for slot, mine in before.items():
        theirs = after.get(slot, [])
        if len(mine) == len(theirs) == 1 and not _is_open(a[mine[0]]):
            partners[mine[0]] = theirs[0]
        elif theirs:
            partners.update(_best(a, b, mine, theirs))
    return partners


def _slot(item: m.Item) -> Hashable:
    """Return the key that two statements without a name must share to be paired; None for statements with a name,
    because those are paired by their names."""
    if isinstance(item, m.FOR_PEOPLE):
        return None
    if _is_open(item):
        return type(item).__name__
    return None if _name_key(item) is not None else w.keyword(item)


def _is_open(item: m.Item) -> bool:
    """Return whether statements of this kind are paired only by similarity: triggers, expectations and conditions."""
    fields = type(item).model_fields
    return is_condition(item) or any(is_condition(getattr(item, field)) for field in fields)


def _best(a: Sequence[m.Item], b: Sequence[m.Item], mine: list[int], theirs: list[int]) -> dict[int, int]:
    words_a = {i: _words(a[i]) for i in mine}
    words_b = {j: _words(b[j]) for j in theirs}
    scored = sorted(
        (-score, abs(i - j), i, j)
        for i in mine
        for j in theirs
        if (score := _likeness(words_a[i], words_b[j])) >= _LIKE_ENOUGH
    )
    partners: dict[int, int] = {}
    taken: set[int] = set()
    for _, _, i, j in scored:
        if i not in partners and j not in taken:
            partners[i] = j
            taken.add(j)
    return partners


def _words(item: m.Item) -> Counter[str]:
    printed = print_item(item) if w.is_statement(item) else w.text(item)
    return Counter(re.findall(r"[^\s(),]+", printed))


def _likeness(first: Counter[str], second: Counter[str]) -> float:
    """Return the share of words that two statements have in common (the Dice coefficient), 0 to 1."""
    return 2 * (first & second).total() / max(first.total() + second.total(), 1)
