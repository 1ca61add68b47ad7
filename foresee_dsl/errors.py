"""The errors that a caller may catch. No code below the command line prints or exits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NoReturn

from foresee_dsl.helps import Edit, Help, HelpText


@dataclass(frozen=True, slots=True)
class Span:
    """A place in a text: 1-based lines and columns, the end exclusive."""

    line: int
    column: int
    end_line: int
    end_column: int


@dataclass(frozen=True, slots=True)
class Message:
    """A diagnostic's message; if it has numbers that differ between test cases, it is composed with `+`.

    Attributes:
        text: the text that people read.
        about: the text without these numbers; errors at one place with the same `about` count as one.
        names: the names that the message is about, in its order.
    """

    text: str
    about: str
    names: tuple[str, ...] = ()

    @classmethod
    def of(cls, message: MessageText) -> Message:
        """Return a text as a message; every part of a plain text distinguishes it from other messages."""
        return message if isinstance(message, Message) else Message(message, message)

    def __add__(self, other: MessageText) -> Message:
        added = Message.of(other)
        return Message(self.text + added.text, self.about + added.about, self.names + added.names)

    def __radd__(self, other: str) -> Message:
        return Message(other + self.text, other + self.about, self.names)

    def __format__(self, spec: str) -> NoReturn:
        """Raise, because formatting into a text would lose which numbers are measured.

        Raises:
            TypeError: always.
        """
        raise TypeError("add messages with `+`, so that their measured numbers stay known")


MessageText = str | Message
"""A message, or a text without measured numbers."""


def measured(number: str) -> Message:
    """Return a number, such as a length, that is ignored when the same error of several test cases is merged."""
    return Message(number, "")


def with_article(noun: str) -> str:
    """Return a noun of the language with `a` or `an`; one that takes no article, such as `models`, without."""
    if noun in ("models", "weather") or noun.startswith("cases "):
        return noun
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def subject(name: str) -> Message:
    """Return a name that a message is about, such as an unknown one: code finds it in `Diagnostic.names`."""
    return Message(name, name, (name,))


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One error (or warning) in a file: where, what, and what to write instead.

    Attributes:
        code: stable code such as `FS012`.
        message: one sentence, lower-case start, no full stop: `unknown unit 'kmh'`.
        help: what to write instead: `did you mean 'km/h'?`; empty if there is no useful hint.
        path: the file, as the user named it.
        span: the place, or None for the whole file.
        source_line: the text of line `span.line`, without its newline (may be cut around the place if very long).
        severity: "error" or "warning".
        about: the message without numbers that differ between test cases; empty if it has none.
        fixes: edits that carry out the help, the most likely ones first; an editor offers those that fix the error.
        names: the names that the message is about, as far as code needs them.
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
    names: tuple[str, ...] = field(default=(), compare=False)

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "code": self.code,
            "severity": self.severity,
            "message": self.message,
            "help": self.help,
            "path": self.path,
            "span": self.span,
        }

    @classmethod
    def of(
        cls,
        code: str,
        message: MessageText,
        help: HelpText,
        path: str = "",
        span: Span | None = None,
        source_line: str = "",
    ) -> Diagnostic:
        """Return an error; the edits of its help become its fixes. The parser adds the path and the source line."""
        helped, worded = Help.of(help), Message.of(message)
        about = worded.about if worded.about != worded.text else ""
        names = worded.names
        return cls(
            code, worded.text, helped.text, path, span, source_line, fixes=helped.edits, about=about, names=names
        )

    @property
    def start(self) -> tuple[int, int]:
        """Line and column at which its place begins; zeros if it is about the whole file."""
        return (self.span.line, self.span.column) if self.span is not None else (0, 0)

    @property
    def key(self) -> tuple[str, str, Span | None, str]:
        """Identity of this error across test cases: its code, file, place and message without measured numbers."""
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
    """SUMO's programs are missing, or refused a network that the language accepted; the message quotes their output."""


class SimulationError(ForeseeError):
    """The world could not be set up or stepped."""


class DriverError(ForeseeError):
    """A driver is unknown, cannot be loaded, or broke its protocol."""


class DriverUnavailableError(DriverError):
    """A driver is sound, but a package or weights that it needs are not installed; the message says which."""


class DriverLateError(DriverError):
    """A driver did not answer in time.

    Attributes:
        deadline_s: the wall time that was available, in s.
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
