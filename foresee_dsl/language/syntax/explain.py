"""Words the messages for statements that the grammar refuses: first for spelling errors, then for what was expected."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from functools import cache
from typing import Any

from lark.exceptions import UnexpectedCharacters, UnexpectedEOF, UnexpectedInput, UnexpectedToken

from foresee_dsl.helps import HelpText, Write, go_on, meant_code, meant_word, move_inside, one_of, remove, write
from foresee_dsl.language import model as m
from foresee_dsl.language.keywords import KEYWORDS, USAGE
from foresee_dsl.language.messages.suggest import closest
from foresee_dsl.language.syntax.builder import SHOWN
from foresee_dsl.language.syntax.expected import (
    END,
    REACH,
    accepted_by,
    dimensions_behind,
    expected,
    homes,
    keywords,
    next_terminals,
    takes_a_place,
    text_of,
    words_of_terminals,
)
from foresee_dsl.language.syntax.grammar import PLACES, parse_tree, parser
from foresee_dsl.language.syntax.phrases import CODE, meanings, phrase, unsupported
from foresee_dsl.language.units import EXAMPLES, UNITS

_WORD = re.compile(r'[^\W\d][\w.]*|-?[0-9][\w.]*|"[^"\n]*"?|=>|<=|>=|\.\.\.?|.', re.DOTALL)
_UNIT_BEFORE = re.compile(r"[0-9]\s*([%°]|[^\W\d][\w/^²]*)\s*$")
_MEASURED = re.compile(r"\b([a-z_]+)(?:\s*\([^()]*\))?\s*$")
_HYPHENED = re.compile(r"(?<![\w.])[a-z]\w*(?:-[a-z]\w*)+")
_WORD_BEFORE = re.compile(r"([^\W\d]\w*)\s*$")
_QUANTITY = re.compile(r"-?\d+(?:\.\d+)?\s*(?P<unit>[%°]|[^\W\d][\w^²/]*)")
_SIGNS = ("+", "-", "*", "/")
"""The signs of calculations, which the lexer recognises at every place."""
_ACTION_USAGE = "runner meets ego at j4 after 1.5 s"
_STATE_USAGE = "vehicle runner: car.compact at (1 m, 2 m) heading 90 deg speed 8 m/s { ... }"

_ABOUT_HERE = (
    (re.compile(r"\bin\s+$"), "ego in junction j4"),
    (re.compile(r"^expect\s+\w+\s+$"), "expect safe: never collision(ego)"),
    (re.compile(r"^when\s+(once\s+|every\s+|next\s+)?\w+\s+$"), "when late: ego.eta(j4) < 4 s { runner stops }"),
)
"""Patterns of the text before the place, each with an example of the statement that such a text begins."""
_THEN = re.compile(r"then\s+(?P<rest>(?!when\b)[^{}]+)$")

_OFTEN = (
    (
        re.compile(
            r"expect\s+(?:[^\W\d]\w*\s*:\s*)?(?P<place>(?!never|always|eventually)[a-z][\w.]*)\s*(?P<rest>[(.<>].*)$"
        ),
        "an expectation begins with `never`, `always` or `eventually`",
        "write " + write(r"expect never \g<place>\g<rest>") + ", for example",
    ),
    (
        re.compile(r"expect\s+.*?(?P<place>within)\s+(?P<rest>[a-z]\w*\(.*)$"),
        "`within` needs a time",
        "write " + write(r"within 60 s \g<rest>") + ", for example",
    ),
)
"""Frequent errors that the grammar notices only at a later word, each with a pattern, a message and a help."""


_OF_NETWORKS = ("network_item", "junction_item", "road_item", "roundabout_item", "ramp_item")


class Refusal:
    """One statement that the grammar refused, and the message for it.

    Attributes:
        start, end: the place inside the statement's text.
    """

    def __init__(self, error: UnexpectedInput, text: str, rule: str) -> None:
        """Explain Lark's error in a statement, whose text here has empty braces instead of its block; `rule` is the
        rule by which it was parsed, such as `actor_item`."""
        self._text = text
        self._rule = rule
        self._accepted = accepted_by(error)
        self._place = "LPAR" in self._accepted and takes_a_place(error)
        self._meant = ""
        at_end = isinstance(error, UnexpectedEOF) or (isinstance(error, UnexpectedToken) and error.token.type == "$END")
        where = None if at_end else error.pos_in_stream
        self.start = len(text) if where is None else where
        match = _WORD.match(text, self.start)
        self.word = match[0] if match else ""
        self.end = self.start + max(1, len(self.word))
        self.code, self.message, self.help = self._explain(error)

    def _explain(self, error: UnexpectedInput) -> tuple[str, str, HelpText]:
        short = len(self._text) <= REACH
        other = phrase(self._text, self._rule, self.start, self._reads) if short else None
        then = _THEN.match(self._text) if self._rule == "action" and len(self._text) <= REACH else None
        if other is None and then is not None and self._reads(then["rest"]):
            self.start, self.end = 0, len(self._text)
            help = meant_code(f"then {{ {then['rest'].strip()} }}")
            return "FS003", "the actions after `then` are written in a block", help
        if other is None:
            return self._explain_ours(error)
        self.start, self.end = other.start, other.end
        return CODE, other.message, other.help

    def _explain_ours(self, error: UnexpectedInput) -> tuple[str, str, HelpText]:
        words = words_of_terminals(self._accepted)
        short = self._rule in ("scenario_item", "action") and len(self._text) <= REACH  # slow: quadratic
        for pattern, message, help_ in _OFTEN if short else ():
            match = pattern.match(self._text)
            if match is not None:
                self.start, self.end = match.span("place")
                help = help_.expanded(match.expand)
                written = [
                    edit.text for edit in help.edits if isinstance(edit, Write) and edit.text.startswith("expect")
                ]
                if not all(map(self._reads, written)):
                    help = "write it like " + write("expect never collision(ego)")
                return "FS003", message, help
        # The `-` of `->` may have been read as a sign.
        arrow = self._text.find("->", max(0, self.start - 1), self.start + 2)
        if arrow >= 0:
            self.start, self.end = arrow, arrow + 2
            return "FS015", "unexpected `->`", meant_code("=>")
        excerpt = self.word if len(self.word) <= SHOWN else self.word[: SHOWN - 3] + "..."
        if self.word.startswith('"') and (len(self.word) == 1 or not self.word.endswith('"')):
            return "FS015", "this text is not closed", "end it with " + write('"') + " on the same line"
        unit = self._behind(_UNIT_BEFORE)
        if unit is not None and unit[1] not in UNITS and unit[1] not in keywords():
            return self._unknown_unit(unit, words)
        if self.start == 0:
            return self._unknown_statement(words, excerpt)
        return self._unexpected(error, words, excerpt)

    def _unexpected(self, error: UnexpectedInput, words: Collection[str], excerpt: str) -> tuple[str, str, HelpText]:
        usage = self._usage()
        if self._is_word() and (nearest := closest(self.word, words)) is not None and nearest != self.word:
            goes_on = self._goes_on(self._text[: self.start] + nearest, self._text[self.end :])
            help = "the correct word is " + write(nearest) + (": " + usage if usage else "")
            help = meant_word(nearest, self.word) if goes_on else help
            return "FS004", f"unknown word '{excerpt}'", help
        if (isinstance(error, UnexpectedCharacters) and not self._is_word()) or self.word in _SIGNS:
            return self._stray(excerpt, usage)
        if self._misspelt_before(error):
            return "FS004", f"unknown word '{self.word}'", meant_word(self._meant, self.word)
        return self._out_of_place(words, excerpt, usage)

    def _out_of_place(self, words: Collection[str], excerpt: str, usage: HelpText) -> tuple[str, str, HelpText]:
        if not self.word:
            return "FS003", f"the statement stops too early: expected {self._expected}", self._going_on() or usage
        if self._rule == "action" and self._is_word() and "starts" in words:
            return "FS004", f"unknown action '{excerpt}'", "write one of: " + one_of(sorted(words))
        if self._expected == END and (not usage or self.word == ","):
            help = "begin a new line, or write " + write(";") + " between them"
            return "FS003", f"unexpected `{excerpt}`: expected {END}", help
        meant = self._meant_here(words)
        if meant:
            usage = meant_code(meant)
        if "PIN" in self._accepted:
            usage = "write a pin such as " + write("sha256:5ef2c6120a41")
        return "FS003", f"unexpected `{excerpt}`: expected {self._expected}", usage

    def _meant_here(self, words: Collection[str]) -> str:
        """Return the text that makes the statement valid in the place of the unexpected word; empty if there is
        none."""
        missing = self._missing(words)
        if missing:
            return f"{missing} {self._whole_quantity()}"
        light = "amber" if self.word in ("yellow", "orange") and "amber" in words else ""
        if light:
            return light
        others = [word for word in words if self._reads(f"{self._text[: self.start]}{word}{self._text[self.end :]}")]
        if self.word in keywords() and len(others) == 1:
            return others[0]
        if "LSQB" in self._accepted and self._is_word():
            listed = re.match(r"\w+(?:\s*,\s*\w+)*", self._text[self.start :])
            if listed is not None and self._reads(f"{self._text[: self.start]}[{listed[0]}]"):
                self.end = self.start + listed.end()
                return f"[{listed[0]}]"
        for value in self._missing_values():
            if self._reads(f"{self._text[: self.start]}{value}{self._text[self.start :]}"):
                return f"{value.lstrip()}{self._whole_quantity()}"
        return ""

    def _whole_quantity(self) -> str:
        """Return the unexpected word, with its unit if it is a number; the place then includes the unit."""
        match = _QUANTITY.match(self._text, self.start)
        if match is None or match["unit"] not in UNITS:
            return self.word
        self.end = match.end()
        return match[0]

    def _missing_values(self) -> Iterable[str]:
        """Yield values that may be missing before the place, each with the sign before it (`, 0 m`, ` < 3 s`)."""
        if "COMMA" in self._accepted and "(" in self._text[: self.start]:
            yield from (", 0 m", ", ego")
        measured = self._behind(_MEASURED)
        if "COMPARE" in self._accepted and measured is not None and measured[1] in m.MEASURED:
            yield f" < {EXAMPLES[m.MEASURED[measured[1]]]} "

    def _going_on(self) -> HelpText:
        """Return a help that completes a statement that ends too early: with a bracket, or with the rest of its
        example; else an empty text."""
        closing = next((sign for sign in ")]" if self._reads(f"{self._text.rstrip()}{sign}")), "")
        if closing:
            return "close it with " + write(closing)
        example = re.sub(r"\s*\{.*", "", self._example())
        for match in re.finditer(r"(?<=\s)\S", example):
            tail = example[match.start() :]
            if tail.split()[0] in words_of_terminals(self._accepted) and self._reads(f"{self._text.rstrip()} {tail}"):
                return go_on(tail) + ": " + self._usage()
        return ""

    def _missing(self, words: Collection[str]) -> str:
        """Return the only sign or word that, inserted before the place, makes the statement valid; else an empty
        text."""
        signs = [sign for name in self._accepted if (sign := text_of(name)) and not sign[0].isalpha()]
        candidates = [
            sign
            for sign in (*sorted(set(signs) - {"{", "}", ";", "(", "[", "]", "-"}), *words)
            if self._reads(f"{self._text[: self.start]}{sign} {self._text[self.start :]}") and self._measures(sign)
        ]
        if len(candidates) > 1:  # take the word of the example: `ego in junction j4`, not `in lane j4`
            candidates = [word for word in candidates if word in self._example().split()]
        return candidates[0] if len(candidates) == 1 else ""

    def _measures(self, word: str) -> bool:
        """Return whether a word takes the quantity at the place: `speed` does not take metres."""
        match = _QUANTITY.match(self._text, self.start)
        unit = UNITS.get(match["unit"]) if match is not None else None
        return unit is None or unit.dimension in dimensions_behind().get(word, (unit.dimension,))

    def _goes_on(self, text: str, behind: str) -> bool:
        """Return whether the statement is valid with this text before the rest, or has its next error further on."""
        try:
            parse_tree(text + behind, self._rule)
        except UnexpectedEOF:
            return False
        except UnexpectedInput as error:
            return (error.pos_in_stream or 0) > len(text) + 1
        return True

    def _reads(self, text: str) -> bool:
        """Return whether a text is a valid statement."""
        if len(text) > REACH:
            return False
        try:
            parse_tree(text, self._rule)
        except UnexpectedInput:
            return False
        return True

    def _behind(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        """Return a pattern's match right before the place."""
        return pattern.search(self._text, max(0, self.start - REACH), self.start)

    def _misspelt_before(self, error: UnexpectedInput) -> bool:
        """Return whether the word before the place, which the grammar took for a name, is a misspelt keyword, as in
        `expect nevr collision(ego)`."""
        before = self._behind(_WORD_BEFORE)
        if before is None or isinstance(error, UnexpectedEOF):
            return False
        if before.start() == 0 and (self._rule != "action" or (self._is_word() and self.word != "when")):
            return False  # the word is most likely the name of an actor
        state: Any = parser().parse_interactive(self._text[: before.start()], start=self._rule)
        try:
            state.exhaust_lexer()
        except UnexpectedInput:
            return False
        words = words_of_terminals(next_terminals(state))
        meant = closest(before[1], words)
        if meant is None or before[1] in words:
            return False
        self.word, self._meant = before[1], meant
        self.start, self.end = before.span(1)
        return True

    def _unknown_unit(self, unit: re.Match[str], words: Collection[str]) -> tuple[str, str, HelpText]:
        """Return the message for a word that the grammar took for a unit: `50 kmh`, or `start at 20 alng west`."""
        self.start, self.end = unit.span(1)
        nearest = closest(unit[1], [*UNITS, *words])
        if nearest is not None and nearest not in UNITS:
            return "FS004", f"unknown word '{unit[1]}'", meant_word(nearest, unit[1])
        return "FS005", f"unknown unit '{unit[1]}'", meant_word(nearest, unit[1]) if nearest else self._usage()

    def _unknown_statement(self, words: Collection[str], excerpt: str) -> tuple[str, str, HelpText]:
        place = PLACES.get(self._rule, "a file")
        if self._rule in _OF_NETWORKS and (why := unsupported(self.word)):
            return "FS271", f"'{excerpt}' is not supported", why
        ours = meanings("road_setting").get(self.word) if self._rule in _OF_NETWORKS else None
        places = homes().get(self.word, ()) if ours is None else ()
        if places and self.word not in words and self._rule == "extension_item" and PLACES["scenario_item"] in places:
            help = "put " + write("add") + " or " + write("change") + f" in front of it: `add {self.word} ...`"
            return "FS008", f"'{excerpt}' needs `add` or `change` in {place}", help
        meant = ours or (closest(self.word, words) if self._is_word() else None)
        if places and self.word not in words and (meant is None or meant.rstrip("s") != self.word):
            help = move_inside("it belongs in " + one_of(places, " or ").text)
            return "FS008", f"'{excerpt}' is not allowed in {place}", help
        if meant is not None:
            return "FS004", f"unknown statement '{excerpt}'", meant_word(meant, self.word)
        if self._is_word() and words:
            return "FS004", f"unknown statement '{excerpt}'", f"in {place} you can write: " + one_of(sorted(words))
        return "FS003", f"unexpected `{excerpt}` in {place}", self._usage()

    def _stray(self, excerpt: str, usage: HelpText) -> tuple[str, str, HelpText]:
        if self.word == "'" and (closed := self._text.find("'", self.start + 1)) > 0:
            written = self._text[self.start : closed + 1]
            self.end = closed + 1
            return "FS015", "a text needs double quotes", meant_code(f'"{written[1:-1]}"')
        if self.word == "'":
            return "FS015", "unexpected `'`", "write a text in double quotes: " + write('"like this"')
        parts = _HYPHENED.search(self._text[: self.start + SHOWN], max(0, self.start - SHOWN))
        if self.word == "-" and parts is not None and parts.start() < self.start < parts.end():
            self.start, self.end = parts.span()
            written = parts[0]
            return "FS015", f"unexpected `-` in `{written}`", meant_code(written.replace("-", "_"))
        if self.word == "-":
            return "FS015", "unexpected `-`", "write names with underscores: " + write("red_light")
        if self.word.isprintable():
            return "FS015", f"unexpected character `{excerpt}`: expected {self._expected}", usage
        return "FS015", f"unexpected character U+{ord(self.word[0]):04X}", remove("remove it")

    @property
    def _expected(self) -> str:
        return expected(self._accepted, self._text, self.start, place=self._place)

    def _is_word(self) -> bool:
        return bool(self.word) and (self.word[0].isalpha() or self.word[0] == "_")

    def _usage(self) -> HelpText:
        example = self._example()
        return "write it like " + write(example) if example else ""

    def _example(self) -> str:
        """Return an example of the wrong statement or part."""
        first = re.match(r"[^\W\d]\w*", self._text)
        word = first[0] if first is not None else ""
        if self._rule == "traffic_item" and word == "models":
            return "models [car.compact, van.delivery]"
        if self._rule == "network_item" and word == "lane":
            return (
                "lane 3 of west ends at 120 m" if re.search(r"\bends?\b", self._text) else "lane 2 of west goes [left]"
            )
        if self._rule in ("scenario_item", "clip_item") and re.search(r":\s*[\w.]+\s+at\b", self._text):
            return _STATE_USAGE
        setting = KEYWORDS[word].example if word in KEYWORDS and KEYWORDS[word].group == "setting" else ""
        usual = USAGE.get(word, "gap = 1.2 s" if self._rule == "assignment" else setting)
        if self._rule == "action" and word not in ("wait", "then"):
            verb = re.match(r"[^\W\d]\w*\s+([^\W\d]\w*)", self._text)
            usual = _usages().get(verb[1], _ACTION_USAGE) if verb is not None else _ACTION_USAGE
        return next((example for before, example in _ABOUT_HERE if before.search(self._text, 0, self.start)), usual)


@cache
def _usages() -> Mapping[str, str]:
    """Return an example of each action, by its verb: the first example in its class's docstring."""
    examples: dict[str, str] = {}
    for kind in m.ITEMS:
        verb = re.match(r"\{actor\} (\w+)", kind.pattern)
        example = re.match(r"`([^`]+)`", kind.__doc__ or "")
        if verb is not None and example is not None and not issubclass(kind, m.Phrase):
            examples.setdefault(verb[1], " ".join(example[1].split()))
    return examples
