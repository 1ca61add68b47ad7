"""Words and signs of other languages: what is written here instead.

Programming languages, Scenic, ASAM OpenSCENARIO XML and DSL. Only statements that the grammar refused come here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from types import MappingProxyType

from foresee_dsl.language.units import UNITS

CODE = "FS065"


@dataclass(frozen=True, slots=True)
class Foreign:
    """What is said: the part of the statement at fault, the message and the help."""

    start: int
    end: int
    message: str
    help: str


_TOP = ("scenario_item", "extension_item", "clip_item")
_PARAM = re.compile(
    r"(?P<all>(?:var|let|const|val|float|double|int|auto|set|define)\s+(?P<name>[^\W\d]\w*)\s*=\s*"
    r"(?P<value>-?[0-9.]+\s*(?P<unit>[^\W\d][\w/^]*)?))\s*$"
)
_SIGNS = (
    ("==", "is", r"\w\)?\s*==", "`==` is written `is`"),
    ("&&", "and", r"&&", "`&&` is written `and`"),
    ("||", "or", r"\|\|", "`||` is written `or`"),
    ("!", "not ", r"!(?!=)", "`!` is written `not`"),
)
"""Signs that have a word here: the sign, the word, where it counts, the message."""

_FIRST: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        # first word: what takes its place ("" for nothing of one word), and a help where nothing does
        "assert": ("expect always", ""),
        "ensure": ("expect always", ""),
        "guarantee": ("expect always", ""),
        "if": ("when", ""),
        "while": ("when", ""),
        "whenever": ("when every", ""),
        "upon": ("when", ""),
        "on": ("when", ""),
        "until": ("when", ""),
        "keep": ("require", ""),
        "constraint": ("require", ""),
        "import": ("use network", ""),
        "include": ("use network", ""),
        "else": ("", "there is no `else`: write a second trigger, `when not ... { ... }`"),
        "elif": ("", "there is no `elif`: write a second trigger, `when ... { ... }`"),
        "for": (
            "",
            "nothing is repeated by a loop: `when every ... { ... }` fires again, `cases 20 from seed 7` draws cases",
        ),
        "foreach": ("", "nothing is repeated by a loop: `cases 20 from seed 7` draws test cases"),
        "repeat": ("", "nothing is repeated by a loop: a trigger `when every ... { ... }` fires again"),
        "loop": ("", "nothing is repeated by a loop: a trigger `when every ... { ... }` fires again"),
        "var": ("", "a parameter is written with its type: `param gap: time = 1.5 s`"),
        "let": ("", "a parameter is written with its type: `param gap: time = 1.5 s`"),
        "const": ("", "a parameter is written with its type: `param gap: time = 1.5 s`"),
        "def": ("", "nothing is defined by a function: a value is a `param`, what happens is a `when`"),
        "function": ("", "nothing is defined by a function: a value is a `param`, what happens is a `when`"),
        "print": ("", "what a run shows is in its report; leave this out"),
        "return": ("", "a scenario returns nothing: leave this out"),
        "do": ("", "actions begin together; for one after the other write `then { ... }`"),
        "serial": ("", "actions begin together; for one after the other write `then { ... }`"),
        "parallel": ("", "actions of one block begin together: leave this out"),
        "one_of": ("", "a parameter with options and `as choice(3, 1)` draws one of several"),
        "behavior": ("", "what an actor does is written in triggers: `when time >= 0 s { lead stops }`"),
        "with": ("", "in an actor's block each property is a line: `start speed 40 km/h`, `delay 0.5 s`"),
        "take": ("", "an action begins with its actor: `lead stops`"),
        "terminate": ("", "a run ends by `end after 20 s`, and when the ego arrives or fails"),
        "record": ("", "everything is recorded: leave this out"),
        "simulator": ("", "the simulator is SUMO: leave this out"),
        "cover": ("", "`foresee sample` shows what the cases reach: leave this out"),
        "emit": (
            "",
            "triggers are not told of events: write what they wait for, `when distance(ego, lead) < 20 m { ... }`",
        ),
        "try": ("", "a trigger says what happens when: `when ego within 10 m of lead { lead stops }`"),
        "interrupt": ("", "a trigger says what happens when: `when ego within 10 m of lead { lead stops }`"),
        "zebra": ("", "people cross where the junction has `crossings`"),
        "class": ("", "models have sizes and abilities in a file `models NAME { ... }`"),
        "yield": ("", "who gives way is the network's: `ignores priority` and `meets` are what actors do"),
    }
)
_A_TRIGGER = "what happens is a trigger: `when time > 5 s { lead stops }`; `foresee import` reads whole .xosc files"
_AN_ACTOR = "an actor is a block: `vehicle lead: car.compact { start at 20 m along ego.route }`"
_A_PARAMETER = "a parameter is written with its type: `param gap: time = 1.5 s`"
_OPENSCENARIO: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(
            ("Storyboard", "Story", "Act", "ManeuverGroup", "Maneuver", "Event", "Action", "StartTrigger"), _A_TRIGGER
        ),
        **dict.fromkeys(
            ("StopTrigger", "ConditionGroup", "Condition", "Init", "Private", "GlobalAction", "PrivateAction"),
            _A_TRIGGER,
        ),
        **dict.fromkeys(("Entities", "ScenarioObject", "CatalogReference", "EntityObject", "Actors"), _AN_ACTOR),
        **dict.fromkeys(("ParameterDeclarations", "ParameterDeclaration", "VariableDeclaration"), _A_PARAMETER),
    }
)
_SCENIC_CLASSES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "Pedestrian": ("pedestrian", "pedestrian.adult"),
        "Bicycle": ("bicycle", "bicycle.city"),
        "Object": ("obstacle", "obstacle.crate"),
        "Prop": ("obstacle", "obstacle.crate"),
        "Truck": ("vehicle", "truck.rigid"),
        "Bus": ("vehicle", "bus.city"),
    }
)
_ACTORS: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("car", "van", "truck", "bus", "motorcycle", "lorry", "npc"), "vehicle"),
        **dict.fromkeys(("person", "walker", "child", "human", "ped"), "pedestrian"),
        **dict.fromkeys(("bike", "cyclist", "rider"), "bicycle"),
        **dict.fromkeys(("object", "thing", "prop", "box"), "obstacle"),
    }
)
_SPAWN = re.compile(r"(?:spawn|create|new|place|add)\s+(?P<kind>vehicle|bicycle|pedestrian|obstacle|ego)\b")
_SCENIC = re.compile(
    r"(?:(?P<name>[^\W\d]\w*)\s*=\s*)?(?:new\s+)?(?P<kind>Car|Truck|Bus|Pedestrian|Bicycle|Object|Prop|NPCCar)\b"
)
_ALWAYS = re.compile(r"require\s+(?P<how>always|never|eventually)\b")
_WAIT = re.compile(r"wait\s+(?:until|for)\b")
_ASSIGNED = re.compile(
    r"(?P<what>end|weather|speed|start|goal|delay|line|timing)\s*(?P<sign>:?=)\s*(?P<rest>[^=].*?)\s*$"
)
_ACTION = re.compile(r"(?P<action>starts|stops|changes|turns|waits|brakes|accelerates|follows|drives)\b")
_OTHER_ACTIONS: Mapping[str, str] = MappingProxyType(
    {
        "brakes": "stops",
        "halts": "stops",
        "go": "starts",
        "goes": "starts",
        "walks": "starts",
        "drives": "starts",
        "moves": "starts",
    }
)
_WEATHER: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("wet", "slippery"), "wetness 0.6"),
        **dict.fromkeys(("rainy", "raining"), "rain 0.5"),
        **dict.fromkeys(("foggy", "mist", "misty"), "fog 0.5"),
        **dict.fromkeys(("sunny", "glare"), "sun 0.5"),
        **dict.fromkeys(("dry", "clear"), "wetness 0"),
    }
)
_WEATHERS = re.compile(rf"weather\s+(?:.*,\s*)?(?P<word>{'|'.join(_WEATHER)})\b\s*(?=,|$)")
_PERCENT = re.compile(r"(?P<number>[0-9]+(?:\.[0-9]+)?)\s*%(?P<of>\s*of\b)?")
_TURNS = re.compile(r"(?P<name>[^\W\d]\w*)\s+turns\s+(?P<colour>(?:to\s+)?(?:red|green|amber|yellow))\b")
_CALL = re.compile(r"(?P<name>[^\W\d]\w*)\s*$")


def foreign(text: str, rule: str, at: int) -> Foreign | None:
    """Return what is said of a statement with something of another language, or None; `at`: where it was refused."""
    word = re.match(r"[^\W\d]\w*", text)
    return (_statement(text, rule, word[0]) if word is not None else None) or _sign(text, at) or _inside(text, rule, at)


def _statement(text: str, rule: str, word: str) -> Foreign | None:
    """What is known by its first words."""
    if rule == "action":
        return _action(text, word)
    plain = text.removesuffix(" {}")
    top = (_variable(plain) or _spawned(text) or _scenic(text) or _kind(word)) if rule in _TOP else None
    return top or _expectation(text) or (_assigned(plain) if rule != "assignment" else None) or _first(text, rule, word)


def _variable(text: str) -> Foreign | None:
    found = _PARAM.match(text)
    if found is None:
        return None
    unit = UNITS.get(found["unit"] or "")
    param = f"param {found['name']}: {unit.dimension if unit is not None else 'ratio'} = {found['value'].strip()}"
    message = f"`{found['all']}`: a value with a name is a parameter"
    return Foreign(0, len(found["all"]), message, f"did you mean `{param}`?")


def _expectation(text: str) -> Foreign | None:
    found = _ALWAYS.match(text)
    if found is None:
        return None
    message = f"`{found[0]}`: what is to hold while it runs is an expectation"
    return Foreign(0, found.end(), message, f"did you mean `expect {found['how']}`?")


def _spawned(text: str) -> Foreign | None:
    found = _SPAWN.match(text)
    if found is None:
        return None
    message = f"`{found[0]}`: an actor is there from the beginning"
    return Foreign(0, found.end(), message, f"did you mean `{found['kind']}`?")


def _scenic(text: str) -> Foreign | None:
    found = _SCENIC.match(text)
    if found is None:
        return None
    kind, model = _SCENIC_CLASSES.get(found["kind"], ("vehicle", "car.sedan"))
    name = "ego" if found["name"] == "ego" else f"{kind} {found['name'] or 'other'}"
    help = f"an actor is a block: `{name}: {model} {{ start at 20 m along ego.route }}`"
    return Foreign(found.start("kind"), found.end("kind"), f"`{found['kind']}` is a class of Scenic", help)


def _kind(word: str) -> Foreign | None:
    kind = _ACTORS.get(word.lower())
    if kind is None:
        return None
    message = f"`{word}` is no kind of actor"
    return Foreign(0, len(word), message, f"did you mean `{kind}`?")


def _assigned(text: str) -> Foreign | None:
    found = _ASSIGNED.match(text)
    if found is None:
        return None
    what = {"end": "end after", "start": "start speed"}.get(found["what"], found["what"])
    return Foreign(
        0, len(found[0]), f"`{found[0]}`: nothing is assigned here", f"did you mean `{what} {found['rest']}`?"
    )


def _first(text: str, rule: str, word: str) -> Foreign | None:
    ours, help = _FIRST.get(word, ("", ""))
    message = f"`{word}` is a word of other languages"
    if word in _OPENSCENARIO:
        message, help, ours = f"`{word}` is a word of OpenSCENARIO's files", _OPENSCENARIO[word], ""
    elif rule == "actor_item" and _ACTION.match(text) is not None:
        help = "what it does stands in a trigger of the scenario: `when time >= 0 s { lead stops }`"
        message = f"`{word}` is an action, and this block says how the actor begins"
    elif ours and rule in _TOP:
        help = f"did you mean `{ours}`?"
    elif ours or rule not in (*_TOP, "actor_item", "junction_item"):
        help = ""
    return Foreign(0, len(word), message, help) if help else None


def _action(text: str, word: str) -> Foreign | None:
    if (found := _WAIT.match(text)) is not None and not text[found.end() :].strip()[:1].isdigit():
        message = f"`{found[0]}`: a wait has a time; what waits for a condition is a block"
        return Foreign(
            0,
            found.end(),
            message,
            "write `then when CONDITION { ... }`, such as `then when ego.speed < 3 m/s { lead stops }`",
        )
    if (found := _TURNS.match(text)) is not None:
        help = f"name the stage: `{found['name']} turns to ns_go`, or behind it one of its lights, `to ns_amber`"
        message = "a signal shows each way another light, so it turns to one of its stages"
        return Foreign(found.start("colour"), found.end("colour"), message, help)
    ours, help = _FIRST.get(word, ("", ""))
    if ours == "when":
        return Foreign(0, len(word), f"`{word}` is a word of other languages", "did you mean `then when`?")
    if help and not re.match(r"\w+\s+(?:starts|stops|changes|meets|ignores)\b", text):
        return Foreign(0, len(word), f"`{word}` is a word of other languages", help)
    second = re.match(r"\w+\s+(?P<verb>[^\W\d]\w*)", text)
    if second is not None and second["verb"] in _OTHER_ACTIONS:
        verb = second["verb"]
        return Foreign(
            second.start("verb"),
            second.end("verb"),
            f"`{verb}` is no action",
            f"did you mean `{_OTHER_ACTIONS[verb]}`?",
        )
    return None


def _sign(text: str, at: int) -> Foreign | None:
    """Signs of programming languages, at or right before the place where the statement was refused."""
    for sign, ours, pattern, message in _SIGNS:
        for found in re.finditer(pattern, text[: at + 2]):
            start = text.index(sign, found.start())
            if start <= at <= start + len(sign):
                end = start + len(sign) + (text[start + len(sign) :].startswith(" ") and sign == "!")
                return Foreign(start, end, message, f"did you mean `{ours.strip()}`?")
    return None


def _weather(text: str) -> Foreign | None:
    found = _WEATHERS.match(text)
    if found is None:
        return None
    said = f"`{found['word']}` is said by a number from 0 to 1"
    return Foreign(found.start("word"), found.end("word"), said, f"did you mean `{_WEATHER[found['word']]}`?")


def _share(text: str, at: int) -> Foreign | None:
    """A percentage: `50% of pace`."""
    found = next((f for f in _PERCENT.finditer(text) if f.start() <= at <= f.end() + 1), None)
    if found is None:
        return None
    share = f"{Decimal(found['number']) / 100:f}"
    written = found[0].rstrip()
    times = " *" if found["of"] else ""
    return Foreign(
        found.start(),
        found.start() + len(written),
        f"`{written}`: a share is a plain number",
        f"did you mean `{share}{times}`?",
    )


def _inside(text: str, rule: str, at: int) -> Foreign | None:
    """What is at fault inside a statement, with values."""
    return _weather(text) or _share(text, at) or _of_param(text, rule, at) or _calculated(text, rule, at)


def _of_param(text: str, rule: str, at: int) -> Foreign | None:
    """A calculation where a parameter's values are stated."""
    if not text.startswith("param ") or text[at : at + 1] not in ("+", "-", "*", "/", "(") or rule not in _TOP:
        return None
    help = "write the value; what is worked out of a parameter is written where it is used, `2 * width`"
    return Foreign(
        at, at + 1, "the default, range and options of a parameter are values: nothing is worked out here", help
    )


def _calculated(text: str, rule: str, at: int) -> Foreign | None:
    rest = text[at:]
    if rest.startswith(("^", "**")):
        sign = "**" if rest.startswith("**") else "^"
        return Foreign(at, at + len(sign), f"there is no `{sign}`", "multiply: `speed * speed` is a speed squared")
    if rest.startswith("*") and text[:at].endswith("*"):
        return Foreign(at - 1, at + 1, "there is no `**`", "multiply: `speed * speed` is a speed squared")
    called = _CALL.search(text, max(0, at - 80), at) if rest.startswith("(") else None
    if called is not None and called["name"] in _FUNCTIONS:
        near = "`min(a, b)` and `max(a, b)` are the only functions"
        return Foreign(called.start(), called.end(), f"there is no function `{called['name']}`", near)
    measured = _MEASURED_BEFORE.search(text, max(0, at - 200), at)
    if measured is not None and rest[:1] in ("+", "-", "*", "/") and rule in (*_TOP, "action"):
        help = "calculate on the other side, with parameters and values: `ego.eta(j4) < gap + 1 s`"
        message = f"`{measured['what']}` is measured while it runs: nothing is calculated with it"
        return Foreign(measured.start("what"), measured.end("what"), message, help)
    found = _MEASURED.match(text, max(0, text.rfind(" ", 0, at) + 1))
    if found is not None and rule in (*_TOP, "action") and re.search(r"(?:[<>]=?|[-+*/(,])\s*$", text[: found.start()]):
        return _measured_right(found)
    return None


_MEASURED = re.compile(r"[^\W\d]\w*\.(?:speed|acceleration|eta|offset)\b")
_MEASURED_BEFORE = re.compile(
    r"(?P<what>[^\W\d]\w*\.(?:speed|acceleration|offset|eta\s*\([^()]*\))"
    r"|(?:distance|ttc|headway|lateral|overlap|relative_speed)\s*\([^()]*\)|\btime)\s*$"
)


def _measured_right(found: re.Match[str]) -> Foreign:
    help = "compare with a value; of two actors there are `relative_speed(a, b)`, `headway(a, b)`, `distance(a, b)`"
    message = f"`{found[0]}` is measured while it runs, and a value belongs here"
    return Foreign(found.start(), found.end(), message, help)


_FUNCTIONS = frozenset(
    [
        "abs",
        "sqrt",
        "pow",
        "floor",
        "ceil",
        "round",
        "sin",
        "cos",
        "tan",
        "avg",
        "mean",
        "sum",
        "clamp",
        "random",
        "exp",
        "log",
        "minimum",
        "maximum",
        "uniform",
        "Uniform",
        "normal",
        "Normal",
        "Range",
    ]
)


_COMMENT = re.compile(r'"[^"\n]*"?|#[^\n]*|(?P<line>//[^\n]*)|(?P<block>/\*(?:.|\n)*?(?:\*/|\Z))')


def block_of(word: str) -> str | None:
    """Return the rule of what stands in the braces behind a word of another language: "" for nothing that can be read,
    None for a word that is not known here."""
    if word in _OPENSCENARIO:
        return ""
    if word.lower() in _ACTORS:
        return "actor_item"
    return "action" if word in _FIRST else None


def without_comments(text: str) -> tuple[str, list[Foreign]]:
    """Return a text in which the comments of other languages (`//`, `/* */`) are blanks, and what is said of each."""
    found: list[Foreign] = []

    def blank(match: re.Match[str]) -> str:
        if match["line"] is None and match["block"] is None:
            return match[0]
        found.append(_comment(match))
        return re.sub(r"[^\n]", " ", match[0])

    return _COMMENT.sub(blank, text), found


def _comment(match: re.Match[str]) -> Foreign:
    start, first = match.start(), match[0].split("\n")[0]
    if match["line"] is not None:
        return Foreign(start, start + 2, "`//` begins no comment here", "did you mean `#`?")
    behind = match.string[match.end() :].split("\n")[0].strip()
    if behind or "\n" in match[0]:
        help = "begin each line of it with `#`; a comment goes to the end of its line"
        return Foreign(start, start + len(first), "`/*` begins no comment here", help)
    said = first.removeprefix("/*").removesuffix("*/").strip()
    return Foreign(start, start + len(first), f"`{first}` is no comment here", f"did you mean `{f'# {said}'.strip()}`?")
