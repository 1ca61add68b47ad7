"""The error tree: what a caller may catch. Nothing below the command line prints or exits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from foresee_dsl.helps import Edit, Help, HelpText


@dataclass(frozen=True, slots=True)
class Span:
    """A place in a text: 1-based line and column, end exclusive."""

    line: int
    column: int
    end_line: int
    end_column: int


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

    shown = "code severity message help path span"

    @classmethod
    def of(
        cls,
        code: str,
        message: str,
        help: HelpText,
        path: str,
        span: Span | None = None,
        source_line: str = "",
    ) -> Diagnostic:
        """Return an error with the text of its help and the edits that this stands for."""
        helped = Help.of(help)
        return cls(code, message, helped.text, path, span, source_line, fixes=helped.edits)


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
