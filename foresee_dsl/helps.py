"""Help texts of diagnostics: the text that people read, together with the edits that carry it out, as data.

A help is composed with `+`, so that each text to write is stated once::

    help = "write it like " + write("ego.eta(j4)") + ", or " + remove("remove this")

The editor tries the edits at the diagnostic's place and offers those that fix it; SARIF contains the sure ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal, NoReturn, Self


@dataclass(frozen=True, slots=True)
class Write:
    """Write a text in place of the marked text, beside it, or as a separate statement."""

    text: str


@dataclass(frozen=True, slots=True)
class Meant:
    """Replace a word by the intended one: a sure edit, and the only one of its diagnostic.

    Attributes:
        text: the intended word. wrong: the part of the marked text that it replaces; empty: all of it.
        spaced: the marked text may contain blanks.
    """

    text: str
    wrong: str = ""
    spaced: bool = False


@dataclass(frozen=True, slots=True)
class Instead:
    """Replace a text in the statement around the marked place; of several occurrences, the nearest first."""

    text: str
    wrong: str


@dataclass(frozen=True, slots=True)
class OneOf:
    """Replace the wrong word by one of these, which are names in the file or words of the language.

    Attributes:
        words: the words. wrong: the word that one of them replaces; if the marked text does not contain it and is a
            single word, such as a parameter with that value, all of the marked text.
    """

    words: tuple[str, ...]
    wrong: str = ""


@dataclass(frozen=True, slots=True)
class GoOn:
    """Insert a text after the place at which a statement ends too early."""

    text: str


@dataclass(frozen=True, slots=True)
class InBlock:
    """Insert a setting into the block of the item with this name."""

    text: str
    name: str


@dataclass(frozen=True, slots=True)
class Remove:
    """Remove the marked text or its statement; with a word, everything from that word on."""

    word: str = ""


@dataclass(frozen=True, slots=True)
class Rename:
    """Rename the marked item to a free name; `everywhere`: also at every use in the file."""

    everywhere: bool = False


@dataclass(frozen=True, slots=True)
class Rewrite:
    """Rewrite the statement: close its block, move it into the block before, or turn it into a trigger, a comment, or a
    trigger with the opposite of the condition before it.

    Attributes:
        blocks: how many blocks the diagnostic reports as not closed.
    """

    to: Literal["closed block", "inside", "trigger", "comment", "opposite"]
    blocks: int = 1


Edit = Write | Meant | Instead | OneOf | GoOn | InBlock | Remove | Rename | Rewrite
"""An edit as the author of a help means it; the exact place is computed from the text."""


@dataclass(frozen=True, slots=True)
class Help:
    """A help's text and the edits that carry it out."""

    text: str
    edits: tuple[Edit, ...] = ()

    @classmethod
    def of(cls, help: HelpText) -> Help:
        """Return a help; a plain text has no edits."""
        return help if isinstance(help, Help) else Help(help)

    def __add__(self, other: HelpText) -> Help:
        added = Help.of(other)
        return Help(self.text + added.text, self.edits + added.edits)

    def __radd__(self, other: str) -> Help:
        return Help(other + self.text, self.edits)

    def __bool__(self) -> bool:
        return bool(self.text)

    def __format__(self, spec: str) -> NoReturn:
        """Raise, because formatting into a text would lose the edits.

        Raises:
            TypeError: always.
        """
        raise TypeError("add helps with `+`, so that their edits stay")

    __str__ = __repr__ = object.__repr__

    def expanded(self, expand: Callable[[str], str]) -> Self:
        """Return this help from a table with the match's groups filled in, in the text and in the edits."""
        return replace(self, text=expand(self.text), edits=tuple(_expanded(edit, expand) for edit in self.edits))


HelpText = str | Help
"""A help with its edits, or a text without any."""


def expanded(help: HelpText, expand: Callable[[str], str]) -> HelpText:
    """Return a help from a table with the match's groups filled in."""
    return help.expanded(expand) if isinstance(help, Help) else expand(help)


def _expanded(edit: Edit, expand: Callable[[str], str]) -> Edit:
    match edit:
        case Write() | Meant() | GoOn() | InBlock():
            return replace(edit, text=expand(edit.text))
        case Instead(text, wrong):
            return Instead(expand(text), expand(wrong))
        case Remove(word):
            return Remove(expand(word))
    return edit


_GAPS = ("{ ... }", "[...]", "(...", "CONDITION")


def write(text: str) -> Help:
    """Return a text to write, in backticks; a pattern with gaps (`when ... { ... }`) becomes text without an edit."""
    pattern = text.endswith(" ...") or any(gap in text for gap in _GAPS)
    return Help(f"`{text}`", () if pattern else (Write(text),))


def meant_word(word: str, wrong: str = "") -> Help:
    """Return `did you mean 'WORD'?`, which replaces the wrong word."""
    return Help(f"did you mean '{word}'?", (Meant(word, wrong),))


def meant_code(code: str) -> Help:
    """Return ``did you mean `CODE`?``, which replaces the marked text."""
    return Help(f"did you mean `{code}`?", (Meant(code, spaced=True),))


def instead(text: str, wrong: str) -> Help:
    """Return the help "`TEXT` instead of `WRONG`"."""
    return Help(f"`{text}` instead of `{wrong}`", (Instead(text, wrong),))


def one_of(words: Iterable[str], last: str = ", ", *, wrong: str = "") -> Help:
    """Return a list of alternative words, with `last` before the last of them. Values with units become text without an
    edit. `wrong`: see `OneOf`."""
    every = tuple(words)
    text = last.join(part for part in (", ".join(every[:-1]), *every[-1:]) if part)
    return Help(text, () if any(" " in word for word in every) else (OneOf(every, wrong),))


def go_on(text: str) -> Help:
    """Return the help that shows how a statement continues which ends too early."""
    return Help(f"go on like `{text}`", (GoOn(text), Write(text)))


def in_block(text: str, name: str, kind: str = "") -> Help:
    """Return the help to write a setting in the block of an item of a kind such as `road`."""
    return Help(f"write `{text}` in the block of {f'{kind} ' if kind else ''}'{name}'", (InBlock(text, name),))


def remove(words: str) -> Help:
    """Return the help to remove something, in the given words: `remove it`, `keep one of the two`."""
    return Help(words, (Remove(),))


def leave_out(word: str) -> Help:
    """Return the help to leave out a word together with what it introduces."""
    return Help(f"leave `{word}` out", (Remove(word),))


def rename(words: str, *, everywhere: bool = False) -> Help:
    """Return the help to choose another name, in the given words: `give it another name`."""
    return Help(words, (Rename(everywhere),))


def close_block(words: str, blocks: int = 1) -> Help:
    """Return the help to close a block, or one of several, in the given words."""
    return Help(words, (Rewrite("closed block", blocks),))


def move_inside(words: str) -> Help:
    """Return the help to move a statement into the block before it, in the given words."""
    return Help(words, (Rewrite("inside"),))


def as_trigger(words: str) -> Help:
    """Return the help to put an action into a trigger, in the given words."""
    return Help(words, (Rewrite("trigger"),))


def as_comment(words: str) -> Help:
    """Return the help to turn a text into a comment, in the given words."""
    return Help(words, (Rewrite("comment"),))


def as_opposite(words: str) -> Help:
    """Return the help to use the opposite of the condition before, in the given words."""
    return Help(words, (Rewrite("opposite"),))
