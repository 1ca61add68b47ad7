"""What a `change` line may name: the properties of actors, and those of weather, end, expectations and parameters.

The parser, the checks, the editor and `language.changes`, which makes the change, all read these two tables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from types import MappingProxyType

from foresee_dsl.language.model.actors import (
    WIDEST_LINE_M,
    CruiseSpeed,
    Delay,
    Line,
    Steers,
    Timing,
    Walked,
)
from foresee_dsl.language.model.item import Item
from foresee_dsl.language.model.values import Quantity
from foresee_dsl.language.units import Dimension


@dataclass(frozen=True, slots=True)
class Property:
    """A property of an actor that can change.

    Attributes:
        dimension: of its value; None for the name of a model.
        statement: the class of the statement in the actor's block that gives it, and its field; None where the actor
            itself has a field of the property's name.
        default: what an actor without the statement has; None where such an actor has nothing to change.
        accepts: whether a value in SI is one that the property takes.
        needs: which values it takes, for the message.
        for_ego: the ego's can change too, although the driver under test drives it.
    """

    dimension: Dimension | None
    statement: tuple[type[Item], str] | None = None
    default: Quantity | None = None
    accepts: Callable[[float], bool] = lambda _: True
    needs: str = ""
    for_ego: bool = False


@dataclass(frozen=True, slots=True)
class Owner:
    """What a `change` may name that is no actor.

    Attributes:
        properties: the words behind the dot; empty for the name of a parameter or an expectation.
        dimension: of their values; None where that depends on which one is named.
        not_in_clips: why a mutant cannot change it; "" where it can.
    """

    properties: tuple[str, ...] = ()
    dimension: Dimension | None = None
    not_in_clips: str = ""


PROPERTIES: Mapping[str, Property] = MappingProxyType(
    {
        "model": Property(None, for_ego=True),
        "steer": Property(
            "ratio",
            (Steers, "value"),
            Quantity(value=Decimal(0)),
            lambda share: -1 <= share <= 1,
            "steering is a share of the largest angle, from -1 (right) to 1 (left)",
        ),
        "timing": Property(
            "ratio",
            (Timing, "factor"),
            Quantity(value=Decimal(1)),
            lambda factor: factor > 0,
            "timing is a ratio over zero",
        ),
        "speed": Property(
            "speed", (CruiseSpeed, "speed"), None, lambda speed: speed >= 0, "a speed is zero or more", for_ego=True
        ),
        "delay": Property(
            "time",
            (Delay, "time"),
            Quantity(value=Decimal(0), unit="s"),
            lambda delay: delay >= 0,
            "a delay is zero or more",
        ),
        "line": Property(
            "length",
            (Line, "left"),
            Quantity(value=Decimal(0), unit="m"),
            lambda left: -WIDEST_LINE_M <= left <= WIDEST_LINE_M,
            f"a line is at most {WIDEST_LINE_M:g} m to the left (positive) or right of the actor's way",
        ),
        "moving": Property(
            "length",
            (Walked, "along"),
            None,
            lambda along: along >= 0,
            "how far it has come along its path is zero or more",
        ),
    }
)
"""The properties of actors. A clip's actor has its speed in its state; elsewhere it is the cruise speed."""

OWNERS: Mapping[str, Owner] = MappingProxyType(
    {
        "weather": Owner(("rain", "fog", "wetness", "sun"), "ratio"),
        "expect": Owner(),
        "param": Owner(not_in_clips="has no parameters"),
        "end": Owner(("after",), "time", not_in_clips="ends with its window"),
    }
)
"""What is no actor; no actor can have one of these names."""


def changeable_of(owner: str) -> tuple[str, ...]:
    """Return the properties that a `change` line may name of an actor or owner; none where any name may stand."""
    return OWNERS[owner].properties if owner in OWNERS else tuple(PROPERTIES)
