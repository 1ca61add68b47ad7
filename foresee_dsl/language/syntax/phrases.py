"""Finds words and signs of newcomers and of other languages (`grammars/phrases.toml`), and says how to write them here.

The other languages are programming languages, Scenic, and ASAM OpenSCENARIO XML and DSL. Only statements that the
grammar refused are examined.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from types import MappingProxyType
from typing import Any, get_args

from foresee_dsl.files import data_folder
from foresee_dsl.helps import (
    HelpText,
    as_comment,
    as_opposite,
    as_trigger,
    expanded,
    leave_out,
    meant_code,
    remove,
    write,
)
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import closest
from foresee_dsl.language.units import UNITS

CODE = "FS065"
_TOP = ("scenario_item", "extension_item", "clip_item")
_PLACES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "scenario": _TOP,
        "condition": (*_TOP, "action"),
        "action": ("action",),
        "actor": ("actor_item",),
        "network": ("network_item",),
        "beginning": (*_TOP, "actor_item", "junction_item", "action"),
    }
)
"""The rules that the grammar expects at each place that the table names."""
_ELSEWHERE: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"anywhere": (), "statement": ("action",), "setting": ("action", "assignment")}
)
"""The other places that the table names, each with the rules that the grammar expects elsewhere."""
_SHORTHANDS = {"value": r"(?P<v>-?[0-9][^{}]*?)", "end": r"\s*(?:\{\})?$"}
_SHORTHAND = re.compile(r"(?<!\?P)<(\w+)>")
_ACTS = re.compile(r"\w+\s+(?:starts|stops|changes|meets|ignores)\b")
"""An action whose first word is the name of an actor, whatever that word means in other languages."""
_MEANING = re.compile(r"<(\w+) of (\w+)>")
_MARKED = re.compile(r"`(?P<code>[^`]*)`|<(?P<how>remove|trigger|opposite|say) (?P<words>[^<>]*)>")
_REWRITES: Mapping[str, Callable[[str], HelpText]] = MappingProxyType(
    {"remove": remove, "trigger": as_trigger, "opposite": as_opposite, "say": str}
)


@dataclass(frozen=True, slots=True)
class Foreign:
    """The message for a statement in another language: the wrong part of its text (as offsets), the message, and the
    help."""

    start: int
    end: int
    message: str
    help: HelpText


@dataclass(frozen=True, slots=True)
class RefusedPhrase:
    """A phrase with its message. The group `place` of its pattern is the wrong part; without such a group, the whole
    match is. If it has a group `near`, the grammar refused the statement inside or right behind that group.

    Attributes:
        place: the name of the place at which it is searched.
        first: first words of statements, if the phrase is one of them.
        block: the rule for the statements in its braces, "" if they cannot be read.
        message, help: texts that may name groups of the pattern, and the meanings of the words in them.
        marks: these meanings: the text that stands for each, the name of its table, and the group.
    """

    place: str
    pattern: re.Pattern[str]
    first: frozenset[str]
    block: str
    message: str
    help: HelpText
    marks: tuple[tuple[str, str, str], ...]

    def find(self, text: str, rule: str, at: int) -> Foreign | None:
        """Return the message for a statement that has the phrase, and was refused at `at`; otherwise None."""
        places = _PLACES.get(self.place)
        if (rule in _ELSEWHERE[self.place]) if places is None else (rule not in places):
            return None
        if self.first and rule == "action" and _ACTS.match(text) is not None:
            return None
        for match in self.pattern.finditer(text):
            if "near" not in self.pattern.groupindex or match.start("near") <= at <= match.end("near"):
                return self._message(match)
        return None

    def _message(self, match: re.Match[str]) -> Foreign | None:
        """Return the message for a match; None if a word in it has no meaning here."""
        values = [(mark, _meaning(table, match[group] or "")) for mark, table, group in self.marks]
        if any(value is None for _, value in values):
            return None

        def fill(template: str) -> str:
            for mark, value in values:
                template = template.replace(mark, (value or "").replace("\\", r"\\"))
            return match.expand(template)

        start, end = match.span("place" if "place" in self.pattern.groupindex else 0)
        return Foreign(start, end, fill(self.message), expanded(self.help, fill))


def _dimension(unit: str) -> str:
    return UNITS[unit].dimension if unit in UNITS else "ratio"


def _share(percent: str) -> str:
    return f"{Decimal(percent) / 100:f}"


def _action(verb: str) -> str | None:
    heads = (kind.pattern.partition(" [")[0].split() for kind in get_args(get_args(m.Action)[0]))
    return closest(verb, [head[1] for head in heads if head[0] == "{actor}" and len(head) == 2])  # only their actor


_COMPUTED: Mapping[str, Callable[[str], str | None]] = MappingProxyType(
    {"dimension": _dimension, "share": _share, "action": _action}
)
"""What a word means, where no table of the file says it."""


def _meaning(table: str, word: str) -> str | None:
    """Return what a word means by a table or a function; a word that is not in the table means itself."""
    if table in _COMPUTED:
        return _COMPUTED[table](word)
    words = meanings(table)
    return words.get(word) or words.get(word.lower(), word)


@cache
def _tables() -> Mapping[str, Any]:
    import tomllib  # imported here, because only texts with errors need the phrases

    return tomllib.loads((data_folder("grammars") / "phrases.toml").read_text(encoding="utf-8"))


@cache
def meanings(table: str) -> Mapping[str, str]:
    """Return a table of words of other languages, each with its meaning in this one: `actor`, `road_setting`, ..."""
    return {word: meaning for meaning, group in _tables()["words"][table].items() for word in group}


@cache
def phrases() -> tuple[RefusedPhrase, ...]:
    """Return all phrases of `grammars/phrases.toml`, in the order in which they are tried."""
    return tuple(map(_phrase, _tables()["phrase"]))


def _phrase(entry: Mapping[str, Any]) -> RefusedPhrase:
    first = entry.get("first", ())
    pattern = entry["pattern"] if not first else rf"^(?P<place>{'|'.join(first)})\b"
    message = entry.get("message", r"`\g<place>` is a word of other languages")
    texts = (message, *(entry.get(key, "") for key in ("meant", "leave_out", "help")))
    marks = {(match[0], match[1], match[2]) for text in texts for match in _MEANING.finditer(text)}
    pattern = re.compile(
        _SHORTHAND.sub(lambda match: _SHORTHANDS.get(match[1]) or "|".join(meanings(match[1])), pattern)
    )
    block = entry.get("block", "action")
    return RefusedPhrase(entry["in"], pattern, frozenset(first), block, message, _help(entry), tuple(sorted(marks)))


def _help(entry: Mapping[str, Any]) -> HelpText:
    if "meant" in entry:
        return meant_code(entry["meant"])
    help: HelpText = ""
    if "leave_out" in entry:
        help = leave_out(entry["leave_out"])
    elif "remove" in entry:
        help = remove(entry["remove"])
    text: str = entry.get("help", "")
    end = 0
    for part in _MARKED.finditer(text):
        rewritten = _REWRITES[part["how"]](part["words"]) if part["how"] else write(part["code"])
        help, end = help + text[end : part.start()] + rewritten, part.end()
    return help + text[end:]


def block_of(word: str) -> str | None:
    """Return the rule for the statements in the braces behind a word of another language.

    It is "" if they cannot be read, and None for an unknown word.
    """
    if word.lower() in meanings("actor"):
        return "actor_item"
    return next((row.block for row in phrases() if word in row.first), None)


def unsupported(word: str) -> HelpText:
    """Return why networks leave a feature out on purpose; empty for any other word."""
    return next((_help(entry) for entry in _tables()["unsupported"] if word in entry["first"]), "")


_EXPECTS = re.compile(
    r"^expect\s+(?P<label>[a-z]\w*\s*:\s*)?(?P<c>(?!(?:never|always|eventually)\b)(?P<not>(?:not|no)\s+)?(?P<inner>.+))$"
)
_BARE = re.compile(r"^(?P<what>collision|arrived)$")
_HOLDS_ALWAYS = re.compile(r"[>]|\.speed\s*<|\.acceleration\s*<")


def phrase(text: str, rule: str, at: int, reads: Callable[[str], bool]) -> Foreign | None:
    """Return the message for a statement in a newcomer's words or those of another language, or None.

    Args:
        text: the statement. rule: the rule by which it was parsed. at: where the grammar refused it.
        reads: returns whether a text is a valid statement.
    """
    expected = _expectation(text, reads) if rule in _TOP else None
    if expected is not None:
        return expected
    return next((message for row in phrases() if (message := row.find(text, rule, at)) is not None), None)


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


_COMMENT = re.compile(r'"[^"\n]*"?|#[^\n]*|(?P<line>//[^\n]*)|(?P<block>/\*(?:.|\n)*?(?:\*/|\Z))')


def without_comments(text: str) -> tuple[str, list[Foreign]]:
    """Return a text in which the comments of other languages (`//`, `/* */`) are blanks, and the message for each."""
    comments: list[Foreign] = []

    def blank(match: re.Match[str]) -> str:
        if match["line"] is None and match["block"] is None:
            return match[0]
        comments.append(_comment(match))
        return re.sub(r"[^\n]", " ", match[0])

    return _COMMENT.sub(blank, text), comments


def _comment(match: re.Match[str]) -> Foreign:
    start, first = match.start(), match[0].split("\n")[0]
    if match["line"] is not None:
        return Foreign(start, start + 2, "`//` does not begin a comment", meant_code("#"))
    behind = match.string[match.end() :].split("\n")[0].strip()
    if behind or "\n" in match[0]:
        help = as_comment("begin each line of it with `#`") + "; a comment goes to the end of its line"
        return Foreign(start, start + len(first), "`/*` does not begin a comment", help)
    remark = first.removeprefix("/*").removesuffix("*/").strip()
    return Foreign(start, start + len(first), f"`{first}` is not a comment", meant_code(f"# {remark}".strip()))
