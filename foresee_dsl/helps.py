"""What a diagnostic's help says to do: the text that people read and, with it, the edits that it stands for as data.

A help is put together with `+`, so that each text to write is stated once::

    help = "write it like " + write("ego.eta(j4)") + ", or " + remove("remove this")

The editor tries the edits at the place of the diagnostic and offers those that mend it; SARIF has the sure ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal, NoReturn, Self


@dataclass(frozen=True, slots=True)
class Write:
    """Put a text in the place of what is marked, beside it, or as a statement of its own."""

    text: str


@dataclass(frozen=True, slots=True)
class Meant:
    """Replace a word by the one that was meant: a sure edit, and the only one of its diagnostic.

    Attributes:
        text: what was meant.
        wrong: what it replaces, inside the marked place; empty for all of the place.
        spaced: the place may hold blanks.
    """

    text: str
    wrong: str = ""
    spaced: bool = False


@dataclass(frozen=True, slots=True)
class Instead:
    """Replace a text of the statement around the place, the nearest first."""

    text: str
    wrong: str


@dataclass(frozen=True, slots=True)
class OneOf:
    """Replace the wrong word by one of these, which are names of the file or words of the language."""

    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class GoOn:
    """Put a text behind the place, where a statement stops too early."""

    text: str


@dataclass(frozen=True, slots=True)
class InBlock:
    """Put a setting into the block of the item with this name."""

    text: str
    name: str


@dataclass(frozen=True, slots=True)
class Remove:
    """Take out what is marked, or its statement; with a word, from that word on."""

    word: str = ""


@dataclass(frozen=True, slots=True)
class Rename:
    """Give what is marked a name that is free; everywhere: where the file uses the name too."""

    everywhere: bool = False


@dataclass(frozen=True, slots=True)
class Rewrite:
    """Write the statement in another form: close its block, move it into the block before, make it a trigger, a
    comment, or a trigger with the opposite of the condition before it."""

    to: Literal["closed block", "inside", "trigger", "comment", "opposite"]


Edit = Write | Meant | Instead | OneOf | GoOn | InBlock | Remove | Rename | Rewrite
"""What a help says to do, as its author means it; where exactly is worked out from the text."""


@dataclass(frozen=True, slots=True)
class Help:
    """A help's text, and the edits that it stands for."""

    text: str
    edits: tuple[Edit, ...] = ()

    @classmethod
    def of(cls, help: HelpText) -> Help:
        """Return a help with its edits; a plain text has none."""
        return help if isinstance(help, Help) else Help(help)

    def __add__(self, other: HelpText) -> Help:
        added = Help.of(other)
        return Help(self.text + added.text, self.edits + added.edits)

    def __radd__(self, other: str) -> Help:
        return Help(other + self.text, self.edits)

    def __bool__(self) -> bool:
        return bool(self.text)

    def __format__(self, spec: str) -> NoReturn:
        """Refuse to become a part of a text, which would lose the edits.

        Raises:
            TypeError: always.
        """
        raise TypeError("add helps with `+`, so that their edits stay")

    __str__ = __repr__ = object.__repr__

    def expanded(self, expand: Callable[[str], str]) -> Self:
        """Return the help of a table with the groups of a match filled in, in the text and in the edits."""
        return replace(self, text=expand(self.text), edits=tuple(_expanded(edit, expand) for edit in self.edits))


HelpText = str | Help
"""A help with its edits, or a text that stands for none."""


def expanded(help: HelpText, expand: Callable[[str], str]) -> HelpText:
    """Return the help of a table with the groups of a match filled in."""
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
    """Return a text to write, in backticks; a pattern with gaps (`when ... { ... }`) is only shown."""
    pattern = text.endswith(" ...") or any(gap in text for gap in _GAPS)
    return Help(f"`{text}`", () if pattern else (Write(text),))


def meant_word(word: str, wrong: str = "") -> Help:
    """Return `did you mean 'WORD'?`, in the place of a wrong word."""
    return Help(f"did you mean '{word}'?", (Meant(word, wrong),))


def meant_code(code: str, wrong: str = "") -> Help:
    """Return ``did you mean `CODE`?``, in the place of what is marked or of a part of it."""
    return Help(f"did you mean `{code}`?", (Meant(code, wrong, spaced=True),))


def instead(text: str, wrong: str) -> Help:
    """Return `TEXT` instead of `WRONG`, in backticks."""
    return Help(f"`{text}` instead of `{wrong}`", (Instead(text, wrong),))


def one_of(words: Iterable[str], last: str = ", ") -> Help:
    """Return words of which one is to be written; `last` stands before the last of them. Values with units are only
    shown."""
    every = tuple(words)
    text = last.join(part for part in (", ".join(every[:-1]), *every[-1:]) if part)
    return Help(text, () if any(" " in word for word in every) else (OneOf(every),))


def go_on(text: str) -> Help:
    """Return with what a statement that stops too early goes on."""
    return Help(f"go on like `{text}`", (GoOn(text), Write(text)))


def in_block(text: str, name: str, kind: str = "") -> Help:
    """Return the setting to write in the block of an item, of a kind such as `road`."""
    return Help(f"write `{text}` in the block of {f'{kind} ' if kind else ''}'{name}'", (InBlock(text, name),))


def remove(words: str) -> Help:
    """Return that something is to be removed, in the help's words: `remove it`, `keep one of the two`."""
    return Help(words, (Remove(),))


def leave_out(word: str) -> Help:
    """Return that a word is to be left out, with what it introduces."""
    return Help(f"leave `{word}` out", (Remove(word),))


def rename(words: str, *, everywhere: bool = False) -> Help:
    """Return that another name is needed, in the help's words: `give it another name`."""
    return Help(words, (Rename(everywhere),))


def close_block(words: str) -> Help:
    """Return that a block is to be closed, in the help's words."""
    return Help(words, (Rewrite("closed block"),))


def move_inside(words: str) -> Help:
    """Return that a statement belongs in the block before it, in the help's words."""
    return Help(words, (Rewrite("inside"),))


def as_trigger(words: str) -> Help:
    """Return that an action belongs in a trigger, in the help's words."""
    return Help(words, (Rewrite("trigger"),))


def as_comment(words: str) -> Help:
    """Return that a text is to become a comment, in the help's words."""
    return Help(words, (Rewrite("comment"),))


def as_opposite(words: str) -> Help:
    """Return that a trigger needs the opposite of the condition before it, in the help's words."""
    return Help(words, (Rewrite("opposite"),))
