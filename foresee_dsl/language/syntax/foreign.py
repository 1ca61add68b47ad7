"""Recognises statements with words and signs of other languages, and says how this language writes them.

The other languages are programming languages, Scenic, and ASAM OpenSCENARIO XML and DSL. Only statements that the
grammar refused are examined.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from foresee_dsl.helps import as_comment, as_trigger, meant_code, write
from foresee_dsl.language.messages.suggest import closest
from foresee_dsl.language.syntax.foreign_signs import inside, sign
from foresee_dsl.language.syntax.foreign_words import ACTORS, HELPS, OPENSCENARIO, OURS, SCENIC_CLASSES, TOP, Foreign
from foresee_dsl.language.units import UNITS

_PARAM = re.compile(
    r"(?P<all>(?:var|let|const|val|float|double|int|auto|set|define)\s+(?P<name>[^\W\d]\w*)\s*=\s*"
    r"(?P<value>-?[0-9.]+\s*(?P<unit>[^\W\d][\w/^]*)?))\s*$"
)
_SPAWN = re.compile(r"(?:spawn|create|new|place|add)\s+(?P<kind>vehicle|bicycle|pedestrian|obstacle|ego)\b")
_SCENIC = re.compile(
    r"(?:(?P<name>[^\W\d]\w*)\s*=\s*)?(?:new\s+)?(?P<kind>Car|Truck|Bus|Pedestrian|Bicycle|Object|Prop|NPCCar)\b"
)
_ALWAYS = re.compile(r"require\s+(?P<how>always|never|eventually)\b")
_WAIT = re.compile(r"wait\s+(?:until|for)\b")
_ASSIGNED = re.compile(
    r"(?P<what>end|weather|speed|start(?:\s+speed)?|goal|delay|line|timing)\s*(?P<sign>:?=)\s*(?P<rest>[^=].*?)\s*$"
)
_ACTION = re.compile(r"(?P<action>starts|stops|changes|turns|waits|brakes|accelerates|follows|drives)\b")
_OTHER_ACTIONS: Mapping[str, str] = MappingProxyType(
    {
        "halts": "stops",
        "go": "starts",
        "goes": "starts",
        "walks": "starts",
        "drives": "starts",
        "moves": "starts",
    }
)
_VERBS = ("starts", "stops", "leaves")
"""Actions that need only their actor."""
_TURNS = re.compile(r"(?P<name>[^\W\d]\w*)\s+turns\s+(?P<colour>(?:to\s+)?(?:red|green|amber|yellow))\b")


def foreign(text: str, rule: str, at: int) -> Foreign | None:
    """Return the message for a statement with words or signs of another language, or None; `at` is where the grammar
    refused it."""
    word = re.match(r"[^\W\d]\w*", text)
    return (_statement(text, rule, word[0]) if word is not None else None) or sign(text, at) or inside(text, rule, at)


def _statement(text: str, rule: str, word: str) -> Foreign | None:
    """Return the message for a statement that its first words identify as one of another language, or None."""
    if rule == "action":
        return _action(text, word)
    plain = text.removesuffix(" {}")
    top = None
    if rule in TOP:
        top = (
            _variable(plain) or _at_once(plain) or _spawned(text) or _scenic(text) or _kind(word) or _of_weather(plain)
        )
    if rule == "network_item" and (road := _road(plain)) is not None:
        return road
    return top or _expectation(text) or (_assigned(plain) if rule != "assignment" else None) or _first(text, rule, word)


_UNTYPED = re.compile(r"param\s+(?P<name>[a-z]\w*)(?=\s*=\s*-?(?P<value>[0-9.]+)\s*(?P<unit>[^\W\d][\w/^]*)?)")
_ROAD_ENDS = re.compile(r"road\s+(?P<name>\w+)\s+(?:from\s+)?(?P<one>\w+)\s*(?:->|=>|to\b|-)\s*(?P<other>\w+)")


def _road(text: str) -> Foreign | None:
    """Return the message for a road whose ends are not written with `from` and `to`, or None."""
    match = _ROAD_ENDS.match(text)
    if match is None or re.match(r"road\s+\w+\s+from\s+\w+\s+to\b", text):
        return None
    help = meant_code(f"road {match['name']} from {match['one']} to {match['other']}")
    return Foreign(0, match.end(), f"`{match[0]}`: write the ends of a road behind `from` and `to`", help)


def _variable(text: str) -> Foreign | None:
    untyped = _UNTYPED.match(text)
    if untyped is not None:
        declared = UNITS.get(untyped["unit"] or "")
        help = meant_code(f"{untyped[0]}: {declared.dimension if declared is not None else 'ratio'}")
        return Foreign(0, untyped.end(), f"`{untyped[0]}`: a parameter needs a type", help)
    match = _PARAM.match(text)
    if match is None:
        return None
    unit = UNITS.get(match["unit"] or "")
    param = f"param {match['name']}: {unit.dimension if unit is not None else 'ratio'} = {match['value'].strip()}"
    message = f"`{match['all']}`: write a value with a name as a parameter"
    return Foreign(0, len(match["all"]), message, meant_code(param))


def _expectation(text: str) -> Foreign | None:
    match = _ALWAYS.match(text)
    if match is None:
        return None
    message = f"`{match[0]}`: a condition that is to hold in the run is an expectation"
    return Foreign(0, match.end(), message, meant_code(f"expect {match['how']}"))


def _spawned(text: str) -> Foreign | None:
    match = _SPAWN.match(text)
    if match is None:
        return None
    message = f"`{match[0]}`: an actor is declared without such a word, and exists from the beginning"
    return Foreign(0, match.end(), message, meant_code(match["kind"]))


def _scenic(text: str) -> Foreign | None:
    match = _SCENIC.match(text)
    if match is None:
        return None
    kind, model = SCENIC_CLASSES.get(match["kind"], ("vehicle", "car.sedan"))
    name = "ego" if match["name"] == "ego" else f"{kind} {match['name'] or 'other'}"
    named = re.match(r"\s+([a-z]\w*)\s*(?:\{\})?$", text[match.end("kind") :])
    if named is not None and not match["name"]:
        help = meant_code(f"{kind} {named[1]}: {model}")
        end = match.end("kind") + named.end(1)
        written = text[match.start("kind") : end]
        return Foreign(match.start("kind"), end, f"`{written}`: this is a class of Scenic", help)
    help = "write an actor as a block: " + write(f"{name}: {model} {{ start at 20 m along ego.route }}")
    return Foreign(match.start("kind"), match.end("kind"), f"`{match['kind']}` is a class of Scenic", help)


def _kind(word: str) -> Foreign | None:
    kind = ACTORS.get(word.lower())
    if kind is None:
        return None
    message = f"`{word}` is not a kind of actor"
    return Foreign(0, len(word), message, meant_code(kind))


def _of_weather(text: str) -> Foreign | None:
    """Return the message for a statement about the weather without `weather`, or None."""
    match = re.match(r"(?P<word>rain|fog|wetness|sun)\b\s*=?\s*(?P<number>[0-9][0-9.]*)?", text)
    if match is None:
        return None
    help = meant_code(f"weather {match['word']} {match['number'] or '0.5'}")
    message = f"`{match['word']}` is a part of `weather`, with a number from 0 to 1"
    return Foreign(0, len(text), message, help)


_TOLD = re.compile(r"[a-z]\w*\s+(?:changes|follows|keeps|leads|leaves|matches|reverses|starts|stops|turns)\b[^{}]*$")


def _at_once(text: str) -> Foreign | None:
    """Return the message for an action outside a trigger, or None."""
    if _TOLD.match(text) is None:
        return None
    action = text.strip()
    return Foreign(0, len(text), "an action belongs in a trigger", meant_code(f"when time >= 0 s {{ {action} }}"))


def _assigned(text: str) -> Foreign | None:
    match = _ASSIGNED.match(text)
    if match is None:
        return None
    what = {"end": "end after", "start": "start speed"}.get(match["what"], match["what"])
    message = f"`{match[0]}`: this statement takes no `{match['sign']}`"
    return Foreign(0, len(match[0]), message, meant_code(f"{what} {match['rest']}"))


def _first(text: str, rule: str, word: str) -> Foreign | None:
    ours, help = OURS.get(word, ""), HELPS.get(word, "")
    message = f"`{word}` is a word of other languages"
    if word in OPENSCENARIO:
        message, help, ours = f"`{word}` is a word of OpenSCENARIO's files", OPENSCENARIO[word], ""
    elif rule == "actor_item" and _ACTION.match(text) is not None:
        help = as_trigger("write it in a trigger") + " of the scenario: " + write("when time >= 0 s { lead stops }")
        message = f"`{word}` is an action, but this block describes how the actor begins"
    elif ours and rule in TOP:
        help = meant_code(ours)
    elif ours or rule not in (*TOP, "actor_item", "junction_item"):
        help = ""
    return Foreign(0, len(word), message, help) if help else None


def _action(text: str, word: str) -> Foreign | None:
    if (match := _WAIT.match(text)) is not None and not text[match.end() :].strip()[:1].isdigit():
        message = f"`{match[0]}`: `wait` takes a time; to wait for a condition, write a block"
        block = write("then when ego.speed < 3 m/s { lead stops }")
        return Foreign(0, match.end(), message, "write `then when CONDITION { ... }`, such as " + block)
    if (match := _TURNS.match(text)) is not None:
        turns = f"{match['name']} turns to ns_go"
        which = "name the stage, and behind it a colour if needed: " + write(turns) + " or " + write(f"{turns} amber")
        message = "a signal shows several lights at once, so an action sets it to one of its stages"
        return Foreign(match.start("colour"), match.end("colour"), message, which)
    if word == "when" or OURS.get(word) == "when":
        remark = f"`{word}` is a word of other languages"
        remark = "`when` begins a trigger, but this is already inside one" if word == "when" else remark
        return Foreign(0, len(word), remark, meant_code("then when"))
    help = HELPS.get(word, "")
    if help and not re.match(r"\w+\s+(?:starts|stops|changes|meets|ignores)\b", text):
        return Foreign(0, len(word), f"`{word}` is a word of other languages", help)
    return _action_order(text) or _other_verb(text)


def _other_verb(text: str) -> Foreign | None:
    second = re.match(r"\w+\s+(?P<verb>[^\W\d]\w*)", text)
    if second is None or second["verb"] not in _OTHER_ACTIONS:
        return None
    verb = second["verb"]
    help = meant_code(_OTHER_ACTIONS[verb])
    return Foreign(second.start("verb"), second.end("verb"), f"`{verb}` is not an action", help)


_CALLED = re.compile(r"(?P<who>[a-z]\w*)\.(?P<verb>[a-z]+)\w*\s*\([^()]*\)")
_VERB_FIRST = re.compile(r"(?P<verb>start|stop|leave)s?\s+(?P<who>[a-z]\w*)$")
_DOOR = re.compile(r"(?P<who>[a-z]\w*)\s+(?P<verb>opens|closes)\s+(?:(?:the|its)\s+)?(?:left\s+|right\s+)?doors?$")


def _action_order(text: str) -> Foreign | None:
    """Return the message for an action with another order of words, or None: `child.start()`, `start child`, `van
    opens door`."""
    door = _DOOR.match(text)
    if door is not None:
        help = meant_code(f"door of {door['who']} {door['verb']}")
        return Foreign(0, door.end(), f"`{door[0]}`: name the door first, then what it does", help)
    match = _CALLED.match(text) or _VERB_FIRST.match(text)
    verb = closest(match["verb"], _VERBS) if match is not None else None
    if match is None or verb is None:
        return None
    message = f"`{match[0]}`: write the actor first, then what it does"
    return Foreign(0, match.end(), message, meant_code(f"{match['who']} {verb}"))


_COMMENT = re.compile(r'"[^"\n]*"?|#[^\n]*|(?P<line>//[^\n]*)|(?P<block>/\*(?:.|\n)*?(?:\*/|\Z))')


def block_of(word: str) -> str | None:
    """Return the rule for the statements in the braces behind a word of another language.

    It is "" if they cannot be read, and None for an unknown word.
    """
    if word in OPENSCENARIO:
        return ""
    if word.lower() in ACTORS:
        return "actor_item"
    return "action" if word in OURS or word in HELPS else None


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
