"""Finds phrases that newcomers write in their own words (`grammars/phrases.toml`), and says how this language writes
them.

Phrases are searched only in statements that the grammar refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from foresee_dsl.files import data_folder
from foresee_dsl.helps import HelpText, expanded, leave_out, meant_code, remove, write
from foresee_dsl.language.syntax.foreign_words import TOP, Foreign


@dataclass(frozen=True, slots=True)
class Phrase:
    """A phrase with its message. The group `place` of its pattern is the wrong part; without such a group, the whole
    match is.

    Attributes:
        rules: the phrase is searched where the grammar expects one of these rules; empty: everywhere.
        message, help: texts that may name groups of the pattern, which `re.Match.expand` fills in.
    """

    rules: tuple[str, ...]
    pattern: re.Pattern[str]
    message: str
    help: HelpText

    def find(self, text: str, rule: str) -> Foreign | None:
        """Return the message for a statement that has the phrase; otherwise None."""
        if self.rules and rule not in self.rules:
            return None
        match = self.pattern.search(text)
        if match is None:
            return None
        group = "place" if "place" in self.pattern.groupindex else 0
        start, end = match.span(group)
        return Foreign(start, end, match.expand(self.message), expanded(self.help, match.expand))


_PLACES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "scenario": TOP,
        "condition": (*TOP, "action"),
        "action": ("action",),
        "actor": ("actor_item",),
        "anywhere": (),
    }
)
"""The rules that the grammar expects at each place that the table names."""
_SHORTHANDS = {"<value>": r"(?P<v>-?[0-9][^{}]*?)", "<end>": r"\s*(?:\{\})?$"}


@cache
def phrases() -> tuple[Phrase, ...]:
    """Return all phrases of `grammars/phrases.toml`, in the order in which they are tried."""
    import tomllib  # imported here, because only texts with errors need the phrases

    text = (data_folder("grammars") / "phrases.toml").read_text(encoding="utf-8")
    return tuple(map(_phrase, tomllib.loads(text)["phrase"]))


def _phrase(entry: Mapping[str, str]) -> Phrase:
    pattern = entry["pattern"]
    for shorthand, meant in _SHORTHANDS.items():
        pattern = pattern.replace(shorthand, meant)
    help: HelpText = ""
    if "meant" in entry:
        help = meant_code(entry["meant"])
    elif "leave_out" in entry:
        help = leave_out(entry["leave_out"])
    elif "remove" in entry:
        help = remove(entry["remove"])
    for k, part in enumerate(entry.get("help", "").split("`")):  # texts and, from the second on, code alternate
        help = help + (write(part) if k % 2 else part)
    return Phrase(_PLACES[entry["in"]], re.compile(pattern), entry["message"], help)


_EXPECTS = re.compile(
    r"^expect\s+(?P<label>[a-z]\w*\s*:\s*)?(?P<c>(?!(?:never|always|eventually)\b)(?P<not>(?:not|no)\s+)?(?P<inner>.+))$"
)
_BARE = re.compile(r"^(?P<what>collision|arrived)$")
_HOLDS_ALWAYS = re.compile(r"[>]|\.speed\s*<|\.acceleration\s*<")


def phrase(text: str, rule: str, reads: Callable[[str], bool]) -> Foreign | None:
    """Return the message for a statement in a newcomer's words, or None; `reads` returns whether a text is a valid
    statement."""
    expected = _expectation(text, reads) if rule in TOP else None
    if expected is not None:
        return expected
    return next((message for known_phrase in phrases() if (message := known_phrase.find(text, rule)) is not None), None)


def _expectation(text: str, reads: Callable[[str], bool]) -> Foreign | None:
    """Return the message for an expectation without its mode, or None. The help offers the mode that keeps the author's
    meaning, never the opposite one."""
    match = _EXPECTS.match(text)
    if match is None:
        return None
    inner = _BARE.sub(r"\g<what>(ego)", match["inner"].strip())
    if not reads(f"expect never {inner}"):
        return None
    message = "an expectation begins with `never`, `always` or `eventually`"
    start, end = match.span("c")
    if match["not"] or inner.startswith("collision"):
        return Foreign(start, end, message, meant_code(f"never {inner}"))
    if re.match(r"arrived\b|\w+\s+sees\b", inner):
        return Foreign(start, end, message, meant_code(f"eventually {inner}"))
    if _HOLDS_ALWAYS.search(inner):
        return Foreign(start, end, message, meant_code(f"always {inner}"))
    help = write(f"always {inner}") + " requires it at every moment, " + write(f"never {inner}") + " at none, "
    help += write(f"eventually {inner}") + " at one"
    return Foreign(start, end, message, help)
