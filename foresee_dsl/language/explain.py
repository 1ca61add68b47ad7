"""What to say about a statement that the grammar refuses: spelling first, then what was expected, in people's words."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from lark.exceptions import UnexpectedCharacters, UnexpectedEOF, UnexpectedInput, UnexpectedToken
from lark.lexer import PatternStr

from foresee_dsl.language.codes import ACTION_USAGE, EXAMPLES, NOUNS, USAGE
from foresee_dsl.language.grammar import STARTS, statement_parser
from foresee_dsl.language.suggest import closest
from foresee_dsl.language.units import UNITS, Dimension

_WORD = re.compile(r'[^\W\d][\w.]*|-?[0-9][\w.]*|"[^"\n]*"?|=>|<=|>=|\.\.\.?|.', re.DOTALL)
_UNIT_BEFORE = re.compile(r"[0-9]\s*([%°]|[^\W\d][\w/^²]*)\s*$")
_LAST_WORD = re.compile(r"([^\W\d]\w*|[(,<>=.:])[^\w(,<>=.:]*$")
_SHOWN = 40
_STATE_USAGE = "vehicle runner: car.compact at (1 m, 2 m) heading 90 deg speed 8 m/s { ... }"

PLACES = MappingProxyType(
    {
        "scenario_item": "a scenario",
        "clip_item": "a clip",
        "mutant_item": "a mutant",
        "network_item": "a network",
        "models_item": "a catalogue of models",
        "actor_item": "an actor's block",
        "action": "a trigger's block",
        "assignment": "a case",
        "traffic_item": "traffic",
        "junction_item": "a junction",
        "road_item": "a road",
        "model_item": "a model",
        "origin_item": "an origin block",
        "header": "the first line",
        "definition": "a file",
    }
)
"""What a block is called, by the rule of its statements."""

_DIMENSIONS: MappingProxyType[str, Dimension] = MappingProxyType(
    {
        "after": "time",
        "before": "time",
        "elapsed": "time",
        "for": "time",
        "over": "time",
        "delay": "time",
        "window": "time",
        "from": "time",
        "speed": "speed",
        "max_speed": "speed",
        "to": "speed",
        "heading": "angle",
        "steer": "angle",
        "max_steer": "angle",
        "steer_rate": "angular_rate",
        "acceleration": "acceleration",
        "braking": "acceleration",
        "emergency_braking": "acceleration",
        "mass": "mass",
        "offset": "length",
        "moving": "length",
        "fidelity": "length",
        "lane_width": "length",
        "sidewalk": "length",
        "median": "length",
        "length": "length",
        "width": "length",
        "wheelbase": "length",
        "front_overhang": "length",
        "within": "length",
        "(": "length",
        "lanes": "count",
        "back": "count",
        "count": "count",
        "seed": "count",
        "timing": "ratio",
        "steers": "ratio",
        "rain": "ratio",
        "fog": "ratio",
        "wetness": "ratio",
        "sun": "ratio",
    }
)
"""What kind of value follows a word; only for messages, the model decides."""


class Refusal:
    """One statement that the grammar refused, and what to say about it.

    Attributes:
        start, end: the place inside the statement's text.
    """

    def __init__(self, error: UnexpectedInput, text: str, rule: str) -> None:
        """Look at an error.

        Args:
            error: what Lark raised.
            text: the statement; braces are already empty.
            rule: what it was to be (`actor_item`).
        """
        self._text = text
        self._rule = rule
        self._accepted = _accepted(error)
        at_end = isinstance(error, UnexpectedEOF) or (isinstance(error, UnexpectedToken) and error.token.type == "$END")
        where = None if at_end else error.pos_in_stream
        self.start = len(text) if where is None else where
        found = _WORD.match(text, self.start)
        self.word = found[0] if found else ""
        self.end = self.start + max(1, len(self.word))
        self.code, self.message, self.help = self._explain(error)

    def _explain(self, error: UnexpectedInput) -> tuple[str, str, str]:
        words, _ = self._literals()
        shown = self.word if len(self.word) <= _SHOWN else self.word[: _SHOWN - 3] + "..."
        if self.word.startswith('"') and (len(self.word) == 1 or not self.word.endswith('"')):
            return "FS015", "this text is not closed", 'end it with `"` on the same line'
        unit = _UNIT_BEFORE.search(self._text, 0, self.start)
        if unit is not None and unit[1] not in UNITS:
            return self._unknown_unit(unit, words)
        if self.start == 0:
            return self._unknown_statement(words, shown)
        return self._unexpected(error, words, shown)

    def _unexpected(self, error: UnexpectedInput, words: Collection[str], shown: str) -> tuple[str, str, str]:
        usage = self._usage()
        if self._is_word() and (found := closest(self.word, words)) is not None and found != self.word:
            return "FS004", f"unknown word '{shown}'", f"did you mean '{found}'?"
        if isinstance(error, UnexpectedCharacters) and not self._is_word():
            return self._stray(shown, usage)
        if not self.word:
            return "FS003", f"the statement stops too early: expected {self._expected()}", usage
        return "FS003", f"unexpected `{shown}`: expected {self._expected()}", usage

    def _unknown_unit(self, unit: re.Match[str], words: Collection[str]) -> tuple[str, str, str]:
        """`start at 20 alng west`: the word after a number was taken for a unit."""
        self.start, self.end = unit.span(1)
        found = closest(unit[1], [*UNITS, *words])
        if found is not None and found not in UNITS:
            return "FS004", f"unknown word '{unit[1]}'", f"did you mean '{found}'?"
        return "FS005", f"unknown unit '{unit[1]}'", f"did you mean '{found}'?" if found else self._usage()

    def _unknown_statement(self, words: Collection[str], shown: str) -> tuple[str, str, str]:
        place = PLACES.get(self._rule, "a file")
        homes = _homes().get(self.word, ())
        if homes and self.word not in words:
            return "FS008", f"'{shown}' cannot stand in {place}", f"it belongs in {' or '.join(homes)}"
        found = closest(self.word, words) if self._is_word() else None
        if found is not None:
            return "FS004", f"unknown statement '{shown}'", f"did you mean '{found}'?"
        if self._is_word() and words:
            return "FS004", f"unknown statement '{shown}'", f"in {place} you can write: {', '.join(sorted(words))}"
        return "FS003", f"unexpected `{shown}` in {place}", self._usage()

    def _stray(self, shown: str, usage: str) -> tuple[str, str, str]:
        if self.word == "'":
            return "FS015", "unexpected `'`", 'texts stand in double quotes: `"like this"`'
        if self._text.startswith("->", self.start):
            return "FS015", "unexpected `->`", "did you mean `=>`?"
        if self.word == "-":
            return "FS015", "unexpected `-`", "names are written with underscores: `red_light`"
        if self.word.isprintable():
            return "FS015", f"unexpected character `{shown}`: expected {self._expected()}", usage
        return "FS015", f"unexpected character U+{ord(self.word[0]):04X}", "remove it"

    def _is_word(self) -> bool:
        return bool(self.word) and (self.word[0].isalpha() or self.word[0] == "_")

    def _usage(self) -> str:
        first = re.match(r"[^\W\d]\w*", self._text)
        if self._rule == "traffic_item" and first is not None and first[0] == "models":
            return "write it like `models [car.compact, van.delivery]`"
        if self._rule in ("scenario_item", "clip_item") and re.search(r":\s*[\w.]+\s+at\b", self._text):
            return f"write it like `{_STATE_USAGE}`"
        if self._rule == "action":
            return f"write it like `{ACTION_USAGE}`"
        if first is not None and first[0] in USAGE:
            return f"write it like `{USAGE[first[0]]}`"
        if self._rule == "assignment":
            return "write it like `gap = 1.2 s`"
        return ""

    def _literals(self) -> tuple[list[str], list[str]]:
        """The words and the signs that were expected, in a fixed order."""
        texts = []
        for name in sorted(self._accepted):
            pattern = _terminal(name)
            if pattern is not None:
                texts.append(pattern)
        words = [text for text in texts if text[0].isalpha()]
        return words, [text for text in texts if not text[0].isalpha()]

    def _expected(self) -> str:
        """What was expected, in people's words, most telling first."""
        accepted = self._accepted
        words, signs = self._literals()
        parts: list[str] = []
        if "NUMBER" in accepted:
            parts.append(self._value())
        elif "DOTTED" in accepted:
            parts.append("a model such as `car.compact`" if "route" not in self._text else "`ego.route`")
        elif "NAME" in accepted:
            parts.append("a name")
        if "STRING" in accepted and "NAME" not in accepted:
            parts.append("a text in double quotes")
        if "PIN" in accepted:
            parts.append("a pin such as `sha256:5ef2c6120a41`")
        if "COMPARE" in accepted:
            parts += ["`<`", "`<=`", "`>`", "`>=`"]
        if "ttc" in words:
            return "a condition such as `ego.speed < 3 m/s`"
        parts += [f"`{word}`" for word in words]
        parts += [f"`{sign}`" for sign in signs if sign not in "{};" and not (sign == "(" and "NUMBER" in accepted)]
        if not parts and accepted & {"$END", "_NEWLINE", "SEMICOLON", "RBRACE"}:
            return "the end of the statement"
        if not parts:
            return "`{`" if "LBRACE" in accepted else "something else"
        return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} or {parts[-1]}"

    def _value(self) -> str:
        if "LPAR" in self._accepted:
            return "a place such as `20 m along ego.route`"
        before = _LAST_WORD.search(self._text, 0, self.start)
        dimension = _DIMENSIONS.get(before[1]) if before is not None else None
        if before is not None and before[1] == "," and "(" in self._text:
            dimension = "length"
        return f"{NOUNS[dimension]} such as `{EXAMPLES[dimension]}`" if dimension else "a value such as `2.5 s`"


def _accepted(error: UnexpectedInput) -> set[str]:
    """The names of the terminals that could have stood at the place."""
    state = getattr(error, "interactive_parser", None)
    if state is not None:
        return set(state.accepts())
    return set(getattr(error, "expected", None) or getattr(error, "allowed", None) or ())


@cache
def _homes() -> Mapping[str, tuple[str, ...]]:
    """Where the first word of a statement may stand, read off the grammar."""
    found: dict[str, list[str]] = {}
    for rule, place in PLACES.items():
        if rule not in STARTS:
            continue
        state: Any = statement_parser().parse_interactive("", start=rule)  # Lark leaves `accepts` without types
        for name in sorted(state.accepts()):
            word = _terminal(name)
            if word is not None and word[0].isalpha():
                found.setdefault(word, []).append(place)
    return {word: tuple(places) for word, places in found.items()}


def _terminal(name: str) -> str | None:
    """The text of a terminal that is a fixed word or sign."""
    if name == "$END":
        return None
    pattern = statement_parser().get_terminal(name).pattern
    if name == "MEASURE_TIME":
        return "time"
    return pattern.value if isinstance(pattern, PatternStr) else None
