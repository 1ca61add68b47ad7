"""How much of the parameters' ranges the cases of a scenario reach."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from foresee_dsl.language import model as m
from foresee_dsl.language.sampling.draws import Axis, axis_of

BINS = 10
"""A range without steps is looked at in so many equal parts, and in pairs every range (ours: a tenth of a range is
what people mean by low, middle and high, and a hundred pairs can be covered by a few hundred cases)."""


@dataclass(frozen=True)
class Reach:
    """What the cases reach of one parameter.

    Attributes:
        name: of the parameter.
        smallest, largest: the values that occur; for options, the first and the last of them that occur.
        reached, bins: how many of the steps, options or tenths occur, and how many there are.
        of: what the bins are: `steps`, `options` or `tenths`.
    """

    name: str
    smallest: m.ParamValue
    largest: m.ParamValue
    reached: int
    bins: int
    of: str


@dataclass(frozen=True)
class Coverage:
    """What some cases reach of all ranges.

    Attributes:
        cases: how many there are. distinct: how many of them differ in their values.
        reaches: one for each parameter with a range or options.
        pairs_reached, pairs: of the pairs of bins of two parameters (ranges in ten parts at most), how many occur
            together in some case, and how many there are. Also counted are pairs that a `require` rules out.
    """

    cases: int
    distinct: int
    reaches: tuple[Reach, ...]
    pairs_reached: int
    pairs: int


def coverage(scenario: m.Scenario, cases: Sequence[m.Case]) -> Coverage:
    """Return how much of the ranges some cases reach; a case has the defaults where it gives no value."""
    values = [values_of(scenario, case) for case in cases]
    axes = [axis for param in scenario.all(m.Param) if (axis := axis_of(param)) is not None]
    taken = {axis.name: [axis.position(each[axis.name]) for each in values] for axis in axes}
    reaches = tuple(_reach(axis, [k for k in taken[axis.name] if k is not None]) for axis in axes if cases)
    reached = total = 0
    for one, other in combinations(axes, 2):
        total += _parts(one) * _parts(other)
        both = zip(taken[one.name], taken[other.name], strict=True)
        reached += len({(_part(one, a), _part(other, b)) for a, b in both if a is not None and b is not None})
    return Coverage(len(cases), len({repr(each) for each in values}), reaches, reached, total)


def values_of(scenario: m.Scenario, case: m.Case) -> Mapping[str, m.ParamValue]:
    """Return the value of every parameter in a case, in the order of the file."""
    given = {assignment.name: assignment.value for assignment in case.values}
    return {param.name: given.get(param.name, param.default) for param in scenario.all(m.Param)}


def _reach(axis: Axis, taken: list[int]) -> Reach:
    if axis.options is not None:
        reached, bins, of = len(set(taken)), axis.size, "options"
    elif axis.stepped:
        reached, bins, of = len(set(taken)), axis.size, "steps"
    else:
        reached, bins, of = len({_part(axis, k) for k in taken}), _parts(axis), "tenths"
    return Reach(axis.name, axis.value(min(taken, default=0)), axis.value(max(taken, default=0)), reached, bins, of)


def _parts(axis: Axis) -> int:
    return axis.size if axis.options is not None else min(axis.size, BINS)


def _part(axis: Axis, k: int) -> int:
    """Return in which of the equal parts of a range its value number `k` is."""
    return k * _parts(axis) // axis.size
