"""Three kinds of inputs: random bytes and characters, mutated real files, random derivations of the grammar.

An input is made from its own random generator, so that input 12,345 of seed 1 is the same whoever makes it.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable

from tests.fuzz.corpus import corpus
from tests.fuzz.derivations import derivation

_SNIPPETS = (
    *"{}[]();:=.,<>\"#-_'\\/^%@!?*&|~`$",
    *"\t\n\r\0\x1b\x7f\x85\u00a0\u00e9\u00b0\u00b2\u200b\u202e\u2028\ufeff\ud7ff\U0001f697",
    "\r\n", "..", "...", "=>", "<=", ">=", "{}", "[]", "()", '""', "#", " and ", " or ", " not ", "foresee 1",
    " 3 m", " 1.5 s", " 50 km/h", " -0", "0.0000000001", "ego.", "ego.route", "99999999999999999999", "1e9", "sha256:",
)  # fmt: skip
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
_UNIT = re.compile(r"(?<=\d )(?:km/h|m/s\^2|m/s|mph|min|ms|deg/s|deg|rad|km|cm|kg|s|m|t)\b")
_TOKEN = re.compile(r'"[^"\n]*"|[^\W\d]\w*|-?\d+(?:\.\d+)?|\s+|.', re.DOTALL)
_NUMBERS = (
    "0",
    "-0",
    "-1",
    "0.5",
    "1e3",
    "1000000000",
    "1000000001",
    "9" * 40,
    "0." + "0" * 40 + "1",
    "007",
    "1.",
    ".5",
)
_UNITS = (
    "s",
    "ms",
    "min",
    "m",
    "cm",
    "km",
    "m/s",
    "km/h",
    "mph",
    "m/s^2",
    "deg",
    "rad",
    "kg",
    "t",
    "kmh",
    "°",
    "%",
    "",
)


def random_input(rng: random.Random) -> bytes:
    """Return random bytes, or characters of all kinds, often behind a beginning that is right."""
    size = rng.choice((0, 1, 3, 10, 40, 200, 2000))
    kind = rng.randrange(4)
    if kind == 0:
        content = rng.randbytes(size)
    elif kind == 1:
        content = "".join(chr(_code_point(rng)) for _ in range(size)).encode()
    elif kind == 2:
        content = "".join(rng.choice(_SNIPPETS) for _ in range(size)).encode()
    else:
        content = bytes(rng.choice(b' \n\t{}[]"#;:=.,<>()abcxyz0123456789-') for _ in range(size))
    start = rng.choice(
        (b"", b"", b"foresee 1\n", b"foresee 1\n\nscenario a {\n", b"\xef\xbb\xbfforesee 1\nnetwork n {\n")
    )
    return start + content + rng.choice((b"", b"\n}\n"))


def mutated_input(rng: random.Random) -> bytes:
    """Return a real file with a few things wrong with it."""
    content = rng.choice(corpus())
    for _ in range(rng.choice((1, 1, 1, 2, 3, 5, 10))):
        content = rng.choice(_MUTATIONS)(rng, content)
    return content[:400_000]


def grammar_input(rng: random.Random) -> bytes:
    """Return a random derivation of the grammar, sometimes with something wrong with it."""
    content = derivation(rng).encode("utf-8", errors="replace")
    return rng.choice(_MUTATIONS)(rng, content) if rng.random() < 0.2 else content


GENERATORS: dict[str, Callable[[random.Random], bytes]] = {
    "random": random_input,
    "mutated": mutated_input,
    "grammar": grammar_input,
}


def make(name: str, seed: int, number: int) -> bytes:
    """Return one input of a generator."""
    return GENERATORS[name](random.Random(f"{seed}/{name}/{number}"))


def _code_point(rng: random.Random) -> int:
    """A character of ASCII, of the basic plane (no surrogate), or beyond."""
    high = rng.choice((0x7F, 0x24F, 0xD7FF, 0x10FFFF))
    code = rng.randint(0, high)
    return code if not 0xD800 <= code <= 0xDFFF else 0xFFFD


# ---- mutations -----------------------------------------------------------------------------------------------------

_Mutation = Callable[[random.Random, bytes], bytes]


def _flip(rng: random.Random, content: bytes) -> bytes:
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 4))):
        if changed:
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _cut(rng: random.Random, content: bytes) -> bytes:
    at, length = rng.randrange(len(content) + 1), rng.choice((1, 1, 5, 30, 300, len(content)))
    return content[:at] + content[at + length :]


def _insert(rng: random.Random, content: bytes) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.choice(_SNIPPETS).encode() * rng.choice((1, 1, 1, 3)) + content[at:]


def _splice(rng: random.Random, content: bytes) -> bytes:
    other = rng.choice(corpus())
    start = rng.randrange(len(other) + 1)
    at = rng.randrange(len(content) + 1)
    return content[:at] + other[start : start + rng.choice((10, 80, 800))] + content[at:]


def _tokens(change: Callable[[random.Random, list[str]], None]) -> _Mutation:
    """Make a mutation of one that changes the list of a file's tokens."""

    def mutate(rng: random.Random, content: bytes) -> bytes:
        tokens = _TOKEN.findall(content.decode("utf-8", errors="replace"))
        if tokens:
            change(rng, tokens)
        return "".join(tokens).encode("utf-8", errors="replace")

    return mutate


def _delete_token(rng: random.Random, tokens: list[str]) -> None:
    del tokens[rng.randrange(len(tokens))]


def _double_token(rng: random.Random, tokens: list[str]) -> None:
    at = rng.randrange(len(tokens))
    tokens.insert(at, tokens[at])


def _swap_tokens(rng: random.Random, tokens: list[str]) -> None:
    words = [k for k, token in enumerate(tokens) if not token.isspace()]
    if words:
        a, b = rng.choice(words), rng.choice(words)
        tokens[a], tokens[b] = tokens[b], tokens[a]


def _long_token(rng: random.Random, tokens: list[str]) -> None:
    at = rng.randrange(len(tokens))
    tokens[at] = tokens[at] * rng.choice((50, 5_000, 20_000)) if len(tokens[at]) < 20 else tokens[at] * 3


def _lines(change: Callable[[random.Random, list[bytes]], None]) -> _Mutation:
    def mutate(rng: random.Random, content: bytes) -> bytes:
        lines = content.split(b"\n")
        change(rng, lines)
        return b"\n".join(lines)

    return mutate


def _delete_line(rng: random.Random, lines: list[bytes]) -> None:
    del lines[rng.randrange(len(lines))]


def _repeat_line(rng: random.Random, lines: list[bytes]) -> None:
    at = rng.randrange(len(lines))
    lines[at:at] = [lines[at]] * rng.choice((1, 1, 2, 200))


def _move_line(rng: random.Random, lines: list[bytes]) -> None:
    line = lines.pop(rng.randrange(len(lines)))
    lines.insert(rng.randrange(len(lines) + 1), line)


def _replaced(pattern: re.Pattern[str], by: tuple[str, ...]) -> _Mutation:
    """Make a mutation that puts another word in place of one that matches."""

    def mutate(rng: random.Random, content: bytes) -> bytes:
        text = content.decode("utf-8", errors="replace")
        places = [match.span() for match in pattern.finditer(text)]
        if places:
            start, end = rng.choice(places)
            text = text[:start] + rng.choice(by) + text[end:]
        return text.encode("utf-8", errors="replace")

    return mutate


def _nest(rng: random.Random, content: bytes) -> bytes:
    """Put something deep where something flat was."""
    opening, closing = rng.choice(
        (("(", ")"), ("{", "}"), ("[", "]"), ("not ", ""), ("a { ", "}"), ("then {\n", "}\n"))
    )
    deep = rng.choice((2, 30, 45, 200, 3_000))
    at = rng.randrange(len(content) + 1)
    end = min(len(content), at + rng.choice((0, 10, 60)))
    return content[:at] + opening.encode() * deep + content[at:end] + closing.encode() * deep + content[end:]


def _conditions(rng: random.Random, content: bytes) -> bytes:
    """Make a condition deep or long."""
    deep = rng.choice((10, 39, 40, 41, 100, 2_000))
    form = rng.choice(("({} and time > 1 s)", "not ({})", "({})", "{} or time > 1 s", "({} for 1 s)"))
    condition = "time > 2 s"
    if deep <= 100:
        for _ in range(deep):
            condition = form.format(condition)
    else:
        left, right = form.split("{}")
        condition = left * deep + condition + right * deep
    return re.sub(rb"(?<=when )[^{\n]*", condition.encode(), content, count=1)


_MUTATIONS: tuple[_Mutation, ...] = (
    _flip,
    _cut,
    _insert,
    _splice,
    _tokens(_delete_token),
    _tokens(_delete_token),
    _tokens(_double_token),
    _tokens(_swap_tokens),
    _tokens(_swap_tokens),
    _tokens(_long_token),
    _lines(_delete_line),
    _lines(_repeat_line),
    _lines(_move_line),
    _replaced(_NUMBER, _NUMBERS),
    _replaced(_UNIT, _UNITS),
    _nest,
    _conditions,
)
