"""The error tree: what a caller may catch. Nothing below the command line prints or exits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NoReturn

from foresee_dsl.helps import Edit, Help, HelpText


@dataclass(frozen=True, slots=True)
class Span:
    """A place in a text: 1-based line and column, end exclusive."""

    line: int
    column: int
    end_line: int
    end_column: int


@dataclass(frozen=True, slots=True)
class Message:
    """A diagnostic's message, put together with `+` where it has numbers that differ between test cases.

    Attributes:
        text: what people read.
        about: the text without these numbers: what makes two mistakes of one place different.
    """

    text: str
    about: str

    @classmethod
    def of(cls, message: MessageText) -> Message:
        """Return a message; of a plain text all makes it different from others."""
        return message if isinstance(message, Message) else Message(message, message)

    def __add__(self, other: MessageText) -> Message:
        added = Message.of(other)
        return Message(self.text + added.text, self.about + added.about)

    def __radd__(self, other: str) -> Message:
        return Message(other + self.text, other + self.about)

    def __format__(self, spec: str) -> NoReturn:
        """Refuse to become a part of a text, which would lose which numbers are measured.

        Raises:
            TypeError: always.
        """
        raise TypeError("add messages with `+`, so that their measured numbers stay known")


MessageText = str | Message
"""A message, or a text without measured numbers."""


def measured(number: str) -> Message:
    """Return a number of a message that may differ between the test cases that have one mistake, such as a length."""
    return Message(number, "")


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One mistake (or warning) in a file: where, what, and what to write instead.

    Attributes:
        code: stable code such as `FS012`.
        message: one sentence, lower-case start, no full stop: `unknown unit 'kmh'`.
        help: what to write instead: `did you mean 'km/h'?`; empty where there is no useful hint.
        path: the file as the user named it.
        span: the place, or None where the whole file is meant.
        source_line: the text of line `span.line`, without its newline (may be cut around the place if very long).
        severity: "error" or "warning".
        about: the message without numbers that differ between test cases; empty where there are none.
        fixes: the edits that the help stands for, likely ones first; they mend it in an editor.
    """

    code: str
    message: str
    help: str = ""
    path: str = ""
    span: Span | None = None
    source_line: str = ""
    severity: Literal["error", "warning"] = "error"
    fixes: tuple[Edit, ...] = field(default=(), compare=False)
    about: str = field(default="", compare=False)

    shown = "code severity message help path span"

    @classmethod
    def of(
        cls,
        code: str,
        message: MessageText,
        help: HelpText,
        path: str,
        span: Span | None = None,
        source_line: str = "",
    ) -> Diagnostic:
        """Return an error with the text of its help and the edits that this stands for."""
        helped, worded = Help.of(help), Message.of(message)
        about = worded.about if worded.about != worded.text else ""
        return cls(code, worded.text, helped.text, path, span, source_line, fixes=helped.edits, about=about)

    @property
    def key(self) -> tuple[str, str, Span | None, str]:
        """What makes this mistake the same in several test cases: its code, file, place and what it is about."""
        return self.code, self.path, self.span, self.about or self.message


class ForeseeError(Exception):
    """Base of all errors that a caller is expected to handle."""


@dataclass
class InputError(ForeseeError):
    """The user's input has mistakes: one diagnostic each, never empty."""

    diagnostics: tuple[Diagnostic, ...] = field(default_factory=tuple)

    def __str__(self) -> str:
        return "; ".join(_one_line(d) for d in self.diagnostics)


class CompileError(ForeseeError):
    """SUMO's programs are missing or refused a network that the language accepted (the message says what they
    printed)."""


class SimulationError(ForeseeError):
    """The world could not be set up or stepped."""


class DriverError(ForeseeError):
    """A driver is unknown, cannot be loaded, or broke its protocol."""


class DriverUnavailableError(DriverError):
    """A driver is whole, but needs something that is not installed: a package or weights (the message says which)."""


class DriverLateError(DriverError):
    """A driver did not answer in time.

    Attributes:
        deadline_s: the wall time that it had.
    """

    def __init__(self, message: str, deadline_s: float = 0.0) -> None:
        super().__init__(message)
        self.deadline_s = deadline_s


def _one_line(diagnostic: Diagnostic) -> str:
    place = diagnostic.path
    if diagnostic.span is not None:
        place += f":{diagnostic.span.line}:{diagnostic.span.column}"
    text = f"{place}: {diagnostic.code} {diagnostic.message}"
    return f"{text} ({diagnostic.help})" if diagnostic.help else text
