"""A table of phrases that newcomers write in their own words, with the form of this language.

Phrases are searched only in statements that the grammar refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from foresee_dsl.helps import HelpText, expanded, leave_out, meant_code, remove, write
from foresee_dsl.language.syntax.foreign_words import TOP, Foreign

_VALUE = r"(?P<v>-?[0-9][^{}]*?)"


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


def _phrases(rules: tuple[str, ...], *phrases: tuple[str, str, HelpText]) -> Iterator[Phrase]:
    """Yield the phrases of some rules, each given by its pattern, message and help."""
    for pattern, message, help in phrases:
        yield Phrase(rules, re.compile(pattern), message, help)


_ACTOR, _ACTION = ("actor_item",), ("action",)
_END = r"\s*(?:\{\})?$"

PHRASES = (
    # conditions
    *_phrases(
        (*TOP, "action"),
        (
            r"(?P<place>\bdistance\s+(?:between|from|of)\s+(?P<a>[a-z]\w*)\s+(?:and|to)\s+(?P<b>[a-z]\w*))",
            r"`\g<place>`: write the two actors in brackets",
            meant_code(r"distance(\g<a>, \g<b>)"),
        ),
    ),
    *_phrases(
        TOP,
        (
            r"^(?:when|expect|if)\b.*?(?P<place>\b(?P<a>[a-z]\w*)\s+(?P<verb>reaches|enters|arrives\s+(?:at|in)|is\s+at)"
            r"\s+(?P<j>[a-z]\w*))",
            "no condition tests for reaching a junction, only for being in it",
            meant_code(r"\g<a> in junction \g<j>"),
        ),
        (
            r"^(?:when|expect|if)\b.*?\btime\s*(?P<place>==?|is)\s*-?[0-9a-z]",
            r"`\g<place>`: compare a moment with `>=`",
            meant_code(">="),
        ),
        (
            r"^(?:when|if)\b.*?[\w)]\s*(?P<place>(?<![<>=!:])=(?![=>]))\s*-?[0-9]",
            "`=` is not a comparison",
            "compare numbers with " + write("<") + ", " + write("<=") + ", " + write(">") + " or " + write(">="),
        ),
        (
            r"^(?:when|expect|if)\b.*?(?P<place>\b(?P<a>[a-z]\w*)\s+(?:is\s+)?(?:near|close\s+to)\s+(?P<b>[a-z]\w*))",
            "write how near the actor must be as a length",
            meant_code(r"\g<a> within 10 m of \g<b>"),
        ),
        (
            r"^(?:when|if)\b.*?(?P<place>\bthen|\bdo)\s*\{\}$",
            "write the block right behind the condition",
            leave_out(r"\g<place>") + ": " + write("when ego.eta(j4) < 4 s { runner stops }"),
        ),
    ),
    # actions
    *_phrases(
        _ACTION,
        (
            rf"^(?P<a>[a-z]\w*)\s+starts\s+(?P<place>(?:after|in|at)\s+{_VALUE}){_END}",
            "`starts` takes no time: an actor starts at once, or after its `delay`",
            "write "
            + write(r"delay \g<v>")
            + r" in the block of \g<a>; or write here "
            + write(r"wait \g<v>")
            + ", and "
            + write(r"then { \g<a> starts }")
            + " below it",
        ),
        (
            r"^[a-z]\w*\s+(?P<place>brakes\s+(?:with|by|at))\s+[0-9]",
            "write the deceleration right behind the verb",
            meant_code("brakes"),
        ),
        (
            rf"^(?:set\s+)?(?P<a>[a-z]\w*)\.speed\s*(?:=|to\b|:=)\s*{_VALUE}{_END}",
            "a trigger changes a speed with an action",
            meant_code(r"\g<a> changes speed to \g<v>"),
        ),
        (
            r"^(?P<a>[a-z]\w*)\s+(?P<verb>accelerates|decelerates|slows(?:\s+down)?|speeds\s+up|drives|goes|moves|runs)"
            rf"\s+(?:to|at|with)\s+{_VALUE}{_END}",
            "a change of speed is written with `changes speed`",
            meant_code(r"\g<a> changes speed to \g<v>"),
        ),
        (
            rf"^(?P<a>[a-z]\w*)\s+brakes?(?:\s+(?:hard|fully|suddenly))?{_END}",
            "`brakes` needs a deceleration",
            meant_code(r"\g<a> brakes 6 m/s^2"),
        ),
        (
            r"^(?P<a>[a-z]\w*)\s+(?P<place>overtakes?|passes)\b",
            r"`\g<place>` is not an action: overtaking is a change of lane and of speed",
            "write "
            + write(r"\g<a> changes lane left")
            + " and "
            + write(r"\g<a> changes speed to 60 km/h")
            + ", with later steps in `then { ... }`",
        ),
        (
            rf"^(?P<a>[a-z]\w*)\s+(?:changes|moves|merges|cuts\s+in)\s+(?:to\s+)?(?:the\s+)?(?P<s>left|right)(?:\s+lane)?{_END}",
            "a change of lane is written with `lane` and a side",
            meant_code(r"\g<a> changes lane \g<s>"),
        ),
        (
            r"^(?P<a>[a-z]\w*)\s+(?:runs|ignores|jumps|crosses)\s+(?:the\s+|a\s+)?(?:red|lights?|signal|traffic).*$",
            "write an actor that runs a red light as one that ignores signals",
            meant_code(r"\g<a> ignores signals"),
        ),
        (
            r"^[a-z]\w*\s+(?P<place>ignores\s+(?:the\s+)?(?:right\s+of\s+way|rules?|yield\w*))",
            "an actor ignores `priority` or `signals`",
            meant_code("ignores priority"),
        ),
        (
            rf"^(?P<a>[a-z]\w*)\s+(?P<place>waits)(?:\s+(?:for\s+)?{_VALUE})?{_END}",
            "`waits` is not an action",
            meant_code("stops"),
        ),
        (
            r"^(?P<a>[a-z]\w*)\s+(?P<place>crosses|turns\s+(?:left|right))\b",
            r"`\g<place>` is not an action: the route or path of an actor is in its block",
            "write its " + write("route") + " or " + write("path") + " there; " + write(r"\g<a> starts") + " starts it",
        ),
        (
            r"^(?P<a>[a-z]\w*)\s+(?P<place>yields|gives\s+way)\b",
            r"`\g<place>` is not an action: the network's rules decide which actor gives way",
            remove("leave it out") + ", or write " + write(r"\g<a> stops for 3 s"),
        ),
    ),
    # the block of an actor
    *_phrases(
        _ACTOR,
        (
            rf"^(?:speed\s+start|initial_?speed|initialSpeed|start_?speed|initial\s+speed|velocity)\s*[:=]?\s*{_VALUE}{_END}",
            "write the speed at the beginning with two words",
            meant_code(r"start speed \g<v>"),
        ),
        (
            r"^(?P<place>(?P<what>start\s+(?:at|speed)|route|path|speed|goal|delay)\s*:)",
            r"`\g<what>` takes no `:`",
            meant_code(r"\g<what>"),
        ),
        (
            r"^(?P<place>(?:position|pos|location|spawn(?:\s+at)?|starts\s+at)\s*[:=]?)\s*\S",
            r"write the place at the beginning with two words",
            meant_code("start at"),
        ),
        (
            r"^start\s+at\b.*?\b(?P<place>(?:(?:on|in)\s+)?(?:the\s+)?(?:(?:left|right|middle)\s+)?lane(?:\s+\w+)?)\s*$",
            "a place names no lane, but its distance to the left of the road or route",
            "write " + write("offset 3.3 m") + " for a lane farther left",
        ),
        (
            r"^(?P<place>destination|target|finish|end)\s*[:=]?\s*\S",
            "the place where the ego's route ends is its `goal`",
            meant_code("goal"),
        ),
        (
            r"^(?P<place>trajectory|waypoints|line)\s*[:=]?\s*\[",
            r"a line that an actor follows is its `path`",
            meant_code("path"),
        ),
        (
            rf"^start\s+(?:at\s+|on\s+|in\s+|from\s+)?(?P<r>(?!at\b|speed\b|beside\b|the\b|on\b)[a-z]\w*){_END}",
            "a place on a road needs a length along it",
            meant_code(r"start at 10 m along \g<r>"),
        ),
        (
            r"^(?:start\s+at|goal)\s+-?[0-9.]+\s*[a-z]+\s+(?P<place>on|of|in|from|into|down)\s+[a-z][\w.]*",
            r"`\g<place>`: a length is measured along a road or a route",
            meant_code("along"),
        ),
        (
            r"^route\s+from\s+(?P<a>[a-z]\w*)\s+(?P<place>(?:to|->)\s+(?P<b>[a-z]\w*))",
            "a route names its turns, not its end",
            "write a turn at each junction, such as " + write(r"route from \g<a> straight over JUNCTION"),
        ),
        (
            r"^route\s+(?P<place>(?!from\b)(?P<a>[a-z]\w*)(?:\s+[a-z]\w*)*)" + _END,
            "write a route as a road and its turns, or as edges in brackets",
            "write a turn at each junction: "
            + write(r"route from \g<a> straight over j4")
            + "; or its edges: "
            + write(r"route [\g<a>, ...]"),
        ),
        (
            r"^route\b.*?(?P<place>\b(?:turns?\s+)?(?P<t>left|right|straight|back)\s+(?:at|on|in)\s+(?P<j>[a-z]\w*))",
            r"`\g<place>`: write a turn with `over` and its junction",
            meant_code(r"\g<t> over \g<j>"),
        ),
        (
            rf"^path\s+(?P<place>[(0-9-][^\[\]{{}}]*,[^\[\]{{}}]*?){_END}",
            "a path is a list of places in brackets",
            meant_code(r"[\g<place>]"),
        ),
        (
            r"^path\s+along\s+(?P<place>(?P<a>[a-z]\w*))\s+from\b",
            r"a path along a route names the actor's route",
            meant_code(r"\g<a>.route"),
        ),
        (
            r"^(?P<place>crosses|walks|moves|goes)\b",
            r"`\g<place>`: this block describes how the actor begins; its path tells where it goes",
            "write it like "
            + write("path [30 m along ego.route offset -5 m, 30 m along ego.route offset 5 m]")
            + ", across the ego's route; "
            + write("NAME starts")
            + " in a trigger starts it",
        ),
    ),
    # the scenario
    *_phrases(
        TOP,
        (
            rf"^(?:duration|timeout|time_limit|max_time|stop\s+after|run\s+for|end\s+at)\s*[:=]?\s*{_VALUE}{_END}",
            "write the longest duration of a run with two words",
            meant_code(r"end after \g<v>"),
        ),
        (
            r"^(?:vehicle|bicycle|pedestrian|obstacle)\s+[a-z]\w*\s*(?P<place>=)\s*[a-z]\w*\.[a-z]\w*",
            "write the model of an actor behind `:`",
            meant_code(":"),
        ),
        (
            r"\bin\s+(?P<place>\[(?P<r>[^\[\],]+\.\.[^\[\],]+)\])",
            "write a range without brackets",
            meant_code(r"\g<r>"),
        ),
        (
            r"^param\b.*?(?P<place>\b(?:between|from)\s+(?P<a>-?[0-9][^{}]*?)\s+(?:and|to)"
            r"\s+(?P<b>-?[0-9][^{}\s]*(?:\s+[a-z/^0-9]+)?))\s*$",
            "a range is written with `in` and two dots",
            meant_code(r"in \g<a>..\g<b>"),
        ),
        (
            r"^(?P<place>case\s+(?P<n>[a-z]\w*)\s*[:=]\s*(?P<v>[a-z]\w*\s*=\s*[^,{}]+?))" + _END,
            "write the values of a case in braces",
            meant_code(r"case \g<n> { \g<v> }"),
        ),
    ),
    # values
    *_phrases(
        (),
        (
            r"(?P<place>\b(?:kilomet(?:er|re)s?|km)\s+(?:per|an)\s+(?:hour|h)\b)",
            r"unknown unit '\g<place>'",
            meant_code("km/h"),
        ),
        (
            r"(?P<place>\b(?:met(?:er|re)s?|m)\s+(?:per|a)\s+(?:second|sec|s)\b)",
            r"unknown unit '\g<place>'",
            meant_code("m/s"),
        ),
        (
            r"(?P<place>\bmiles?\s+(?:per|an)\s+hour\b)",
            r"unknown unit '\g<place>'",
            meant_code("mph"),
        ),
        (
            r"^[^(\[]*?(?P<place>(?<![\w.])(?P<whole>[0-9]+),(?P<part>[0-9]+))\s*[a-z]",
            r"`\g<place>`: write the decimals of a number behind a dot",
            meant_code(r"\g<whole>.\g<part>"),
        ),
    ),
)
"""All phrases, in the order in which they are tried."""


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
    return next((message for known_phrase in PHRASES if (message := known_phrase.find(text, rule)) is not None), None)


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
