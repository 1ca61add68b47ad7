"""Prints a model as text, by the patterns of its classes. The printer is the formatter: one canonical layout, with
comments.

The layout depends only on the structure, never on the length of a value: a change of one value is one changed line.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from foresee_dsl.language import model as m
from foresee_dsl.language.document import END, HEADER, Comments, Key
from foresee_dsl.language.model.pattern import Form, Parts, Slot, form_of, read_pattern, slots_of
from foresee_dsl.language.model.values import NAME_PATTERN

_NAME = re.compile(NAME_PATTERN)
_DOTTED = re.compile(rf"{NAME_PATTERN}\.{NAME_PATTERN}")
_NO_NAMES: frozenset[str] = frozenset()
INDENT = "  "
_MOST_INLINE = 4
"""Maximum number of settings of a road or a case on one line (ours; a number, not a width, so that an edit of a value
never changes the line breaks)."""
_FILES = (m.UseNetwork, m.UseModels, m.UseTracks)
_TOGETHER = ((m.Doc, m.Tags), _FILES, (m.Ego, m.Goal), (m.Expect, m.End), (m.Window, m.Risk))
"""Statements that stand together, without a blank line between them, in files that the tool writes; other statements
stand together if they have the same class."""
_GROUPS: dict[type, type] = {kind: kinds[0] for kinds in _TOGETHER for kind in kinds}


def print_model(model: m.Definition, comments: Mapping[Key, Comments] | None = None) -> str:
    """Return a definition as the text of its file.

    With `comments` (as in `Document.comments`), blank lines stand where the author put them, at most one at a place;
    without `comments`, one blank line separates groups of statements.
    """
    return _Writer(model, comments).file(model)


def remarked(model: m.Definition, remarks: Mapping[int, Sequence[str]]) -> Mapping[Key, Comments]:
    """Return the comments for `print_model` that put `remarks` before statements, by the statement's index in the
    definition's body.

    Blank lines stand where the tool puts them in files that it writes.
    """
    comments: dict[Key, Comments] = {}
    previous: m.Item | str | None = None
    for place, (key, item) in enumerate(layout(model, _NO_NAMES).inside or ()):
        blank = previous is not None and (_group(previous) != _group(item) or place in remarks)
        comments[key] = Comments(before=tuple(remarks.get(place, ())), blank_before=blank)
        previous = item
    return comments


def print_item(item: m.Item) -> str:
    """Return one statement (with its block) as text, for messages and diffs."""
    writer = _Writer(item, {})  # no comments and no blank lines
    writer.statement(item, (), 0)
    return "\n".join(writer.lines)


class _Writer:
    def __init__(self, model: m.Item, comments: Mapping[Key, Comments] | None) -> None:
        self.lines: list[str] = []
        self._comments = comments
        body = model.body if isinstance(model, m.Scenario) else ()
        named = frozenset(item.name for item in body if isinstance(item, m.Param))
        self._parameters = m.ANY_NAME if isinstance(model, m.Extension) else named

    def file(self, model: m.Definition) -> str:
        around = self._around(HEADER)
        self._remarks(around.before, 0)
        self._add("foresee 1", 0, around.after)
        self.lines.append("")
        self.statement(model, (), 0)
        after = self._around(END)
        if after.before:
            self.lines.append("")
            self._remarks(after.before, 0)
        while self.lines and not self.lines[-1]:
            self.lines.pop()
        return "\n".join(self.lines) + "\n"

    def statement(self, item: m.Item | str, key: Key, depth: int) -> None:
        """Write a statement with its comments."""
        around = self._around(key)
        self._remarks(around.before, depth)
        shape = Layout(item) if isinstance(item, str) else layout(item, self._parameters)
        if key and isinstance(item, m.Network) and item.name == "here":
            shape = Layout("network", shape.inside)
        # The comment needs a line of its own before the closing brace.
        at_brace = around.at_end or around.after_end is not None
        if shape.inside is None and not at_brace:
            self._add(shape.head, depth, around.after)
        elif not shape.inside and not at_brace:
            self._add(f"{shape.head} {{}}", depth, around.after)
        elif shape.inline and not self._remarked(key, shape, around):
            texts = [
                layout(inner, self._parameters).head if isinstance(inner, m.Item) else inner
                for _, inner in shape.inside or ()
            ]
            self._add(f"{shape.head} {{ {'; '.join(texts)} }}", depth, around.after)
        else:
            self._block(shape, key, depth, around)

    def _block(self, shape: Layout, key: Key, depth: int, around: Comments) -> None:
        self._add(f"{shape.head} {{", depth, around.after)
        previous: m.Item | str | None = None
        for inner_key, inner in shape.inside or ():
            path = (*key, *inner_key)
            if previous is not None and self._blank_before(path, previous, inner, depth):
                self.lines.append("")
            self.statement(inner, path, depth + 1)
            previous = inner
        self._remarks(around.at_end, depth + 1)
        self._add("}", depth, around.after_end)

    def _blank_before(self, key: Key, previous: m.Item | str, item: m.Item | str, depth: int) -> bool:
        if self._comments is not None:
            return self._around(key).blank_before
        return depth == 0 and _group(previous) != _group(item)

    def _remarked(self, key: Key, shape: Layout, around: Comments) -> bool:
        """Return whether a comment inside the statement forbids printing it on one line."""
        inner = [self._around((*key, *inner_key)) for inner_key, _ in shape.inside or ()]
        texts = [text for c in inner for text in (*c.before, c.after) if text]
        return bool(texts or around.at_end or around.after_end)

    def _around(self, key: Key) -> Comments:
        return (self._comments or {}).get(key, Comments())

    def _remarks(self, texts: tuple[str, ...], depth: int) -> None:
        for text in texts:
            self.lines.append(f"{INDENT * depth}# {text}".rstrip() if text else "")

    def _add(self, text: str, depth: int, after: str | None) -> None:
        remark = f"  # {after}".rstrip() if after is not None else ""
        self.lines.append(f"{INDENT * depth}{text}{remark}")


def _group(item: m.Item | str) -> type:
    return _GROUPS.get(type(item), type(item))


# ---- one statement, or a part of one --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Layout:
    """A statement to print: its head, and the statements in its braces.

    `inside` is None for a statement without braces. Otherwise it holds the key of each inner statement in the model's
    path, and the item or (for a setting) its text. `inline` is True if it is printed on one line when nothing in it has
    a comment.
    """

    head: str
    inside: Sequence[tuple[Key, m.Item | str]] | None = None
    inline: bool = False


def layout(item: m.Item, parameters: frozenset[str] = _NO_NAMES) -> Layout:
    """Return the layout of a statement; an id with the name of a parameter is quoted."""
    if isinstance(item, m.Add | m.Replace):
        return _held("add" if isinstance(item, m.Add) else "change", item.item, parameters)
    pattern = read_pattern(item.own_pattern())
    inside: list[tuple[Key, m.Item | str]] = []
    for parts in pattern.settings:
        (slot,) = slots_of(parts)
        if _is_given(item, slot.field):
            inside.append(((slot.field,), _phrase(parts, item, parameters)))
    inside += [((pattern.body, k), inner) for k, inner in enumerate(getattr(item, pattern.body, ()))]
    braces = pattern.braces == "always" or (pattern.braces == "filled" and bool(inside))
    head = _phrase(pattern.head, item, parameters)
    spread = item.one_line_without is None or any(getattr(item, field) for field in item.one_line_without)
    return Layout(head, inside if braces else None, inline=not spread and len(inside) <= _MOST_INLINE)


def _held(word: str, item: m.Item, parameters: frozenset[str]) -> Layout:
    """Return the layout of a statement after a word such as `add`."""
    shape = layout(item, parameters)
    head = "network" if isinstance(item, m.Network) and item.name == "here" else shape.head
    inside = None if shape.inside is None else [(("item", *key), inner) for key, inner in shape.inside]
    return Layout(f"{word} {head}", inside, shape.inline)


def written(item: m.Item, parameters: frozenset[str] = _NO_NAMES) -> str:
    """Return a part of a statement as text: `50 km/h`, `20 m along ego.route`, `time > 5 s and not arrived(ego)`.

    Digits are the author's, and a condition has no more brackets than it needs. For a statement, the text is the part
    before its braces. An id with the name of a parameter is quoted.
    """
    if isinstance(item, m.Quantity) and not isinstance(item, m.Calculated):
        return f"{item.value:f} {item.unit}" if item.unit else f"{item.value:f}"
    return _phrase(read_pattern(item.own_pattern()).head, item, parameters)


def identifier(text: str, parameters: frozenset[str] = _NO_NAMES) -> str:
    """Return a name, in quotes if it is not a valid name or is also the name of a parameter."""
    return text if _NAME.fullmatch(text) and text not in parameters else f'"{text}"'


def word(value: m.ParamValue | m.Expression) -> str:
    """Return a parameter's value: a quantity, a name, a model or a string."""
    if isinstance(value, m.Item):
        return written(value)
    return value if _DOTTED.fullmatch(value) else identifier(value)


def value_text(value: m.ParamValue | m.Ref | m.Expression) -> str:
    """Return a parameter's value as a message shows it: a name or a string without quotes."""
    return written(value) if isinstance(value, m.Item) else value


def quotable(text: str, longest: int | None = None) -> str:
    """Return a text on one line without double quotes, which can be quoted in a file; cut to `longest` characters."""
    return " ".join(text.split()).replace('"', "'")[:longest]


def listing(texts: Iterable[str]) -> str:
    """Return `[a, b]`."""
    return f"[{', '.join(texts)}]"


def _phrase(parts: Parts, item: m.Item, parameters: frozenset[str]) -> str:
    text = ""
    for part in parts:
        if isinstance(part, str):
            text += part
        elif isinstance(part, Slot):
            text += _field(item, part, parameters)
        elif all(_is_given(item, field) and getattr(item, field) != () for field in part.fields):
            text += _phrase(part.parts, item, parameters)
    return text


def _is_given(item: m.Item, field: str) -> bool:
    """Return whether an optional field is printed: if it differs from its default, or the author wrote it."""
    value = getattr(item, field)
    if value is None:
        return False
    return value != type(item).model_fields[field].default or (value != () and field in item.model_fields_set)


def _field(item: m.Item, slot: Slot, parameters: frozenset[str]) -> str:
    value = getattr(item, slot.field)
    if not isinstance(value, tuple):
        return _text(value, item, slot.field, parameters)
    texts = [_text(part, item, slot.field, parameters) for part in value]
    return listing(texts) if slot.between is None else slot.between.join(texts)


def _text(value: m.Item | str, item: m.Item, field: str, parameters: frozenset[str]) -> str:
    if isinstance(value, m.Item):
        text = written(value, parameters)
        brackets = (*item.in_brackets, *dict(item.in_brackets_of).get(field, ()))
        signed = "negative" in brackets and text.startswith("-")
        return f"({text})" if signed or getattr(value, "kind", None) in brackets else text
    form = form_of(type(item), field)
    match form.form:
        case Form.NAME | Form.MODEL:
            return value
        case Form.ID:
            if value in item.never_bare:
                return f'"{value}"'
            return identifier(value, parameters if form.parameter else _NO_NAMES)
        case Form.WORD:
            return word(value)
        case Form.TEXT:
            return f'"{value}"'
