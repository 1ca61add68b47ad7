"""Values: quantities with units, names, references to parameters, points and places."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from functools import cache
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, SerializationInfo, TypeAdapter
from pydantic_core import CoreSchema, core_schema

from foresee_dsl.language.units import SI_WORD, UNITS, Dimension

NAME_PATTERN = r"[a-z][a-z0-9_]*"
"""snake_case: what every name in a file looks like. Ids of imported networks are written as strings instead."""

Name = Annotated[str, Field(pattern=rf"^{NAME_PATTERN}$", max_length=80)]
Id = Annotated[str, Field(min_length=1, max_length=200, pattern=r'^[^"\n\r\\]+$')]
"""A name, or the id of something in an imported network (printed as a string when it is no name)."""
ModelName = Annotated[str, Field(pattern=rf"^{NAME_PATTERN}\.{NAME_PATTERN}$", max_length=80)]
"""`class.variant`, such as `car.compact`: an entry of a catalogue."""
Text = Annotated[str, Field(max_length=2000, pattern=r'^[^"\n\r]*$')]
"""A string on one line, without double quotes."""
FilePath = Annotated[str, Field(min_length=1, max_length=500, pattern=r'^[^"\n\r]+$')]


class Item(BaseModel):
    """Base of everything that a file can say: immutable, compared by value, no unknown fields."""

    # A class's validator is built at its first use: a file uses a third of the classes.
    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)


class _OneOf:
    """Marks a union of items, told apart by their `kind`, whose parts are built only when they are used.

    Items are built bottom up, so that a part is nearly always an instance already, which was validated when it was
    made. With pydantic's own union, every class that holds a statement would build the validators of all statements.
    """

    def __get_pydantic_core_schema__(self, union: Any, handler: object) -> CoreSchema:  # noqa: ANN401 - a type form
        del handler
        kinds = get_args(union)

        @cache
        def whole() -> TypeAdapter[Item]:
            return TypeAdapter(Annotated[union, Field(discriminator="kind")])

        def check(value: object) -> object:
            return value if isinstance(value, kinds) else whole().validate_python(value)

        return core_schema.no_info_plain_validator_function(
            check, serialization=core_schema.plain_serializer_function_ser_schema(_dump, info_arg=True)
        )


def _dump(item: Item, info: SerializationInfo) -> dict[str, Any]:
    return item.model_dump(
        mode=info.mode,
        by_alias=info.by_alias,
        exclude_unset=info.exclude_unset,
        exclude_defaults=info.exclude_defaults,
        exclude_none=info.exclude_none,
        round_trip=info.round_trip,
    )


ONE_OF = _OneOf()
"""`Annotated[A | B, ONE_OF]`: one of these items."""


def _known_unit(word: str) -> str:
    if word and word not in UNITS:
        raise ValueError(f"unknown unit {word!r}")
    return word


class Quantity(Item):
    """A number and its unit as the author wrote them: `50 km/h`, `1.50 s`, `0.31`.

    `value` is decimal, so that the author's digits come back when it is printed. `unit` is a word of
    `units.UNITS`, or empty for a ratio or a count.
    """

    value: Decimal = Field(allow_inf_nan=False, ge=Decimal("-1e9"), le=Decimal("1e9"))
    unit: Annotated[str, AfterValidator(_known_unit)] = ""

    @property
    def dimension(self) -> Dimension:
        """The unit's dimension; `ratio` for a bare number (which may also stand where a count is asked)."""
        return UNITS[self.unit].dimension if self.unit else "ratio"

    @property
    def si(self) -> float:
        """The value in SI (radians for angles)."""
        return float(self.value) * (UNITS[self.unit].to_si if self.unit else 1.0)

    @classmethod
    def of(cls, si_value: float, dimension: Dimension, digits: int) -> Quantity:
        """Make a quantity from an SI value, in the unit of generated files, rounded to `digits` decimals."""
        word = SI_WORD[dimension]
        number = si_value / UNITS[word].to_si if word else si_value
        rounded = round(Decimal(repr(float(number))), digits)
        return cls(value=abs(rounded) if rounded == 0 else rounded, unit=word)


class Ref(Item):
    """The name of a parameter where a value may stand; gone once the scenario is concrete."""

    name: Name


def has_dimension(dimension: Dimension) -> Callable[[Quantity | Ref], Quantity | Ref]:
    """Return a validator of values: they have this dimension, and a count is a whole number."""

    def check(value: Quantity | Ref) -> Quantity | Ref:
        if isinstance(value, Ref):
            return value
        found = value.dimension
        if found != dimension and not (dimension == "count" and found == "ratio"):
            raise ValueError(f"needs {dimension}, but {value.value:f} {value.unit or '(no unit)'} is {found}")
        if dimension == "count" and (value.value != value.value.to_integral_value() or value.value < 0):
            raise ValueError(f"needs a whole number, but {value.value:f} is none")
        return value

    return check


Value = Quantity | Ref
Time = Annotated[Value, AfterValidator(has_dimension("time"))]
Length = Annotated[Value, AfterValidator(has_dimension("length"))]
Speed = Annotated[Value, AfterValidator(has_dimension("speed"))]
Acceleration = Annotated[Value, AfterValidator(has_dimension("acceleration"))]
Angle = Annotated[Value, AfterValidator(has_dimension("angle"))]
AngularRate = Annotated[Value, AfterValidator(has_dimension("angular_rate"))]
Mass = Annotated[Value, AfterValidator(has_dimension("mass"))]
Ratio = Annotated[Value, AfterValidator(has_dimension("ratio"))]
Count = Annotated[Value, AfterValidator(has_dimension("count"))]

Turn = Literal["straight", "left", "right", "back"]


class Point(Item):
    """`(61.90 m, 101.55 m)`: world coordinates, x east, y north."""

    kind: Literal["point"] = "point"
    x: Length
    y: Length


class AlongEdge(Item):
    """`30 m along west offset 3.5 m`: a distance from an edge's start; a negative one counts back from its end.

    The offset is sideways from the centre of the edge's rightmost car lane, left positive.
    """

    kind: Literal["along_edge"] = "along_edge"
    edge: Id | Ref
    at: Length
    offset: Length | None = None


class AlongRoute(Item):
    """`45 m along ego.route offset -4 m`: a distance along an actor's route, measured from where that actor starts.

    The offset is sideways from the route's centreline, left positive.
    """

    kind: Literal["along_route"] = "along_route"
    actor: Name
    at: Length
    offset: Length | None = None


class PastJunction(Item):
    """`12 m past j4 on ego.route offset -1 m`, or `before`: along an actor's route, from where it leaves
    (`past`) or enters (`before`) the junction."""

    kind: Literal["past_junction"] = "past_junction"
    actor: Name
    junction: Id | Ref
    side: Literal["past", "before"]
    at: Length
    offset: Length | None = None


Place = Annotated[Point | AlongEdge | AlongRoute | PastJunction, ONE_OF]
