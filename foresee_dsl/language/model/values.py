"""Values of the language: quantities with units, names, references to parameters, points and places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import Annotated, Any, Literal, Union

from pydantic import AfterValidator, Field, GetCoreSchemaHandler, TypeAdapter
from pydantic_core import CoreSchema, PydanticCustomError

from foresee_dsl.language.model.item import ONE_OF, Bounds, Item, Names, Phrase, checked_by
from foresee_dsl.language.model.pattern import Form
from foresee_dsl.language.units import SI_WORD, UNITS, Dimension

NAME_PATTERN = r"[a-z][a-z0-9_]*"
"""The form of every name in a file: snake_case. Ids of imported networks are written as strings instead."""

Name = Annotated[str, Field(pattern=rf"^{NAME_PATTERN}$", max_length=80)]
Id = Annotated[str, Field(min_length=1, max_length=200, pattern=r'^[^"\n\r\\]+$'), Form.ID]
"""A name, or the id of an object in an imported network (printed as a string if it is not a valid name)."""
Word = Annotated[Id, Form.WORD, Names("word")]
"""A word: an id, or the name of a model."""
ModelName = Annotated[
    str, Field(pattern=rf"^{NAME_PATTERN}\.{NAME_PATTERN}$", max_length=80), Form.MODEL, Names("model")
]
"""Name of a model: `class.variant`, such as `car.compact`, which is an entry of a catalogue."""
Text = Annotated[str, Field(max_length=2000, pattern=r'^[^"\n\r]*$'), Form.TEXT]
"""A string on one line, without double quotes."""
FilePath = Annotated[str, Field(min_length=1, max_length=500, pattern=r'^[^"\n\r]+$'), Form.TEXT, Names("file")]
ActorName = Annotated[Name, Names("actor")]
Pin = Annotated[str, Field(pattern=r"^sha256:[0-9a-f]{12}$")]
"""The first twelve digits of the hash of another file: of its meaning (`language.meaning`), or of a tracks file's
bytes."""


def _known_unit(word: str) -> str:
    if word and word not in UNITS:
        raise ValueError(f"unknown unit {word!r}")
    return word


class Quantity(Phrase, kind=""):
    """A number and its unit as the author wrote them: `50 km/h`, `1.50 s`, `0.31`.

    `value` is decimal, so that the author's digits come back when it is printed. `unit` is a word of
    `units.UNITS`, or empty for a ratio or a count.
    """

    value: Decimal = Field(allow_inf_nan=False, ge=Decimal("-1e9"), le=Decimal("1e9"))
    unit: Annotated[str, AfterValidator(_known_unit)] = ""

    @property
    def dimension(self) -> Dimension:
        """The unit's dimension; `ratio` for a bare number, which is also allowed for a count."""
        return UNITS[self.unit].dimension if self.unit else "ratio"

    @property
    def si(self) -> float:
        """The value in SI (radians for angles)."""
        return float(self.value) * (UNITS[self.unit].to_si if self.unit else 1.0)

    @classmethod
    def of(cls, si_value: float, dimension: Dimension, digits: int) -> Quantity:
        """Return a quantity from an SI value, in the unit of generated files, rounded to `digits` decimals."""
        word = SI_WORD[dimension]
        number = si_value / UNITS[word].to_si if word else si_value
        rounded = round(Decimal(repr(float(number))), digits)
        return cls(value=abs(rounded) if rounded == 0 else rounded, unit=word)


class Ref(Phrase, kind=""):
    """The name of a parameter in the place of a value; a concrete scenario has none."""

    pattern = "{name}"

    name: Annotated[Name, Names("parameter")]


JunctionId = Annotated[Id | Ref, Names("junction")]
RoadId = Annotated[Id | Ref, Names("road")]
StageId = Annotated[Id | Ref, Names("stage")]


# ---- expressions -----------------------------------------------------------------------------------------------------


class Sum(Phrase):
    """`gap + 0.5 s`, `room - 2 m`: the sum or difference of two values of one dimension."""

    pattern = "{left} {op} {right}"
    in_brackets_of = (("right", ("sum",)),)

    left: Value
    op: Literal["+", "-"]
    right: Value


class Product(Phrase):
    """`2 * width`, `speed / 2 s`: the product or quotient of two values; its dimension is that of the result."""

    pattern = "{left} {op} {right}"
    in_brackets_of = (
        ("left", ("sum",)),
        ("right", ("sum", "product")),
    )

    left: Value
    op: Literal["*", "/"]
    right: Value


class Negative(Phrase):
    """`-gap`: the negative of a parameter or a calculation; `-2 m` is a number."""

    pattern = "-{value}"
    in_brackets_of = (("value", ("sum", "product", "negative")),)

    value: Value


class Extreme(Phrase):
    """`min(gap, 2 s)`, `max(a, b, c)`: the smallest, or the largest, of values of one dimension."""

    pattern = "{which}({values:, })"
    words = """
        min (constant): the smallest of some values | start at min(room, 40 m) along ego.route
        max (constant): the largest of some values | speed max(pace, 20 km/h)
    """

    which: Literal["min", "max"]
    values: tuple[Value, ...] = Field(min_length=2)


Expression = Sum | Product | Negative | Extreme
"""A value that is calculated from others; like a `Ref`, it is replaced by its result in a concrete scenario."""
EXPRESSIONS = (Sum, Product, Negative, Extreme)
AnyValue = Quantity | Ref | Expression


class Calculated(Quantity, kind=""):
    """An expression in a parameter's statement, with its result for the defaults of the other parameters."""

    pattern = "{expression}"

    expression: Expression | Ref

    @property
    def plain(self) -> Quantity:
        """The value without its expression, as a case has it."""
        return Quantity(value=self.value, unit=self.unit)


@cache
def _adapter(also: tuple[type[Item], ...]) -> TypeAdapter[Any]:
    union: Any = Union[(AnyValue, *also)]
    return TypeAdapter(union)


class WrongDimensionError(ValueError):
    """Raised for a value whose dimension is not the needed one."""

    def __init__(self, value: Quantity, needed: Dimension) -> None:
        written = f"{value.value:f} {value.unit or '(no unit)'}"
        super().__init__(f"needs {needed}, but {written} is {value.dimension}")
        self.needed = needed


@dataclass(frozen=True)
class OfDimension:
    """Marks the type of values of one dimension (None: any dimension); a count is a whole number.

    `checks.values` checks parameters and expressions, because it knows the types of the parameters.

    Attributes:
        also: other classes that are allowed.
    """

    dimension: Dimension | None
    also: tuple[type[Item], ...] = ()

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        # One function checks all classes of values: pydantic would build a validator for each of them, in every class
        # that has such a field, which costs more time.
        del source, handler
        return checked_by(self._check)

    def _check(self, value: object) -> object:
        if isinstance(value, Quantity):
            return value if self.dimension is None else self._fitting(value)
        if isinstance(value, (Ref, *EXPRESSIONS, *self.also)):
            return value
        if isinstance(value, Mapping):
            item = _adapter(self.also).validate_python(value)
            return self._fitting(item) if isinstance(item, Quantity) else item
        raise PydanticCustomError("no_value", "needs a value with its unit")

    def _fitting(self, value: Quantity) -> Quantity:
        dimension, needed = value.dimension, self.dimension
        if needed is not None and dimension != needed and not (needed == "count" and dimension == "ratio"):
            raise WrongDimensionError(value, needed)
        if needed == "count" and (value.value != value.value.to_integral_value() or value.value < 0):
            raise ValueError(f"needs a whole number, but {value.value:f} is not")
        return value


Value = Annotated[AnyValue, OfDimension(None)]
Time = Annotated[Value, OfDimension("time")]
Duration = Annotated[Time, Bounds(0.0)]
Length = Annotated[Value, OfDimension("length")]
Speed = Annotated[Value, OfDimension("speed")]
Acceleration = Annotated[Value, OfDimension("acceleration")]
Angle = Annotated[Value, OfDimension("angle")]
AngularRate = Annotated[Value, OfDimension("angular_rate")]
Mass = Annotated[Value, OfDimension("mass")]
Ratio = Annotated[Value, OfDimension("ratio")]
Count = Annotated[Value, OfDimension("count")]

Turn = Literal["straight", "left", "right", "back"]


class Point(Phrase):
    """`(61.90 m, 101.55 m)`: a point in world coordinates, x to the east and y to the north."""

    pattern = "({x}, {y})"

    x: Length
    y: Length


class AlongEdge(Phrase):
    """`30 m along west offset 3.5 m`: a distance from an edge's start; a negative one counts back from its end.

    The offset is sideways from the centre of the edge's rightmost car lane, left positive.
    """

    pattern = "{at} along {edge} [offset {offset}]"
    words = """
        along (link): before the edge or the actor's route on which a distance is measured | 20 m along ego.route
        offset (link): before a lateral distance, left positive | 30 m along west offset 1 m
    """

    edge: RoadId
    at: Length
    offset: Length | None = None


class AlongRoute(Phrase):
    """`45 m along ego.route offset -4 m`: a distance along an actor's route, measured from where that actor starts.

    The offset is sideways from the route's centreline, left positive.
    """

    pattern = "{at} along {actor}.route [offset {offset}]"

    actor: ActorName
    at: Length
    offset: Length | None = None


class PastJunction(Phrase):
    """`12 m past j4 on ego.route offset -1 m`, or `before`: a distance along an actor's route, measured from where the
    route leaves (`past`) or enters (`before`) the junction."""

    pattern = "{at} {side} {junction} on {actor}.route [offset {offset}]"
    words = """
        past (link): before the junction behind which a distance is measured | 12 m past j4 on ego.route
        on (link): before the road or the actor's route that has the place | 12 m past j4 on ego.route
    """

    actor: ActorName
    junction: JunctionId
    side: Literal["past", "before"]
    at: Length
    offset: Length | None = None


class AheadOf(Phrase):
    """`10 m ahead of bus offset 1 m`: a distance from an actor's front along its way: its route, its path, or straight
    on.

    The place has the actor's lateral position plus the offset (left positive). At the beginning it is measured from the
    actor's start, in conditions and actions from its position then; the same holds for the places below.
    """

    pattern = "{at} ahead of {actor} [offset {offset}]"
    words = """
        ahead (condition): beyond the front of an actor, along that actor's way | ego ahead of lead
    """

    actor: ActorName
    at: Length
    offset: Length | None = None


class BehindOf(Phrase):
    """`10 m behind bus offset 1 m`: a distance from an actor's rear, backwards along its way."""

    pattern = "{at} behind {actor} [offset {offset}]"
    words = """
        behind (condition): short of the rear of an actor, along that actor's way | lead behind ego
    """

    actor: ActorName
    at: Length
    offset: Length | None = None


class Beside(Phrase):
    """`beside bus left 1.5 m`: a distance to the left or right of an actor's side, level with its middle."""

    pattern = "beside {actor} {side} {at}"
    words = "beside (link): a place to the side of an actor, level with its middle | start at beside ego left 1.5 m"

    actor: ActorName
    side: Literal["left", "right"] | Ref
    at: Length


class PlaceOf(Phrase):
    """`the place of bus`: an actor's position: the middle of its front (of a pedestrian or obstacle, its middle)."""

    pattern = "the place of {actor}"
    words = """
        the (link): the first word of `the place of` | ego within 5 m of the place of bus
        place (link): the position of an actor | ego within 5 m of the place of bus
    """

    actor: ActorName


class AtStop(Phrase):
    """A bus stop of the network, by its name: the place of the front of a vehicle that stops there."""

    pattern = "{stop}"

    stop: Annotated[Id, Names("stop")]


OfActor = AheadOf | BehindOf | Beside | PlaceOf
"""Places relative to an actor: to its start, or in conditions and actions to its position then."""
Place = Annotated[Point | AlongEdge | AlongRoute | PastJunction | AheadOf | BehindOf | Beside | PlaceOf, ONE_OF]
StopOrPlace = Annotated[
    AtStop | Point | AlongEdge | AlongRoute | PastJunction | AheadOf | BehindOf | Beside | PlaceOf, ONE_OF
]
