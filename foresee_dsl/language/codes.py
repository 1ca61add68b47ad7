"""The list of all errors and lints by their codes, such as `FS012`: meaning, severity, examples. `grammars/codes.toml`
declares each once; the function that reports it names the code, and everything else reads this list."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import Literal

from foresee_dsl.errors import Diagnostic, MessageText, Span
from foresee_dsl.files import data_folder
from foresee_dsl.helps import HelpText

PIN = "sha256:5ef2c6120a41"
"""The text that stands for a parent's pin in an example."""
NETWORK_LINTS = "FS33"
"""First characters of the codes of lints that need the built network."""
NEED_THE_NETWORK = ("FS25", "FS26", NETWORK_LINTS)
"""First characters of all codes that need the built network."""


@dataclass(frozen=True, slots=True)
class Code:
    """The explanation of a code.

    Attributes:
        code: its name, such as `FS012`.
        title: a few words, lower-case start, no full stop.
        explanation: one or two sentences: why it is wrong, and what to do.
        wrong, right: an example that gives the code, and its corrected form. Empty only if no user's file can cause
            the code.
        frame: the block that holds the examples (`tests/support/code_frames.py`); `file` if the examples are whole
            files.
        severity: `error` or `warning`.
    """

    code: str
    title: str
    explanation: str
    wrong: str = ""
    right: str = ""
    frame: str = "scenario"
    severity: Literal["error", "warning"] = "error"

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "code": self.code,
            "severity": self.severity,
            "title": self.title,
            "explanation": self.explanation,
            "within": self.frame,
            "wrong": self.wrong_example,
            "right": self.right_example,
        }

    @property
    def wrong_example(self) -> str:
        """The wrong example with a parent's pin filled in."""
        return self.wrong.replace("PIN", PIN)

    @property
    def right_example(self) -> str:
        """The right example with a parent's pin filled in."""
        return self.right.replace("PIN", PIN)

    @property
    def within(self) -> str:
        """The block that surrounds the examples, in words; "" if they are whole files."""
        blocks = {"file": "", "actor": "in an actor's block", "trigger": "in a trigger's block"}
        return blocks.get(self.frame, f"in a {self.frame}")


@cache
def every_code() -> MappingProxyType[str, Code]:
    """Return every code that a diagnostic may have, by name, in order."""
    import tomllib  # imported here, because a check without errors needs no explanations

    text = (data_folder("grammars") / "codes.toml").read_text(encoding="utf-8")
    return MappingProxyType({name: Code(name, **fields) for name, fields in tomllib.loads(text).items()})


def diagnostic_of(
    code: str, message: MessageText, help: HelpText, path: str, span: Span | None = None, source_line: str = ""
) -> Diagnostic:
    """Return a diagnostic with the severity of its code; see `Diagnostic.of`."""
    diagnostic = Diagnostic.of(code, message, help, path, span, source_line)
    return replace(diagnostic, severity=every_code()[code].severity)
