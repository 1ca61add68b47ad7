"""Assigns each comment and blank line to the statement that it belongs to."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter

from foresee_dsl.errors import Span
from foresee_dsl.language.document import END, HEADER, Comments, Key
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.syntax.scan import Comment

_Place = tuple[int, int]
_START = attrgetter("start")

BARE = " "
"""The text of an empty comment (an empty string is a blank line)."""


@dataclass
class _Entry:
    """One statement: its place, the statements inside it (in the order of the file), and its comments so far."""

    key: Key
    start: _Place
    end: _Place
    block: tuple[_Place, _Place] | None = None
    children: list[_Entry] = field(default_factory=list)
    before: list[tuple[int, str]] = field(default_factory=list)  # line (0: from inside the statement), text
    after: str | None = None
    at_end: list[tuple[int, str]] = field(default_factory=list)
    after_end: str | None = None


def attach(root: Node, header: Span, comments: Sequence[Comment], text: str) -> Mapping[Key, Comments]:
    """Return the comments and blank lines of each statement that has any, by the statement's path in the model.

    `header` is the place of `foresee 1`. The comments are in order, and newlines in the text are `\n`.
    """
    head = _Entry(HEADER, *_places(header))
    file = _Entry(END, (0, 0), (10**9, 0), ((0, 0), (10**9, 0)), [head, _entry((), root.span, root)])
    lines = text.split("\n")
    for comment in comments:
        own_line = not lines[comment.line - 1][: comment.column - 1].strip()
        if comment.allow is None or not _place_allowance(file, comment, own_line):
            _place(file, (comment.line, comment.column), _text(comment), own_line)
    by_key: dict[Key, Comments] = {}
    _collect(file, by_key)
    at_end = by_key.pop(END, None)
    if at_end is not None and at_end.at_end:
        texts = at_end.at_end
        by_key[END] = Comments(before=texts[1:] if not texts[0] else texts)
    return by_key


def _text(comment: Comment) -> str:
    text = comment.text[1:].rstrip()
    return text.removeprefix(" ") or BARE


def _places(span: Span) -> tuple[_Place, _Place]:
    return (span.line, span.column), (span.end_line, span.end_column)


def _entry(key: Key, span: Span, node: Node | None) -> _Entry:
    block = _places(node.block) if node is not None and node.block is not None else None
    entry = _Entry(key, *_places(span), block)
    if node is not None:
        entry.children = sorted((_entry((*key, *inner), at, child) for inner, at, child in node.lines), key=_START)
    return entry


def _place(container: _Entry, at: _Place, text: str, own_line: bool) -> None:
    """Add one comment to the statement that it belongs to."""
    k = bisect_left(container.children, at, key=_START)
    last = container.children[k - 1] if k else None
    if last is not None and last.block is not None and last.block[0] <= at < last.block[1]:
        return _place(last, at, text, own_line)
    if last is not None and at < last.end:
        # The comment is inside a list that goes over several lines.
        _behind(last, text, same_line=last.start[0] == at[0])
    elif own_line:
        following = container.children[k] if k < len(container.children) else None
        (following.before if following is not None else container.at_end).append((at[0], text))
    elif last is None or last.end[0] < at[0]:
        _behind(container, text)
    elif last.block is None or last.start[0] == last.end[0]:
        _behind(last, text)
    else:
        last.after_end = text
    return None


def _place_allowance(file: _Entry, comment: Comment, own_line: bool) -> bool:
    """Add a comment that allows a lint to the statements that it applies to (`lints/allowances.py`); return whether it
    was added.

    The formatted file has one statement on a line, so the comment of a line with several statements is repeated.
    """
    line, text = comment.line, _text(comment)
    if not own_line:
        entries = _beginning_on(line, file)
        for entry in entries:
            _behind(entry, text)
        return bool(entries)
    if _in_list(file, (line, comment.column)):
        return False
    following = min((entry.start[0] for entry in _inside(file) if entry.start[0] > line), default=line)
    entries = _beginning_on(following, file)
    if len(entries) < 2:
        return False
    for k, entry in enumerate(entries):
        entry.before.append((line if k == 0 else 0, text))
    return True


def _inside(container: _Entry) -> Iterator[_Entry]:
    for child in container.children:
        yield child
        yield from _inside(child)


def _beginning_on(line: int, container: _Entry) -> list[_Entry]:
    """Return the outermost statements that begin on a line."""
    beginning: list[_Entry] = []
    for child in container.children:
        beginning += [child] if child.start[0] == line else _beginning_on(line, child)
    return beginning


def _in_list(file: _Entry, at: _Place) -> bool:
    """Return whether a place is inside a list that goes over several lines."""
    return any(e.start < at < (e.block[0] if e.block is not None else e.end) for e in _inside(file))


def _behind(entry: _Entry, text: str, *, same_line: bool = True) -> None:
    if entry.after is None and same_line:
        entry.after = text
    else:
        entry.before.append((0, text))


def _collect(container: _Entry, by_key: dict[Key, Comments]) -> None:
    previous = container.block[0][0] if container.block is not None else container.start[0]
    for child in container.children:
        before, blank = _with_gaps(child.before, previous, child.start[0])
        _collect(child, by_key)  # first, because this stores the comments at the child's end
        at_end = by_key.get(child.key, Comments()).at_end
        by_key[child.key] = Comments(
            before=before, blank_before=blank, after=child.after, at_end=at_end, after_end=child.after_end
        )
        if by_key[child.key] == Comments():
            del by_key[child.key]
        previous = child.end[0]
    if container.at_end:
        texts, blank = _with_gaps(container.at_end, previous, None)
        leading = ("",) if blank and container.children else ()
        by_key[container.key] = Comments(at_end=leading + texts)


def _with_gaps(
    comments: Sequence[tuple[int, str]], previous: int, following: int | None
) -> tuple[tuple[str, ...], bool]:
    """Return comment texts with an empty string for each gap between them, and whether there is a gap before the
    first."""
    texts: list[str] = []
    blank = False
    placed = [(line, text) for line, text in comments if line]
    for line, text in (*placed, *([(following, None)] if following is not None else [])):
        if line > previous + 1:
            if texts:
                texts.append("")
            else:
                blank = True
        if text is not None:
            texts.append(text)
        previous = max(previous, line)
    texts += [text for line, text in comments if not line]  # comments from inside the statement go above it
    return tuple(texts), blank
