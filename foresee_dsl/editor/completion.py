"""Completes a text at a place with words of the grammar, names that are defined there, units and files."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast, get_args

from foresee_dsl.editor.files import Definition, Files
from foresee_dsl.editor.probe import Before, CompletionSlot, accepted, before, slots
from foresee_dsl.editor.symbols import kind_named
from foresee_dsl.language import model as m
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.project.addresses import FOREIGN_NETWORKS, SUFFIX, TRACKS, relative_to
from foresee_dsl.language.syntax.expected import words_of_terminals
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.units import EXAMPLES, UNITS, Dimension, dimension_of

_MOST_FILES = 500
"""Maximum number of files offered. Ours: people do not read more, and the list is sent with every letter."""
_MOST_ENTRIES = 20_000
"""Maximum number of folder entries examined for files. Ours: about 50 ms."""


@dataclass(frozen=True)
class Suggestion:
    """A text that can replace the word that was begun.

    Attributes:
        kind: selects the icon beside it.
        detail: a few words that are shown beside it.
        about: a sentence and an example, or empty.
    """

    text: str
    kind: Literal["keyword", "constant", "unit", "value", "name", "file", "type"]
    detail: str = ""
    about: str = ""


@dataclass(frozen=True)
class Completion:
    """The suggestions, and the number of characters before the place that they replace."""

    suggestions: tuple[Suggestion, ...]
    replaces: int


def complete(files: Files, path: Path, text: str, offset: int) -> Completion:
    """Return the suggestions at an offset of a text."""
    place = before(text, offset)
    if place.in_comment:
        return Completion((), 0)
    terminals = accepted(place.text)
    if not terminals and place.word:
        # The beginning of a number's unit, or a whole unit: `speed 50 k`.
        return Completion((), len(place.word))
    suggestions: dict[str, Suggestion] = {}
    for slot in sorted(slots(place.text, terminals), key=_is_seldom):
        if place.in_string and slot.token != "STRING":
            continue
        for suggestion in _of_slot(files, path, slot, place):
            suggestions.setdefault(suggestion.text, suggestion)
    if not place.in_string:
        for word in words_of_terminals(terminals):
            suggestions.setdefault(word, _keyword(word))
    return Completion(tuple(suggestions.values()), len(place.word))


def _is_seldom(slot: CompletionSlot) -> bool:
    """Return whether a slot is for a parameter at the beginning of a condition on what happens, which most often begins
    with a measure."""
    above = slot.above[-1] if slot.above else None
    compared = slot.node.kind is m.Ref and above is not None and above.fields.get("left") is slot.node
    begins = compared or (slot.node.kind is m.Equals and slot.field == "left")
    return begins and all(node.kind is not m.Require for node in slot.above)


def _keyword(word: str) -> Suggestion:
    keyword = KEYWORDS.get(word)
    if keyword is None:
        return Suggestion(word, "keyword")
    return Suggestion(word, "keyword", keyword.meaning, f"{keyword.meaning}\n\n`{keyword.example}`")


def _of_slot(files: Files, path: Path, slot: CompletionSlot, place: Before) -> Iterator[Suggestion]:
    if slot.token == "UNIT":
        dimension = _dimension(files, path, slot)
        yield from (Suggestion(u.word, "unit") for u in UNITS.values() if dimension in (None, u.dimension))
    elif slot.token == "NUMBER":
        dimension = _dimension(files, path, slot)
        if dimension is not None and not place.word:
            yield Suggestion(EXAMPLES[dimension], "value", f"{dimension.replace('_', ' ')}")
    elif slot.node.kind is m.Ref:
        yield from _parameters(files, path, slot)
    else:
        yield from _names(files, path, slot, place)


def _names(files: Files, path: Path, slot: CompletionSlot, place: Before) -> Iterator[Suggestion]:
    kind = kind_named(slot.node, slot.field)
    if kind == "file":
        yield from _files(files, path, slot.node.kind, place.word)
    elif kind is not None and (slot.token != "STRING" or place.in_string):
        yield from _of_kind(files, path, slot, kind, place)
    if slot.token == "NAME":
        for word in form_of(slot.node.kind, slot.field).words:
            about = KEYWORDS.get(word)
            yield Suggestion(word, "constant", about.meaning if about is not None else "")
    if slot.token == "NAME" and form_of(slot.node.kind, slot.field).parameter:
        for name, definition in files.definitions(path, "parameter").items():
            if _fits(definition, slot, kind):
                yield Suggestion(name, "name", _describe(definition))


def _of_kind(files: Files, path: Path, slot: CompletionSlot, kind: SymbolKind, place: Before) -> Iterator[Suggestion]:
    if kind == "thing":
        kinds: tuple[SymbolKind, ...] = ("actor", "junction")
    elif kind == "word":
        kinds = _of_type(_type_of_word(files, path, slot))
    else:
        kinds = (kind,)
    if slot.node.kind is m.Change and (changes := _of_change(files, path, slot)) is not None:
        yield from changes
        return
    if slot.node.kind is m.Shows and "actor" in slot.node.fields:
        yield from (Suggestion(colour, "constant", KEYWORDS[colour].meaning) for colour in m.SIGNAL_COLOURS)
        return
    if "stage" in kinds:
        yield from (Suggestion(name, "name", "stage") for name in files.stages(path, slot.node.fields.get("junction")))
        return
    for name, definition in files.definitions(path, *kinds).items():
        without_signal = slot.node.kind is m.TurnsTo and not files.stages(path, name)
        if definition.occurrence.owner.kind is m.Traffic or without_signal:
            continue  # the name of a traffic alone does not name an actor
        if slot.token == "DOTTED" and kind == "actor":
            yield from (
                Suggestion(f"{name}.{what}", "name", _describe(definition)) for what in _properties(slot, place)
            )
            continue
        yield Suggestion(name, "name", _describe(definition))
        if kind == "road":
            yield Suggestion(f"{name}_back", "name", "the same road, the other way")
    if kind == "word":
        turns_or_sides: dict[str, tuple[type[m.Item], str]] = {"turn": (m.Leg, "turn"), "side": (m.ChangesLane, "side")}
        where = turns_or_sides.get(_type_of_word(files, path, slot))
        if where is not None:
            yield from (Suggestion(word, "constant") for word in form_of(*where).words)


def _of_type(type_: str) -> tuple[SymbolKind, ...]:
    kinds: dict[str, SymbolKind] = {"arm": "road", "model": "model", "junction": "junction", "stage": "stage"}
    return (kinds[type_],) if type_ in kinds else ()


def _type_of_word(files: Files, path: Path, slot: CompletionSlot) -> str:
    if slot.node.kind is m.Param:
        return str(slot.node.fields.get("type", ""))
    name = slot.node.fields.get("left" if "left" in slot.node.fields else "name")
    if isinstance(name, Node):
        name = name.fields.get("name")
    return files.type_of(path, str(name))


def _properties(slot: CompletionSlot, place: Before) -> tuple[str, ...]:
    """Return the words that can follow an actor's name and a dot."""
    if slot.node.kind is m.Measure:
        functions = words_of_terminals(
            accepted(place.text)
        )  # `time`, `ttc(...)`: measures without an actor before them
        return (*(word for word in form_of(m.Measure, "what").words if word not in functions), "signal")
    return ("signal",) if slot.node.kind is m.Shows else ("route",)


def _changeable(files: Files, path: Path) -> Iterator[Suggestion]:
    """Yield the properties that a `change` can name: of actors, weather, parameters, expectations and the end."""
    for name, definition in files.definitions(path, "actor").items():
        if definition.occurrence.owner.kind is not m.Traffic:
            is_ego = definition.occurrence.owner.kind is m.Ego
            properties = [what for what, rule in m.PROPERTIES.items() if rule.for_ego or not is_ego]
            yield from (Suggestion(f"{name}.{what}", "name", _describe(definition)) for what in properties)
    for word, kind in (("param", "parameter"), ("expect", "label")):
        definitions = files.definitions(path, cast(SymbolKind, kind)).items()
        yield from (Suggestion(f"{word}.{name}", "name", _describe(definition)) for name, definition in definitions)
    for name, owner in m.OWNERS.items():
        yield from (Suggestion(f"{name}.{what}", "name") for what in owner.properties)


def _of_change(files: Files, path: Path, slot: CompletionSlot) -> Iterator[Suggestion] | None:
    """Return what a `change` can name, or the words of the property that it changes; None if its values are models."""
    if slot.field == "actor":
        return _changeable(files, path)
    rule = m.PROPERTIES.get(str(slot.node.fields.get("property")))
    if slot.node.fields.get("actor") in m.OWNERS:
        return iter(())
    if rule is None or rule.statement is None:
        return None
    meanings = {word: KEYWORDS[word].meaning if word in KEYWORDS else "" for word in rule.words}
    return (Suggestion(word, "constant", meaning) for word, meaning in meanings.items())


def _fits(definition: Definition, slot: CompletionSlot, kind: SymbolKind | None) -> bool:
    type_ = definition.occurrence.owner.fields.get("type")
    if kind in ("road", "junction"):
        return type_ in ("arm", kind)
    wanted = {"turn": "turn", "model": "model", "side": "side", "stage": "stage"}.get(slot.field, kind)
    return type_ == wanted


def _parameters(files: Files, path: Path, slot: CompletionSlot) -> Iterator[Suggestion]:
    """Yield the parameters that can stand for a value or for a model."""
    above = slot.above[-1] if slot.above else slot.node
    dimension = _dimension(files, path, slot)
    model = "model" in above.fields
    assignment = next((node for node in slot.above if node.kind is m.Assignment), None)
    if any(node.kind is m.Mutant for node in slot.above):
        return  # a clip has no parameters
    if assignment is not None and dimension_of(files.type_of(path, str(assignment.fields.get("name")))) is None:
        return  # a word
    for name, definition in files.definitions(path, "parameter").items():
        type_ = definition.occurrence.owner.fields.get("type")
        free = dimension is None and not model and (above.kind not in _CALCULATIONS or dimension_of(type_) is not None)
        if type_ == ("model" if model else dimension) or free:
            yield Suggestion(name, "name", _describe(definition))


def _dimension(files: Files, path: Path, slot: CompletionSlot) -> Dimension | None:
    """Return the dimension of a value at the slot; None if it may have any."""
    inner, outer = slot.node, list(slot.above)
    # Operands of a sum have the dimension of the whole.
    while outer and outer[-1].kind in (m.Sum, m.Extreme, m.Negative):
        inner = outer.pop()
    above = outer[-1] if outer else inner
    field = next((f for f, v in above.fields.items() if v is inner or (isinstance(v, tuple) and inner in v)), "")
    if above.kind is m.Comparison:
        left = above.fields.get("left")
        if not isinstance(left, Node) or field != "right":
            return None
        if left.kind is m.Ref:
            return dimension_of(files.type_of(path, str(left.fields.get("name"))))
        return m.MEASURED.get(str(left.fields.get("what")))
    if above.kind in (m.Param, m.Range, m.Assignment):
        owner = above if above.kind is not m.Range else outer[-2]
        return dimension_of(owner.fields.get("type") or files.type_of(path, str(owner.fields.get("name"))))
    if above.kind is m.Change:
        owner_, property_ = (str(above.fields.get(name)) for name in ("actor", "property"))
        changed = m.OWNERS.get(owner_) or m.PROPERTIES.get(property_)
        return changed.dimension if changed is not None else None
    return form_of(above.kind, field).dimension


_CALCULATIONS = get_args(m.Expression)


def _describe(definition: Definition) -> str:
    node = definition.occurrence.owner
    if node.kind is m.Param:
        return f"parameter, {node.fields.get('type', '')}"
    kind = "model" if node.kind is m.VehicleModel else node.kind.__name__.lower()
    return str(node.fields.get("kind", "")) or kind


_SUFFIXES: Mapping[type[m.Item], tuple[str, ...]] = {m.UseNetwork: (SUFFIX, *FOREIGN_NETWORKS), m.UseTracks: (TRACKS,)}
"""How the names of files end that a statement may name; any other statement names files of the language."""
_HOLDS: Mapping[type[m.Item], tuple[str, ...]] = {
    m.UseNetwork: ("network",),
    m.UseModels: ("models",),
    m.Extension: ("scenario",),
    m.Clip: ("scenario", "clip", "mutant"),
    m.Mutant: ("clip", "mutant"),
    m.Seeds: ("scenario",),
}
"""The kinds of files of the language that a statement may name; any other statement may name all."""


def _files(files: Files, path: Path, kind: type[m.Item], begun: str) -> Iterator[Suggestion]:
    """Yield the files that a statement of a file may name and that were begun (by path or by name): first those in its
    folder and below, then those of the project beside and above."""
    suffixes, holds = _SUFFIXES.get(kind, (SUFFIX,)), _HOLDS.get(kind, ())
    begun, count = begun.removeprefix("./"), 0
    for full in _near_files(path.parent, files.project(path)):
        if full == path or not full.name.endswith(suffixes):
            continue
        name = relative_to(path.parent, full)
        if not name.startswith(begun) and not full.name.startswith(begun):
            continue
        if holds and full.name.endswith(SUFFIX) and files.kind(full) not in holds:
            continue
        yield Suggestion(name, "file")
        count += 1
        if count == _MOST_FILES:
            return


def _near_files(start: Path, project: Path) -> Iterator[Path]:
    """Yield files of a project, those of a folder and of the folders below it before those of the folder above it."""
    looked_at = 0
    walked: Path | None = None
    for above in (start, *start.parents):
        for folder, below, here in os.walk(above):
            below[:] = sorted(name for name in below if not name.startswith(".") and Path(folder) / name != walked)
            looked_at += len(here)
            yield from (Path(folder) / name for name in sorted(here))
            if looked_at >= _MOST_ENTRIES:
                return
        if above == project:
            return
        walked = above
