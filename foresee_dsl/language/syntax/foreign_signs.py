"""Recognises signs, functions and calculations of other languages inside a statement."""

from __future__ import annotations

import re
from decimal import Decimal

from foresee_dsl.helps import meant_code, write
from foresee_dsl.language.syntax.foreign_words import TOP, WEATHER, Foreign

_FAR = 80
_SIGNS = (
    (
        "==",
        re.compile(r"==(?=\s*-?[0-9])"),
        "",
        "compare numbers with " + write("<") + ", " + write("<=") + ", " + write(">") + " or " + write(">="),
    ),
    ("==", re.compile(r"=="), "is", ""),
    (
        "!=",
        re.compile(r"!=|<>"),
        "",
        "write "
        + write("not")
        + " in front: "
        + write("not ego.signal(j4) is red")
        + "; compare numbers with "
        + write("<")
        + " or "
        + write(">"),
    ),
    ("&&", re.compile(r"&&?"), "and", ""),
    ("||", re.compile(r"\|\|?"), "or", ""),
    ("!", re.compile(r"!\s*(\w+)"), r"not \1", ""),
)
"""Signs that are words in this language: each sign with its pattern, and the word that replaces it or else the help."""

_WEATHERS = re.compile(rf"weather\s+(?:.*?,\s*)?(?P<word>{'|'.join(WEATHER)})\b\s*(?=,|$)")
_PERCENT = re.compile(r"(?P<number>[0-9]+(?:\.[0-9]+)?)\s*%(?P<of>\s*of\b)?")
_PLUS = re.compile(r"\+\s*(?P<value>[\w.]+)")
_ONE_VALUE = re.compile(r"\b(?P<name>min|max)\s*\((?P<value>[^(),]+)\)$")
_CALL = re.compile(r"(?P<name>[^\W\d]\w*)\s*$")
_POWER = re.compile(r"\*\*|\^")
_RAISED = re.compile(r"(?P<base>-?[0-9.]+(?:\s*[a-z/]+)?|[a-z]\w*|\([^()]*\))\s*(?:\*\*|\^)\s*(?P<times>[23])(?![\w.])")
_MEASURED = re.compile(r"[^\W\d]\w*\.(?:speed|acceleration|eta|offset|deviation)\b")
_MEASURED_BEFORE = re.compile(
    r"(?P<what>[^\W\d]\w*\.(?:speed|acceleration|offset|deviation|eta\s*\([^()]*\))"
    r"|(?:distance|ttc|ttc_along|headway|lateral|overlap|relative_speed)\s*\([^()]*\)|\btime)\s*$"
)


_DRAWN = frozenset(["random", "uniform", "Uniform", "normal", "Normal", "Range"])
_OF_OURS = {
    ("abs", 1): "max({0}, -({0}))",
    ("avg", 2): "({0} + {1}) / 2",
    ("mean", 2): "({0} + {1}) / 2",
    ("sum", 2): "({0} + {1})",
    ("clamp", 3): "min(max({0}, {1}), {2})",
    ("minimum", 2): "min({0}, {1})",
    ("maximum", 2): "max({0}, {1})",
}
"""Functions of other languages with their number of values, and the calculation of this language that replaces each."""
_FUNCTIONS = {
    *("sqrt", "pow", "floor", "ceil", "round", "sin", "cos", "tan", "exp", "log"),
    *(name for name, _ in _OF_OURS),
    *_DRAWN,
}


def sign(text: str, at: int) -> Foreign | None:
    """Return the message for a sign of programming languages at or right before a place, or None."""
    for written, pattern, ours, help in _SIGNS:
        for match in pattern.finditer(text[:at] + text[at : at + _FAR]):
            if match.start() <= at <= match.start() + len(written):
                replacement = help or meant_code(match.expand(ours))
                message = f"`{match[0]}`: conditions are joined by words, not by signs"
                return Foreign(match.start(), match.end(), message, replacement)
    return None


def _weather(text: str) -> Foreign | None:
    match = _WEATHERS.match(text)
    if match is None:
        return None
    message = f"`{match['word']}` is written as a number from 0 to 1"
    return Foreign(match.start("word"), match.end("word"), message, meant_code(WEATHER[match["word"]]))


def _share(text: str, at: int) -> Foreign | None:
    """Return the message for a percentage, or None: `50% of pace`."""
    match = next((f for f in _PERCENT.finditer(text) if f.start() <= at <= f.end() + 1), None)
    if match is None:
        return None
    share = f"{Decimal(match['number']) / 100:f}"
    written = match[0].rstrip()
    help = meant_code(f"{share} *" if match["of"] else share)
    end = match.start() + len(written)
    return Foreign(match.start(), end, f"`{written}`: write a share as a plain number", help)


def inside(text: str, rule: str, at: int) -> Foreign | None:
    """Return the message for a value or calculation in the form of another language, or None."""
    return (
        _weather(text)
        or _share(text, at)
        or _behind_of(text)
        or _plus(text, at)
        or _one_value(text, at)
        or _power(text, at)
        or _function(text, at)
        or _measured_left(text, rule, at)
        or _measured_right(text, rule, at)
    )


def _behind_of(text: str) -> Foreign | None:
    match = re.search(r"\bbehind\s+of\b", text)
    if match is None:
        return None
    return Foreign(match.start(), match.end(), f"`{match[0]}` has a word too many", meant_code("behind"))


def _plus(text: str, at: int) -> Foreign | None:
    plus = _PLUS.match(text, at)
    if plus is None or not re.search(r"\w\s*$", text[:at]):
        return None
    return Foreign(at, plus.end(), f"`{plus[0]}`: write a value without `+`", meant_code(plus["value"]))


def _one_value(text: str, at: int) -> Foreign | None:
    alone = _ONE_VALUE.search(text, max(0, at - _FAR), at + 1)
    if alone is None or text[at : at + 1] != ")":
        return None
    help = "write " + write(f"{alone['name']}({alone['value'].strip()}, 2 s)") + ", for example"
    return Foreign(alone.start(), at + 1, f"`{alone['name']}` needs two values or more", help)


def _power(text: str, at: int) -> Foreign | None:
    match = next((f for f in _POWER.finditer(text) if f.start() <= at <= f.end()), None)
    if match is None:
        return None
    whole = _RAISED.search(text)
    if whole is not None and whole.start() <= match.start() < whole.end():
        base, times = whole["base"].strip(), int(whole["times"])
        help = meant_code(" * ".join([base] * times))
        return Foreign(whole.start(), whole.end(), f"`{whole[0]}`: the language has no `{match[0]}`", help)
    help = "multiply: " + write("speed * speed") + " is a speed squared"
    return Foreign(match.start(), match.end(), f"the language has no `{match[0]}`", help)


def _function(text: str, at: int) -> Foreign | None:
    called = _CALL.search(text, max(0, at - _FAR), at) if text[at : at + 1] == "(" else None
    if called is None or called["name"] not in _FUNCTIONS:
        return None
    message = f"there is no function `{called['name']}`"
    closed = text.find(")", at)
    arguments = [part.strip() for part in text[at + 1 : closed].split(",")] if closed > at else []
    ours = _OF_OURS.get((called["name"], len(arguments)))
    if ours is not None and "(" not in text[at + 1 : closed]:
        help = meant_code(ours.format(*arguments))
        return Foreign(called.start(), closed + 1, f"{message}: `{text[called.start() : closed + 1]}`", help)
    if called["name"] in _DRAWN:
        param = write("param gap: time = 1.5 s in 0 s..4 s as uniform")
        help = "draw a parameter: " + param + ", with " + write("cases 20 from seed 7")
        return Foreign(called.start(), called.end(), message, help)
    help = write("min(a, b)") + " and " + write("max(a, b)") + " are the only functions"
    return Foreign(called.start(), called.end(), message, help)


def _measured_left(text: str, rule: str, at: int) -> Foreign | None:
    measured = _MEASURED_BEFORE.search(text, max(0, at - 200), at)
    if measured is None or text[at : at + 1] not in ("+", "-", "*", "/") or rule not in (*TOP, "action"):
        return None
    help = "calculate on the other side, with parameters and values: " + write("ego.eta(j4) < gap + 1 s")
    message = f"`{measured['what']}` is measured in the run, so a calculation cannot use it"
    return Foreign(measured.start("what"), measured.end("what"), message, help)


def _measured_right(text: str, rule: str, at: int) -> Foreign | None:
    match = _MEASURED.match(text, max(0, text.rfind(" ", 0, at) + 1))
    if match is None or rule not in (*TOP, "action"):
        return None
    if re.search(r"(?:[<>]=?|[-+*/(,])\s*$", text[: match.start()]) is None:
        return None
    what = match[0].rpartition(".")[2]
    example = {"speed": "50 km/h", "acceleration": "3 m/s^2", "eta": "2.5 s"}.get(what, "12 m")
    measures = "relative_speed(a, b), headway(a, b), distance(a, b)"
    help = "write a value such as " + write(example) + f"; between two actors there are {measures}"
    message = f"`{match[0]}` is measured in the run, but a value is needed here"
    return Foreign(match.start(), match.end(), message, help)
