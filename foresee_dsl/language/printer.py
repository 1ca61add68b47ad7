"""Model to text. The printer is the formatter: one canonical layout, with the author's comments and grouping.

Layout depends on the structure only, never on how long a value is: a change of one value is one changed line.
"""

from __future__ import annotations

from collections.abc import Mapping

from foresee_dsl.language import model as m
from foresee_dsl.language.printing.written import Layout, layout
from foresee_dsl.language.project.document import Comments
from foresee_dsl.language.syntax.comments import END, HEADER
from foresee_dsl.language.syntax.nodes import ANY_NAME, Key

_INDENT = "  "
_NONE = Comments()

_GROUPS: dict[type[m.Item], str] = {
    m.Doc: "about",
    m.Tags: "about",
    m.UseNetwork: "use",
    m.UseModels: "use",
    m.Ego: "ego",
    m.Goal: "ego",
    m.GoalAt: "lines",
    m.Expect: "expect",
    m.End: "expect",
    m.Window: "window",
    m.Risk: "window",
}
"""Statements that stand together, without a blank line, in files that the tool writes; others by their class."""


def print_model(model: m.Definition, comments: Mapping[Key, Comments] | None = None) -> str:
    """Return a definition as the text of its file.

    Args:
        model: what the file says.
        comments: as in `Document.comments`: then blank lines stand where the author put them (one at most). Without
            them, one blank line separates groups of statements.
    """
    writer = _Writer(model, comments)
    return writer.file(model)


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
        self._parameters = ANY_NAME if isinstance(model, m.Extension) else named

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
        at_brace = around.at_end or around.after_end is not None  # a comment that needs the closing brace's own line
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
        """Whether something inside has a comment, so that it cannot be one line."""
        inner = [self._around((*key, *inner_key)) for inner_key, _ in shape.inside or ()]
        texts = [text for c in inner for text in (*c.before, c.after) if text]
        return bool(texts or around.at_end or around.after_end)

    def _around(self, key: Key) -> Comments:
        return (self._comments or {}).get(key, _NONE)

    def _remarks(self, texts: tuple[str, ...], depth: int) -> None:
        for text in texts:
            self.lines.append(f"{_INDENT * depth}# {text}".rstrip() if text else "")

    def _add(self, text: str, depth: int, after: str | None) -> None:
        remark = f"  # {after}".rstrip() if after is not None else ""
        self.lines.append(f"{_INDENT * depth}{text}{remark}")


def _group(item: m.Item | str) -> str:
    if isinstance(item, str):
        return "lines"
    return _GROUPS.get(type(item), type(item).__name__)
