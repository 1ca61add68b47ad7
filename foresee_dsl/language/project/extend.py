"""Joins an extension with the scenario that it extends: applies its additions, changes and drops, and recalculates the
parameters whose defaults have changed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from foresee_dsl.errors import Diagnostic, Span, with_article
from foresee_dsl.files import absolute
from foresee_dsl.helps import HelpText, instead, write
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import needed_by
from foresee_dsl.language.document import Document
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project.addresses import relative_to
from foresee_dsl.language.project.changes import changed_body, weakened
from foresee_dsl.language.traversal import changed_fields, walk

_ItemT = TypeVar("_ItemT", bound=m.Item)
_SINGLE = ("ego", "network", "use_tracks", "weather", "end")
"""Groups of statements of which a scenario has at most one."""
_PLACES = 3
"""Maximum number of places in one message (ours: the others show up once these are fixed)."""


def extended(document: Document, parent: Document, *, folder: Path, parent_folder: Path) -> Document:
    """Return a scenario joined with the one that it extends; the latter may be an extension that was joined itself.

    The extension's lines are applied in their order. The remaining statements of the extended scenario keep their
    order, and added statements come after them. Words in the extension that are not parameters of the result become
    plain names. Paths in the result are relative to `folder`, the extension's.

    Returns:
        A document whose model is a `Scenario`, with the path of the extension's file. Errors in the extended scenario's
        statements are placed at `extends`. Its `written` is the extension.
    """
    return _Joiner(document, parent, folder, parent_folder).joined()


def softened(document: Document) -> Iterator[Diagnostic]:
    """Yield a warning for each expectation that an extension makes easier to meet than in the extended scenario."""
    if not isinstance(document.written, m.Extension) or document.base is None:
        return
    assert isinstance(document.model, m.Scenario) and isinstance(document.base.model, m.Scenario)  # noqa: S101  (extended)
    new = {item.name: item for item in document.model.all(m.Expect)}
    for old in document.base.model.all(m.Expect):
        now = new.get(old.name)
        if old.name is not None and now is not None and weakened((old,), (now,)) is not None:
            message = f"'{old.name}' is easier to meet here than in '{document.written.parent}'"
            help = "leave the expectation as it is, make it stricter, or explain in a comment why it may be easier"
            # an error in a mutant, but here it may be intended
            yield replace(document.diagnostic(now, "", "FS311", message, help), severity="warning")


class _Joiner:
    """Applies the lines of an extension, and records the place of every new item."""

    def __init__(self, document: Document, parent: Document, folder: Path, parent_folder: Path) -> None:
        extension, scenario = document.model, parent.model
        if not isinstance(extension, m.Extension) or not isinstance(scenario, m.Scenario):
            raise TypeError("only an extension and a scenario can be joined")
        self._document, self._extension, self._parent = document, extension, parent
        self._spans = dict(document.spans)
        self._base_spans = dict(parent.spans)
        self._alive: list[m.Item] = [extension]
        self._collector = Collector(document)
        self._tags = extension.all(m.Tags) or scenario.all(m.Tags)
        self._docs = extension.all(m.Doc)
        self._expected = extension.all(m.Expected)
        self._body: tuple[m.ScenarioItem, ...] = tuple(
            self._moved(item, folder, parent_folder)
            for item in scenario.body
            if not isinstance(item, m.Doc | m.Tags | m.Expected)
        )
        self._parameters = _parameters(scenario, extension)

    def joined(self) -> Document:
        for line in self._extension.body:
            match line:
                case m.Add(item=item):
                    self._add(self._plain(item), line)
                case m.Replace(item=item):
                    self._replace(self._plain(item), line)
                case m.Drop():
                    self._drop(line)
                case m.Change():
                    self._change(line)
        self._check_dropped()
        self._collector.raise_if_any()
        self._settle_again()
        model = m.Scenario(name=self._extension.name, body=(*self._docs, *self._tags, *self._expected, *self._body))
        self._place(self._spans, model, self._extension)
        base = replace(self._parent, spans=self._base_spans)
        calculates = self._document.calculates or self._parent.calculates
        joined = replace(self._document, model=model, spans=self._spans, base=base, calculates=calculates)
        return replace(joined, written=self._extension, alive=tuple(self._alive))

    def _settle_again(self) -> None:
        if not (self._document.calculates or self._parent.calculates):
            return

        try:
            self._body = _settled_again(self._extension.name, self._body, self._moved_to)
        except ExpressionError as error:
            item = error.item if not isinstance(error.item, m.Assignment) else self._extension
            self._collector.add(item, "name", "FS063", error.message, "write another value")
            self._collector.raise_if_any()

    def _moved_to(self, was: m.Item, now: m.Item) -> None:
        """Record the places of `was` for `now`, the item that replaces it."""
        for spans in (self._spans, self._base_spans):
            spans |= {(id(now), field): span for (key, field), span in [*spans.items()] if key == id(was)}
        self._alive.append(was)

    # ---- the four kinds of line ------------------------------------------------------------------------------------

    def _add(self, item: m.Statement, line: m.Add) -> None:
        existing = self._like(item)
        if existing is not None:
            called = _called(item)
            message = f"'{self._extension.parent}' already has {with_article(called)}"
            span = self._parent.span(existing)
            place = f" (line {span.line} of '{self._parent.path}')" if span is not None else ""
            help = "write " + instead("change", "add") + f" to replace it{place}"
            self._collector.add(line.item, _named_by(item), "FS127", message, help)
            return
        self._body = (*self._body, item)

    def _replace(self, item: m.Statement, line: m.Replace) -> None:
        if isinstance(item, m.Require) or (isinstance(item, m.When | m.Expect) and item.name is None):
            word = "require" if isinstance(item, m.Require) else item.kind
            message = f"this `{word}` has no name, so it is not clear which one it changes"
            help: HelpText = f"give it a name here and in the other scenario, `{word} some_name: ...`"
            if isinstance(item, m.Require):
                help = "a " + write("require") + " can only be added; to loosen one, change it in the other scenario"
            self._collector.add(line.item, "", "FS126", message, help)
            return
        existing = self._like(item)
        if existing is None:
            group, name = _identity(item)
            names = [n for g, n in map(_identity, self._body) if g == group and n]
            message = f"'{self._extension.parent}' has no {_called(item)}"
            hint = did_you_mean(name, names) if name else ""
            help = hint or "write " + instead("add", "change") + f": there is no {_word(item)} to change"
            self._collector.add(line.item, _named_by(item), "FS126", message, help)
            return
        self._body = tuple(item if old is existing else old for old in self._body)

    def _drop(self, line: m.Drop) -> None:
        gone = [item for item in self._body if _word(item) == line.what and line.name in (None, _identity(item)[1])]
        names = [name for item in self._body if _word(item) == line.what and (name := _identity(item)[1])]
        single = line.what in (*_SINGLE, "cases")
        if line.name is None and not single:
            help: HelpText = "write the name behind it: " + write(
                f"drop {line.what} {names[0] if names else 'some_name'}"
            )
            self._collector.add(line, "", "FS126", f"this does not name the {line.what} to drop", help)
        elif line.name is not None and single:
            help = "write " + write(f"drop {line.what}")
            self._collector.add(line, "name", "FS126", f"`drop {line.what}` takes no name", help)
        elif not gone:
            other = next((item for item in self._body if isinstance(item, m.Actor) and item.name == line.name), None)
            message = f"'{self._extension.parent}' has no {line.what}" + (f" called '{line.name}'" if line.name else "")
            help = did_you_mean(line.name, names) if line.name else ""
            if line.name == "ego":
                help = "every scenario has an ego: replace it with " + write("change ego: car.sedan { ... }")
            elif other is not None:
                help = f"it is {with_article(other.kind)}: write " + write(f"drop {other.kind} {other.name}")
            self._collector.add(line, "name" if line.name else "", "FS126", message, help)
        else:
            self._body = tuple(item for item in self._body if not any(item is old for old in gone))

    def _check_dropped(self) -> None:
        """Report parameters that were dropped, but are still used."""
        bodies = (self._parent.model.body, self._body)
        before, after = ({item.name for item in body if isinstance(item, m.Param)} for body in bodies)
        for line in self._extension.all(m.Drop):
            places = self._uses(line.name) if line.what == "param" and line.name in before - after else []
            if places:
                more = f" and {len(places) - _PLACES} more" if len(places) > _PLACES else ""
                message = f"'{line.name}' is dropped, but still used in {', '.join(places[:_PLACES])}{more}"
                help = "change or drop what uses it, or leave the parameter"
                self._collector.add(line, "name", "FS031", message, help)

    def _uses(self, name: str | None) -> list[str]:
        """Return the lines that use a parameter or give it a value."""
        types: dict[str, m.ParamType] = {
            item.name: item.type for item in (*self._parent.model.body, *self._body) if isinstance(item, m.Param)
        }
        places: dict[str, None] = {}
        for part in (part for item in self._body for part in walk(item)):
            used = isinstance(part, m.Ref) and part.name == name
            if isinstance(part, m.Assignment):
                used = part.name == name or any(ref.name == name for ref in needed_by(part, types))
            if used:
                places[self._line_of(part)] = None
        return list(places)

    def _line_of(self, item: m.Item) -> str:
        if (own := self._spans.get((id(item), ""))) is not None:
            return f"line {own.line}"
        span = self._base_spans.get((id(item), "")) or self._parent.span(item)
        return f"line {span.line} of '{self._parent.path}'" if span is not None else f"'{self._parent.path}'"

    def _change(self, line: m.Change) -> None:
        place = f"'{self._extension.parent}'"
        before = self._body
        self._body = changed_body(line, before, self._collector, place=place, parameters=self._parameters)
        for item in self._body:
            if not any(item is old for old in before):
                self._place(self._spans, item, line, whole=True)
                if not isinstance(item, m.Ego | m.Actor):
                    continue
                # Items that the line puts into an actor's block get the place of the line; the others keep theirs.
                old = next((o for o in before if isinstance(o, m.Ego | m.Actor) and o.name == item.name), None)
                was = (*old.body, old.state) if old is not None else ()
                for part in (*item.body, item.state):
                    if part is not None and not any(part is other for other in was):
                        self._place(self._spans, part, line, whole=True)

    # ---- finding ---------------------------------------------------------------------------------------------------

    def _like(self, item: m.ScenarioItem) -> m.ScenarioItem | None:
        """Return the statement of the same kind and name, or None."""
        group, name = _identity(item)
        same = [old for old in self._body if _identity(old)[0] == group]
        if group in _SINGLE:
            return same[0] if same else None
        return next((old for old in same if name and _identity(old)[1] == name), None)

    # ---- rebuilt items, and their places ---------------------------------------------------------------------------

    def _moved(self, item: m.ScenarioItem, folder: Path, parent_folder: Path) -> m.ScenarioItem:
        """Return a statement of the extended scenario; a path in it becomes relative to this file's folder."""
        if not isinstance(item, m.UseNetwork | m.UseModels | m.UseTracks) or folder == parent_folder:
            return item
        path = relative_to(folder, absolute(parent_folder / item.path))
        new = item.model_copy(update={"path": path})
        self._place(self._base_spans, new, item)
        return new

    def _plain(self, item: _ItemT) -> _ItemT:
        """Return an item in which words that are not parameters are plain names, wherever its class allows a name."""
        new = _accepted(item, changed_fields(item, self._plain_part))
        if new is not item:
            self._place(self._spans, new, item)
        return new

    def _plain_part(self, _: str, part: object) -> object:
        if isinstance(part, m.Ref):
            return part if part.name in self._parameters else part.name
        return self._plain(part) if isinstance(part, m.Item) else part

    def _place(self, spans: dict[tuple[int, str], Span], new: m.Item, old: m.Item, *, whole: bool = False) -> None:
        """Record the places of an old item for a new one; with `whole`, every field gets the place of the whole old
        item."""
        self._alive += (new, old)
        fields = [""]
        for name in () if whole else type(new).model_fields:
            value = getattr(new, name)
            fields += [name, *(f"{name}.{k}" for k in range(len(value) if isinstance(value, tuple) else 0))]
        spans |= {(id(new), f): span for f in fields if (span := spans.get((id(old), f))) is not None}


def _accepted(item: _ItemT, changed: dict[str, object]) -> _ItemT:
    """Return the item with the changes that its class allows: a word stays a reference if its field does not allow a
    name."""
    if not changed:
        return item
    try:
        return type(item).model_validate(vars(item) | changed)
    except ValidationError as error:
        refused = {str(detail["loc"][0]) for detail in error.errors() if detail["loc"]} & changed.keys()
        accepted = {name: value for name, value in changed.items() if name not in refused}
        return _accepted(item, accepted) if refused else item


def _parameters(scenario: m.Scenario, extension: m.Extension) -> frozenset[str]:
    """Return the names of the result's parameters."""
    names = {param.name for param in scenario.all(m.Param)}
    for line in extension.body:
        if isinstance(line, m.Add | m.Replace) and isinstance(line.item, m.Param):
            names.add(line.item.name)
        elif isinstance(line, m.Drop) and line.what == "param" and line.name is not None:
            names.discard(line.name)
    return frozenset(names)


def _identity(item: m.Item) -> tuple[str, str]:
    """Return the identity of a statement in its scenario: its group, and its name ("" if it has none)."""
    group, name = str(getattr(item, "kind", "")), getattr(item, "name", None) or ""
    match item:
        case m.Ego():
            name = ""
        case m.Actor():
            group = "actor"
        case m.UseNetwork() | m.Network():
            group, name = "network", ""
        case m.UseModels(path=path):
            name = path
        case m.SignalState(junction=junction):
            name = junction.name if isinstance(junction, m.Ref) else junction
        case m.Cases(seed=seed):
            name = f"seed {seed.value:f}"
    return group, str(name)


def _word(item: m.Item) -> str:
    """Return the keyword of a statement."""
    return item.kind if isinstance(item, m.Actor) else _identity(item)[0]


def _called(item: m.Item) -> str:
    group, name = _identity(item)
    if not name:
        return _word(item)
    if isinstance(item, m.Cases):
        return f"cases from {name}"
    return f"actor called '{name}'" if group == "actor" else f"{_word(item)} called '{name}'"


def _named_by(item: m.Item) -> str:
    """Return the field with a statement's name, which a diagnostic underlines; "" for the whole statement."""
    return "name" if getattr(item, "name", None) and not isinstance(item, m.Ego) else ""


_T = TypeVar("_T", bound=m.Item)
_Moved = Callable[[m.Item, m.Item], None]
"""A function that is called for every replaced item with (old item, new item)."""


def _settled_again(name: str, body: Sequence[m.ScenarioItem], moved: _Moved) -> tuple[m.ScenarioItem, ...]:
    """Return the statements of a scenario, with the values of its parameters recalculated; the same statements if none
    are calculated.

    Raises:
        ExpressionError: a calculation has no result with these defaults.
    """
    from foresee_dsl.language.arithmetic.cases import case_values, references

    params = (item for item in body if isinstance(item, m.Param))
    if not any(isinstance(part, m.Calculated) and any(references(part)) for item in params for part in walk(item)):
        return tuple(body)
    whole = m.Scenario(name=name, body=tuple(body))
    values = case_values(whole, m.Case(name="defaults", values=()))
    return tuple(_settled(item, values, moved) if isinstance(item, m.Param) else item for item in body)


def _settled(item: _T, values: Mapping[str, m.ParamValue], moved: _Moved) -> _T:
    def settled_part(_: str, part: object) -> object:
        return _settled(part, values, moved) if isinstance(part, m.Item) else part

    if isinstance(item, m.Calculated):
        from foresee_dsl.language.arithmetic.evaluate import evaluate

        result = evaluate(item.expression, values)
        new: dict[str, object] = {"value": result.value, "unit": result.unit}
    else:
        new = changed_fields(item, settled_part)
    if not new:
        return item
    settled = item.model_copy(update=new)
    moved(item, settled)
    return settled
