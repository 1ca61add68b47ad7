"""Pairs the statements of two blocks by equality, name or similarity, and finds renamed statements."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Sequence
from typing import TypeVar

from foresee_dsl.language import model as m
from foresee_dsl.language.diff.parts import renamed
from foresee_dsl.language.diff.wording import NO_MEANING, is_statement, keyword, name_of, text
from foresee_dsl.language.meaning import content_key, same_value
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.traversal import is_condition

_T = TypeVar("_T", bound=m.Item)

LIKE_ENOUGH = 0.5
"""Smallest share of common words at which two statements count as one changed statement (ours: below it more words are
new than old)."""


def match(a: Sequence[m.Item], b: Sequence[m.Item]) -> dict[int, int]:
    """Return the index in `b` of the partner of each element of `a`; elements without a partner are absent.

    Equal elements are paired first, then named statements by name, then the most similar ones of a kind. Statements
    without meaning have no partner.
    """
    pairs: dict[int, int] = {}
    for key_of in (lambda item: None if isinstance(item, NO_MEANING) else content_key(item), _name_key):
        before = _places(map(key_of, a), pairs)
        after = _places(map(key_of, b), pairs.values())
        for key, places in before.items():
            pairs.update(zip(places, after.get(key, ()), strict=False))
    pairs.update(_alike(a, b, pairs))
    return pairs


def means_nothing(item: m.Item) -> tuple[str, ...]:
    """Return the fields of an item that have no meaning, as `language.meaning` defines it."""
    if isinstance(item, m.When) and item.repeat in (None, "once"):  # `once` is the default of a trigger
        return ("name", "repeat")
    return ("name",) if isinstance(item, m.When | m.Expect) else ()


def renames(a: _T, b: m.Item) -> tuple[_T, tuple[tuple[str, str], ...]]:
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
    used = {name_of(item) for item in after.values()}
    for item in gone:
        for other in (other for other in new if type(other) is type(item)):
            old_name, new_name = name_of(item) or "", name_of(other) or ""
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
    named = (item for item in body if name_of(item) is not None and not isinstance(item, m.Network))
    return {(type(item), name_of(item)): item for item in named}


def _name_key(item: m.Item) -> Hashable:
    if isinstance(item, m.Change):
        return ("change", item.actor, item.property)
    if isinstance(item, m.SignalState):
        return ("signal", content_key(item.junction))
    if isinstance(item, m.Network):
        return "network"
    held = getattr(item, "item", None)  # for `add STATEMENT`, the added statement counts
    key = _name_key(held) if isinstance(held, m.Item) else name_of(item)
    return None if key is None or isinstance(item, NO_MEANING) else (type(item).__name__, key)


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
    if isinstance(item, NO_MEANING):
        return None
    if _is_open(item):
        return type(item).__name__
    return None if _name_key(item) is not None else keyword(item)


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
        if (score := _likeness(words_a[i], words_b[j])) >= LIKE_ENOUGH
    )
    partners: dict[int, int] = {}
    taken: set[int] = set()
    for _, _, i, j in scored:
        if i not in partners and j not in taken:
            partners[i] = j
            taken.add(j)
    return partners


def _words(item: m.Item) -> Counter[str]:
    printed = print_item(item) if is_statement(item) else text(item)
    return Counter(re.findall(r"[^\s(),]+", printed))


def _likeness(first: Counter[str], second: Counter[str]) -> float:
    """Return the share of words that two statements have in common (the Dice coefficient), 0 to 1."""
    return 2 * (first & second).total() / max(first.total() + second.total(), 1)
