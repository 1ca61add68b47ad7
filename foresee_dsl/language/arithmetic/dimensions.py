"""Computes the dimensions of expressions: a speed times a time is a length; a time and a length cannot be added."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, assert_never

from foresee_dsl.helps import HelpText, instead, meant_code, one_of, write
from foresee_dsl.language import model as m
from foresee_dsl.language.printer import written
from foresee_dsl.language.units import EXAMPLES, NOUNS, SI_WORD, Dimension, dimension_of


class Powers(NamedTuple):
    """A dimension as powers of the base dimensions."""

    length: int = 0
    time: int = 0
    angle: int = 0
    mass: int = 0

    def times(self, other: Powers, sign: int = 1) -> Powers:
        """Return the dimension of a product (or, with the sign -1, of a quotient)."""
        return Powers(*(left + sign * right for left, right in zip(self, other, strict=True)))


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
    """Return the dimension with these powers (`ratio` if all are zero), or None if the language has no name for it."""
    return _NAMED.get(powers)


def in_words(powers: Powers) -> str:
    """Return a dimension in the words that a message puts behind `is`: `a speed`, or `in m^2/s^2`."""
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
    """A pair of values that cannot be calculated with each other: the part at fault, the message and the help."""

    item: m.Item
    message: str
    help: HelpText


class Dimensions:
    """Computes the dimensions of expressions and collects their mismatches.

    `types` holds the type of every parameter; `needed` is the dimension that the place of the expression needs, or
    None.
    """

    def __init__(self, types: Mapping[str, m.ParamType], needed: Powers | None = None) -> None:
        self._types = types
        self._needed = needed
        self.mismatches: list[Mismatch] = []

    def of(self, value: m.AnyValue) -> Powers | None:
        """Return a value's dimension, or None if an error makes it unknown; the error is reported."""
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
                # The place needs its dimension from the whole product, not from the product's parts.
                needed, self._needed = self._needed, None
                first, second = self.of(left), self.of(right)
                self._needed = needed
                return None if first is None or second is None else first.times(second, 1 if op == "*" else -1)
            case m.Negative(value=inner):
                return self.of(inner)
            case _:
                assert_never(value)

    def _of_parameter(self, reference: m.Ref) -> Powers | None:
        type_ = self._types.get(reference.name)
        dimension = dimension_of(type_)
        if type_ is not None and dimension is None:
            message = f"'{reference.name}' is of type {type_}, which holds a word, so a calculation cannot use it"
            numbers = [name for name, word in self._types.items() if dimension_of(word) is not None]
            which = ": " + one_of(numbers) if 0 < len(numbers) <= 8 else ", such as one of type " + write("time")
            self._add(reference, message, "use a parameter that holds a number" + which)
        return POWERS[dimension] if dimension is not None else None

    def _same(self, whole: m.Sum | m.Extreme, values: tuple[m.AnyValue, ...]) -> Powers | None:
        """Return the dimension that all values share; None if they differ, which is reported."""
        powers = [self.of(value) for value in values]
        first = next((p for p in powers if p is not None), None)
        for value, dimension in zip(values, powers, strict=True):
            if dimension is None or first is None or dimension == first:
                continue
            example = values[powers.index(first)]
            if dimension == self._needed:  # the place needs this one, so the first value is wrong
                self._unlike(whole, value, dimension, example, first)
            else:
                self._unlike(whole, example, first, value, dimension)
            return None
        return first if None not in powers else None

    def _unlike(self, whole: m.Item, left: m.Item, first: Powers, right: m.Item, second: Powers) -> None:
        what = "are compared" if isinstance(whole, m.Extreme) else "are added"
        if isinstance(whole, m.Sum) and whole.op == "-":
            what = "are subtracted"
        message = f"`{written(left)}` is {in_words(first)}, but `{written(right)}` {predicate(right, second)}"
        help: HelpText = _instead(left, first, right, second)
        needed = named(self._needed) if self._needed is not None else None
        if needed is not None and first != self._needed:
            help = f"write {NOUNS[needed]} such as " + instead(EXAMPLES[needed], written(whole))
        self._add(right, f"{message}: only values of one kind {what}", help)

    def _add(self, item: m.Item, message: str, help: HelpText) -> None:
        self.mismatches.append(Mismatch(item, message, help))


def predicate(value: m.Item, powers: Powers) -> str:
    """Return what a message says of a value with this dimension: `is a speed`, or `has no unit`."""
    bare = isinstance(value, m.Quantity) and not value.unit
    return "has no unit" if bare else f"is {in_words(powers)}"


def _instead(left: m.Item, first: Powers, right: m.Item, second: Powers) -> HelpText:
    """Return the help that gives the second value the dimension of the first."""
    needed = named(first)
    if isinstance(right, m.Quantity) and not right.unit and needed is not None and SI_WORD[needed]:
        unit = left.unit if isinstance(left, m.Quantity) else SI_WORD[needed]
        return meant_code(f"{written(right)} {unit}")
    if isinstance(left, m.Quantity) and not left.unit and (meant := named(second)) is not None and SI_WORD[meant]:
        return "give it a unit too: " + instead(f"{written(left)} {SI_WORD[meant]}", written(left))
    if needed is None:
        return "use two values of the same kind"
    return f"write {NOUNS[needed]} such as " + instead(EXAMPLES[needed], written(right))


def turned(value: m.Item) -> m.Product | None:
    """Return a product as the quotient of its two values, and a quotient as their product; None for any other value."""
    if not isinstance(value, m.Product):
        return None
    return m.Product(left=value.left, op="/" if value.op == "*" else "*", right=value.right)
