"""Dimensions of expressions: a speed by a time is a length; a time and a length cannot be added."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, assert_never

from foresee_dsl.helps import HelpText, instead, meant_code, one_of, write
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.words import EXAMPLES, NOUNS
from foresee_dsl.language.printer import written
from foresee_dsl.language.units import SI_WORD, Dimension


class Powers(NamedTuple):
    """A dimension as powers of what all others are made of."""

    length: int = 0
    time: int = 0
    angle: int = 0
    mass: int = 0

    def times(self, other: Powers, sign: int = 1) -> Powers:
        """Return the dimension of a product (or, with the sign -1, of a quotient)."""
        return Powers(*(one + sign * two for one, two in zip(self, other, strict=True)))


POWERS: Mapping[Dimension, Powers] = MappingProxyType(
    {
        "ratio": Powers(),
        "count": Powers(),
        "time": Powers(time=1),
        "length": Powers(length=1),
        "speed": Powers(length=1, time=-1),
        "acceleration": Powers(length=1, time=-2),
        "angle": Powers(angle=1),
        "angular_rate": Powers(angle=1, time=-1),
        "mass": Powers(mass=1),
    }
)
_NAMED = MappingProxyType({powers: dimension for dimension, powers in reversed(tuple(POWERS.items()))})
_SYMBOLS = ("m", "s", "deg", "kg")


def named(powers: Powers) -> Dimension | None:
    """Return the dimension with these powers, `ratio` for none at all; None where the language has no name for it."""
    return _NAMED.get(powers)


def in_words(powers: Powers) -> str:
    """Return what a value of a dimension is: `a speed`, or `in m^2/s^2`."""
    dimension = named(powers)
    if dimension is not None:
        return NOUNS[dimension]
    above = [_power(symbol, n) for symbol, n in zip(_SYMBOLS, powers, strict=True) if n > 0]
    below = [_power(symbol, -n) for symbol, n in zip(_SYMBOLS, powers, strict=True) if n < 0]
    return f"in {'*'.join(above) or '1'}{''.join(f'/{part}' for part in below)}"


def _power(symbol: str, n: int) -> str:
    return symbol if n == 1 else f"{symbol}^{n}"


@dataclass(frozen=True)
class Mismatch:
    """Two values that cannot be calculated with each other: the part that is at fault, and what to write instead."""

    item: m.Item
    message: str
    help: HelpText


class Dimensions:
    """Finds the dimensions of expressions, and what is wrong with them; `types` are those of the parameters, `needed`
    is the dimension that their place asks for, where it is known."""

    def __init__(self, types: Mapping[str, m.ParamType], needed: Powers | None = None) -> None:
        self._types = types
        self._needed = needed
        self.mismatches: list[Mismatch] = []

    def of(self, value: m.AnyValue) -> Powers | None:
        """Return a value's dimension; None where that is unknown, because of a mistake that is reported."""
        match value:
            case m.Quantity():
                return POWERS[value.dimension]
            case m.Ref():
                return self._of_parameter(value)
            case m.Sum(left=left, right=right):
                return self._same(value, (left, right))
            case m.Extreme(values=values):
                return self._same(value, values)
            case m.Product(left=left, op=op, right=right):
                needed, self._needed = self._needed, None  # what the place asks for is the product's dimension
                one, other = self.of(left), self.of(right)
                self._needed = needed
                return None if one is None or other is None else one.times(other, 1 if op == "*" else -1)
            case m.Negative(value=inner):
                return self.of(inner)
            case _:
                assert_never(value)

    def _of_parameter(self, reference: m.Ref) -> Powers | None:
        type_ = self._types.get(reference.name)
        dimension: Dimension | None = next((d for d in POWERS if d == type_), None)
        if type_ is not None and dimension is None:
            message = f"'{reference.name}' is of type {type_}, a word: nothing can be calculated with it"
            numbers = [name for name, known in self._types.items() if any(d == known for d in POWERS)]
            which = ": " + one_of(numbers) if 0 < len(numbers) <= 8 else ", such as one of type " + write("time")
            self._add(reference, message, "use a parameter that holds a number" + which)
        return POWERS[dimension] if dimension is not None else None

    def _same(self, whole: m.Sum | m.Extreme, values: tuple[m.AnyValue, ...]) -> Powers | None:
        """Return the one dimension that all of some values have."""
        powers = [self.of(value) for value in values]
        first = next((p for p in powers if p is not None), None)
        for value, found in zip(values, powers, strict=True):
            if found is None or first is None or found == first:
                continue
            one = values[powers.index(first)]
            if found == self._needed:  # then the first is the odd one
                self._unlike(whole, value, found, one, first)
            else:
                self._unlike(whole, one, first, value, found)
            return None
        return first if None not in powers else None

    def _unlike(self, whole: m.Item, one: m.Item, first: Powers, other: m.Item, second: Powers) -> None:
        what = "are compared" if isinstance(whole, m.Extreme) else "are added"
        if isinstance(whole, m.Sum) and whole.op == "-":
            what = "are subtracted"
        message = f"`{written(one)}` is {in_words(first)}, but `{written(other)}` {_is(other, second)}"
        help: HelpText = _instead(one, first, other, second)
        needed = named(self._needed) if self._needed is not None else None
        if needed is not None and first != self._needed:
            help = f"write {NOUNS[needed]} such as " + instead(EXAMPLES[needed], written(whole))
        self._add(other, f"{message}: only values of one kind {what}", help)

    def _add(self, item: m.Item, message: str, help: HelpText) -> None:
        self.mismatches.append(Mismatch(item, message, help))


def _is(value: m.Item, powers: Powers) -> str:
    bare = isinstance(value, m.Quantity) and not value.unit
    return "has no unit" if bare else f"is {in_words(powers)}"


def _instead(one: m.Item, first: Powers, other: m.Item, second: Powers) -> HelpText:
    """Say what to write for the second of two values, so that it is of the first one's kind."""
    needed = named(first)
    if isinstance(other, m.Quantity) and not other.unit and needed is not None and SI_WORD[needed]:
        unit = one.unit if isinstance(one, m.Quantity) else SI_WORD[needed]
        return meant_code(f"{written(other)} {unit}")
    if isinstance(one, m.Quantity) and not one.unit and (meant := named(second)) is not None and SI_WORD[meant]:
        return "give it a unit too: " + instead(f"{written(one)} {SI_WORD[meant]}", written(one))
    if needed is None:
        return "give both the same kind"
    return f"write {NOUNS[needed]} such as " + instead(EXAMPLES[needed], written(other))


def turned(value: m.Item) -> m.Product | None:
    """Return a product as the quotient, or a quotient as the product; None for anything else."""
    if not isinstance(value, m.Product):
        return None
    return m.Product(left=value.left, op="/" if value.op == "*" else "*", right=value.right)
