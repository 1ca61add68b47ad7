"""Draws cases: `cases 20 from seed 7` becomes twenty cases, the same on every machine, which satisfy every
`require`."""

from __future__ import annotations

import hashlib
import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from functools import partial
from itertools import accumulate, combinations

from foresee_dsl.errors import InputError, Span
from foresee_dsl.helps import write
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import case_values, plain, references
from foresee_dsl.language.document import Document
from foresee_dsl.language.logic import compares, truth
from foresee_dsl.language.meaning import SIGNIFICANT_DIGITS
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.traversal import parts
from foresee_dsl.language.units import UNITS

MAX_CASES = 10_000
"""Maximum number of cases of one statement (ours: at 25 ms a run on two cores they take two minutes; more is likely an
error)."""
MAX_TRIES = 10_000
"""Maximum number of draws for one case until it satisfies every `require` (ours: these draws take a tenth of a
second)."""
_TRIES_OF_A_COMBINATION = 100
"""Number of draws of the other parameters for one combination of the grids, before the next combination is tried
(ours)."""
_FREE_DIGITS = 3
"""Sets the step of a range without a step: the unit of the leading digit of the range's width, divided by ten to this
power. So `0 s..4 s` is drawn in milliseconds, `10 m..60 m` in centimetres (ours: at least a thousand values, and none
that is tedious to read)."""
_BITS = 64
"""Number of bits of a random number."""
_SLACK = Decimal("1e-6")
"""Largest shortfall of a range below a whole number of steps, in steps, that is attributed to rounding (as in
`check_parameters`)."""
_EXACT = 12
"""Number of significant digits for a range with mixed units (ours: fewer than a float has, far finer than any step)."""


@dataclass(frozen=True)
class Axis:
    """The values from which a parameter is drawn: its options, or else the steps of its range.

    Attributes:
        low, step: lowest value and step of a range, in `unit`.
        size: number of values.
        stepped: True if the author wrote the step (or options).
    """

    name: str
    size: int
    options: tuple[m.ParamValue, ...] | None = None
    low: Decimal = Decimal(0)
    step: Decimal = Decimal(1)
    unit: str = ""
    stepped: bool = True

    def value(self, k: int) -> m.ParamValue:
        """Return the value with the index `k`, counted from 0."""
        if self.options is not None:
            return self.options[k]
        return m.Quantity(value=self.low + k * self.step, unit=self.unit)

    def position(self, value: m.ParamValue) -> int | None:
        """Return the index of the nearest value; None for a word or value that is not one of the options."""
        if self.options is not None:
            return self.options.index(value) if value in self.options else None
        if isinstance(value, str):
            return None
        return min(max(round((_in_unit(value, self.unit) - self.low) / self.step), 0), self.size - 1)


def axis_of(param: m.Param) -> Axis | None:
    """Return the values that a parameter is drawn from; None if it keeps its default (no range, no options)."""
    if param.options is not None:
        return Axis(param.name, len(param.options), options=tuple(plain(option) for option in param.options))
    if param.range is None:
        return None
    limits, unit = param.range, param.range.low.unit
    low, high = limits.low.value, _in_unit(limits.high, unit)
    if limits.step is not None:
        step = _in_unit(limits.step, unit)
    elif param.type == "count":
        step = Decimal(1)
    else:
        step = Decimal(1).scaleb((high - low).adjusted() - _FREE_DIGITS) if high > low else Decimal(1)
    size = int((high - low) / step + _SLACK) + 1
    return Axis(param.name, size, None, low, step, unit, limits.step is not None or param.type == "count")


def case_names(cases: m.Cases) -> tuple[str, ...]:
    """Return the names of drawn cases: `seed7_01`, `seed7_02`, ..., with as many digits as the last one needs."""
    count, seed = int(cases.count.value), int(cases.seed.value)
    digits = max(2, len(str(count)))
    return tuple(f"seed{seed}_{k:0{digits}d}" for k in range(1, count + 1))


def draw(scenario: m.Scenario, cases: m.Cases) -> tuple[m.Case, ...]:
    """Return the drawn cases of one `cases` statement, each with a value for every parameter that has a range."""
    drawer, names, drawn_cases = _Drawer(scenario, int(cases.seed.value)), case_names(cases), []
    for k, name in enumerate(names):
        values = drawer.values_of(k)
        if values is None:
            raise TooFewError(drawer.complaint(k, len(names)))
        assignments = tuple(m.Assignment(name=n, value=v) for n, v in values.items() if n in drawer.drawn)
        drawn_cases.append(m.Case(name=name, values=assignments))
    return tuple(drawn_cases)


class TooFewError(Exception):
    """Raised if too few draws satisfy every `require`; the message has their number and the requirement that failed
    most often."""


def with_drawn_cases(document: Document) -> Document:
    """Return the scenario's document with its drawn cases, placed at their `cases` statement; the same document if it
    draws none."""
    scenario = document.model
    if not isinstance(scenario, m.Scenario) or not scenario.all(m.Cases):
        return document
    body: list[m.ScenarioItem] = []
    spans: dict[tuple[int, str], Span] = {}
    for item in scenario.body:
        if not isinstance(item, m.Cases):
            body.append(item)
            continue
        try:
            drawn = draw(scenario, item)
        except TooFewError as error:
            help = "widen a range, ask for fewer cases, or loosen the " + write("require")
            raise InputError((document.diagnostic(item, "", "FS104", str(error), help),)) from None
        place = document.span(item)
        if place is not None:
            spans |= {(id(part), ""): place for case in drawn for part in (case, *case.values)}
        body += drawn
    model = m.Scenario(name=scenario.name, body=tuple(body))
    spans |= {(id(model), f): s for f in ("", "name") if (s := document.span(scenario, f)) is not None}
    alive = (*document.alive, *scenario.all(m.Cases), scenario)
    return replace(document, model=model, spans={**document.spans, **spans}, alive=alive)


class _Drawer:
    """Draws the values of one seed's cases, one case after the other."""

    def __init__(self, scenario: m.Scenario, seed: int) -> None:
        self._seed = seed
        self._requires = scenario.all(m.Require)
        self._scenario = scenario
        self._dependent = False
        """True if a parameter's default is calculated from others, so that it is known only after those are drawn."""
        self._fixed: dict[str, m.ParamValue] = {}
        self._free: list[tuple[m.Param, Axis]] = []
        self._grid: list[Axis] = []
        for param in scenario.all(m.Param):
            axis = axis_of(param)
            if isinstance(param.default, m.Calculated) and axis is None and any(references(param.default)):
                self._dependent = True
            elif axis is None:
                self._fixed[param.name] = plain(param.default)
            elif isinstance(param.distribution, m.Grid):
                self._grid.append(axis)
            else:
                self._free.append((param, axis))
        self.drawn = {axis.name for axis in self._grid} | {param.name for param, _ in self._free}
        self._order = [param.name for param in scenario.all(m.Param)]
        self._combination = 0
        self._draw_count = 0
        self._failed: Counter[int] = Counter()

    def values_of(self, case: int) -> dict[str, m.ParamValue] | None:
        """Return the values of every parameter in the next case, in the order of the file; None after too many
        draws."""
        attempt = 0
        while attempt < MAX_TRIES:
            certain = self._fixed | self._gridded()
            tries = _TRIES_OF_A_COMBINATION if self._grid else MAX_TRIES
            if not self._free or self._violated(certain):  # the values of the grids alone decide the result
                tries = 1
            for _ in range(min(tries, MAX_TRIES - attempt)):
                values = certain | {p.name: _drawn(p, a, self._seed, case, attempt) for p, a in self._free}
                if self._dependent:
                    assignments = tuple(m.Assignment(name=n, value=v) for n, v in values.items() if n in self.drawn)
                    values = case_values(self._scenario, m.Case(name="drawn", values=assignments))
                attempt += 1
                self._draw_count += 1
                violated = self._violated(values)
                if not violated:
                    return {name: values[name] for name in self._order}
                self._failed.update(violated)
        return None

    def _violated(self, values: Mapping[str, m.ParamValue]) -> list[int]:
        """Return the indices of the requirements that some values violate, whatever the values of the other parameters
        will be."""
        return [k for k, require in enumerate(self._requires) if holds(require.condition, values) is False]

    def complaint(self, valid: int, wanted: int) -> str:
        """Return the message about too few draws: the number of valid ones, and the requirement that failed most."""
        worst, times = self._failed.most_common(1)[0]
        only = "none" if not valid else f"only {valid}"
        return (
            f"of {self._draw_count} draws {only} satisfied every `require`, but {wanted} cases are asked for; "
            f"`{requirement_text(self._requires[worst])}` failed most, {times} times"
        )

    def _gridded(self) -> dict[str, m.ParamValue]:
        """Return the next combination of the grids: mixed radix, the first parameter of the file changes fastest."""
        rest, self._combination = self._combination, self._combination + 1
        values = {}
        for axis in self._grid:
            rest, k = divmod(rest, axis.size)
            values[axis.name] = axis.value(k)
        return values


def _drawn(param: m.Param, axis: Axis, seed: int, case: int, attempt: int) -> m.ParamValue:
    digest = hashlib.sha256(f"foresee 1 draw\n{seed}\n{param.name}\n{case}\n{attempt}".encode()).digest()
    bits = int.from_bytes(digest[: _BITS // 8], "big")
    match param.distribution:
        case m.Choice(weights=weights):
            return axis.value(_chosen(bits, [weight.value for weight in weights]))
        case m.Normal() as normal:
            return axis.value(_normal(bits, axis, normal))
        case _:
            return axis.value(bits * axis.size >> _BITS)


def _chosen(bits: int, weights: Sequence[Decimal]) -> int:
    """Return the option that a random number selects, exactly in proportion to the weights."""
    ends = list(accumulate(Fraction(weight) for weight in weights))
    return min(bisect_right(ends, Fraction(bits, 1 << _BITS) * ends[-1]), len(ends) - 1)


def _normal(bits: int, axis: Axis, normal: m.Normal) -> int:
    """Return the step nearest to a draw from the normal distribution, cut off at the ends of the range.

    It uses the inverse of the distribution function, so that one random number gives one value, however much is cut
    off.
    """
    from statistics import NormalDist  # imported here, because few files draw from it and all would pay for its import

    high = axis.low + (axis.size - 1) * axis.step
    bell = NormalDist(float(_in_unit(normal.mean, axis.unit)), float(_in_unit(normal.deviation, axis.unit)))
    least, most = bell.cdf(float(axis.low)), bell.cdf(float(high))
    share = least + (most - least) * ((bits >> 11) + 0.5) / (1 << (_BITS - 11))  # a float holds 53 bits
    if not 0.0 < share < 1.0:
        return 0 if share <= 0.0 else axis.size - 1
    steps = (bell.inv_cdf(share) - float(axis.low)) / float(axis.step)
    return min(max(round(steps), 0), axis.size - 1)


def _in_unit(value: m.Quantity, unit: str) -> Decimal:
    """Return a quantity's number in another unit of its dimension; the author's own digits if the unit is the same."""
    if value.unit == unit:
        return value.value
    ratio = Fraction(UNITS[value.unit].to_si if value.unit else 1) / Fraction(UNITS[unit].to_si if unit else 1)
    exact = Fraction(value.value) * ratio
    return Decimal(f"{float(exact):.{_EXACT}g}")


def holds(condition: m.Condition, values: Mapping[str, m.ParamValue]) -> bool | None:
    """Return whether a condition of a `require` holds; None if these values do not determine it.

    Quantities are compared by their SI value, to as many digits as the hash of a meaning uses: `7.2 km/h` is `2 m/s`.
    """
    return truth(condition, partial(_part_holds, values))


def _part_holds(values: Mapping[str, m.ParamValue], part: m.Condition) -> bool | None:
    match part:
        case m.Comparison(left=left, op=op, right=right) if not isinstance(left, m.Measure):
            first, second = _si(left, values), _si(right, values)
            return None if first is None or second is None else compares(op, first, second)
        case m.Equals(left=left, right=word):
            value = values.get(left.name)
            return value == word if isinstance(value, str) else None
    return None  # the condition is about the run, which the checks report


def requirement_text(require: m.Require) -> str:
    """Return a requirement as text."""
    return f"require {written(require.condition)}"


def violation(require: m.Require, values: Mapping[str, m.ParamValue]) -> str:
    """Return the message about values that violate a requirement: `gap is 3 s, but `require gap < 2 s``."""
    names = dict.fromkeys(name for name in parameters_of(require.condition) if name in values)
    described = " and ".join(f"{name} is {value_text(values[name])}" for name in names)
    return f"{described or 'this'}, but `{requirement_text(require)}`"


def parameters_of(condition: m.Condition) -> Iterator[str]:
    """Yield the parameters in a condition of a `require`, in the order of the text."""
    for part in parts(condition):
        if isinstance(part, m.Comparison | m.Equals):
            for side in (part.left, part.right):
                yield from (ref.name for ref in references(side)) if isinstance(side, m.Item) else ()


def _si(value: m.AnyValue, values: Mapping[str, m.ParamValue]) -> float | None:
    """Return a value in SI units, rounded to the number of digits that comparisons of meanings use; None if a parameter
    has no value yet.

    A calculation without a result (a division by zero) is NaN, so that every comparison with it fails.
    """
    current = values.get(value.name) if isinstance(value, m.Ref) else value
    if isinstance(current, m.Quantity):
        return float(f"{current.si:.{SIGNIFICANT_DIGITS}g}")
    if not isinstance(value, m.EXPRESSIONS) or any(ref.name not in values for ref in references(value)):
        return None
    from foresee_dsl.language.arithmetic.evaluate import evaluate

    try:
        return float(f"{evaluate(value, values).si:.{SIGNIFICANT_DIGITS}g}")
    except ExpressionError:
        return math.nan


BINS = 10
"""Number of equal parts into which coverage divides a range without steps, and for pairs every range (ours: tenths are
fine enough to tell low, middle and high, and a few hundred cases can cover a hundred pairs)."""


@dataclass(frozen=True)
class Reach:
    """How much of one parameter's range or options the cases cover.

    Attributes:
        name: name of the parameter.
        smallest, largest: smallest and largest value that occurs; for options, the first and the last that occur.
        reached, bins: number of the steps, options or tenths that occur, and their total number.
        of: kind of the bins: `steps`, `options` or `tenths`.
    """

    name: str
    smallest: m.ParamValue
    largest: m.ParamValue
    reached: int
    bins: int
    of: str


@dataclass(frozen=True)
class Coverage:
    """How much of all ranges and options some cases cover.

    Attributes:
        cases: number of cases.
        distinct: number of cases with different values.
        reaches: coverage of each parameter with a range or options.
        pairs_reached, pairs: number of pairs of bins of two parameters (at most ten bins for a range) that occur
            together in a case, and their total number, including pairs that a `require` excludes.
    """

    cases: int
    distinct: int
    reaches: tuple[Reach, ...]
    pairs_reached: int
    pairs: int


def coverage(scenario: m.Scenario, cases: Sequence[m.Case]) -> Coverage:
    """Return how much of the ranges some cases cover; a parameter that a case does not set has its default."""
    values = [case_values(scenario, case) for case in cases]
    axes = [axis for param in scenario.all(m.Param) if (axis := axis_of(param)) is not None]
    taken = {axis.name: [axis.position(each[axis.name]) for each in values] for axis in axes}
    reaches = tuple(_reach(axis, [k for k in taken[axis.name] if k is not None]) for axis in axes if cases)
    reached = total = 0
    for first, second in combinations(axes, 2):
        total += _parts(first) * _parts(second)
        both = zip(taken[first.name], taken[second.name], strict=True)
        reached += len({(_part(first, a), _part(second, b)) for a, b in both if a is not None and b is not None})
    return Coverage(len(cases), len({repr(each) for each in values}), reaches, reached, total)


def _reach(axis: Axis, taken: list[int]) -> Reach:
    reached, bins = len(set(taken)), axis.size
    of = "options" if axis.options is not None else "steps"
    if not axis.stepped:
        reached, bins, of = len({_part(axis, k) for k in taken}), _parts(axis), "tenths"
    return Reach(axis.name, axis.value(min(taken, default=0)), axis.value(max(taken, default=0)), reached, bins, of)


def _parts(axis: Axis) -> int:
    return axis.size if axis.options is not None else min(axis.size, BINS)


def _part(axis: Axis, k: int) -> int:
    """Return the index of the part of a range that contains the value with index `k`."""
    return k * _parts(axis) // axis.size
