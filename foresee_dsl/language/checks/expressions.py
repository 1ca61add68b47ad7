"""Checks of expressions: whether their dimensions fit each other and their place, and whether the file may have
expressions."""

from __future__ import annotations

from collections.abc import Mapping

from foresee_dsl.helps import Help, HelpText, meant_code
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.arithmetic.dimensions import POWERS, Dimensions, Powers, in_words, named, predicate, turned
from foresee_dsl.language.arithmetic.evaluate import evaluate
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.printer import written
from foresee_dsl.language.units import NOUNS, Dimension


def refuse(collector: Collector, kind: str, item: m.Item, field: str, value: m.Expression) -> None:
    """Report an expression in a file that may only hold values."""
    try:
        help: HelpText = meant_code(written(evaluate(value)))
    except ExpressionError:
        help = "write its value"
    message = f"{kind} holds values only: `{written(value)}` is not calculated here"
    collector.add(item, field, "FS064", message, help)


def check_expression(
    collector: Collector,
    item: m.Item,
    field: str,
    value: m.Expression,
    needed: Dimension | None,
    types: Mapping[str, m.ParamType],
) -> Powers | None:
    """Check the dimensions of an expression and return its own dimension; None if it has an error.

    `needed` is the dimension that the place needs, or None if any will do. Unknown parameters are reported elsewhere.
    """
    dimensions = Dimensions(types, POWERS[needed] if needed is not None else None)
    powers = dimensions.of(value)
    for mismatch in dimensions.mismatches:
        collector.add(mismatch.item, "", "FS062", mismatch.message, mismatch.help)
    if powers is None or needed is None or powers == POWERS[needed]:
        return powers
    message = f"`{written(value)}` is {in_words(powers)}, but {NOUNS[needed]} is needed here"
    collector.add(
        item, field, "FS062", message, _instead(value, needed, dimensions, Collector.example(needed, item, field))
    )
    return None


def _instead(value: m.Expression, needed: Dimension, dimensions: Dimensions, example: Help) -> Help:
    other = turned(value)
    if other is not None and dimensions.of(other) == POWERS[needed]:
        return meant_code(written(other))
    return "write " + example + f", or calculate one: {_RECIPES[needed]}"


_RECIPES: Mapping[Dimension, str] = {
    "time": "a length divided by a speed (`/`), a time plus a time (`+`)",
    "length": "a speed times a time (`*`), a length plus a length (`+`)",
    "speed": "a length divided by a time (`/`), an acceleration times a time (`*`)",
    "acceleration": "a speed divided by a time (`/`)",
    "angle": "a turning rate times a time (`*`)",
    "angular_rate": "an angle divided by a time (`/`)",
    "mass": "a plain number times a mass (`*`)",
    "ratio": "a length divided by a length (`/`)",
    "count": "from whole numbers (`+`, `*`)",
}


def compare_sides(collector: Collector, item: m.Comparison, types: Mapping[str, m.ParamType]) -> bool:
    """Check that both sides of a comparison in a `require` have one dimension; return whether the comparison can be
    evaluated."""
    dimensions = Dimensions(types)
    left = dimensions.of(item.left) if not isinstance(item.left, m.Measure) else None
    right = dimensions.of(item.right)
    for mismatch in dimensions.mismatches:
        collector.add(mismatch.item, "", "FS062", mismatch.message, mismatch.help)
    if left is None or right is None:
        return False
    if left == right:
        return True
    message = f"`{written(item.left)}` is {in_words(left)}, but `{written(item.right)}` {predicate(item.right, right)}"
    dimension = named(left)
    help = "compare it with " + Collector.example(dimension) if dimension is not None else "compare values of one kind"
    collector.add(item, "right", "FS062", message, help)
    return False


def unknown_in(value: m.AnyValue, types: Mapping[str, m.ParamType]) -> bool:
    """Return whether a value names a parameter that does not exist."""
    return any(ref.name not in types for ref in references(value))
