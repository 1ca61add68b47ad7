"""Conditions: what triggers wait for and what expectations are about."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model.values import Id, Item, Name, Value


class Measure(Item):
    """A number that can be read off the running world.

    `time` (s since the start), `ego.speed` (m/s), `ego.eta(j4)` (s until the actor, at its speed and not under 1 m/s,
    enters the junction along its route; infinite when it has passed), `distance(a, b)` (m between footprints, or from
    `a` along its route to where it enters junction `b`), `ttc(a, b)` (s, constant velocities, footprints; infinite
    when they do not meet).
    """

    kind: Literal["measure"] = "measure"
    what: Literal["time", "speed", "eta", "distance", "ttc"]
    actor: Name | None = None
    other: Id | None = None
    """The second actor or the junction."""


class Comparison(Item):
    """`ego.eta(j4) < 4 s`."""

    kind: Literal["comparison"] = "comparison"
    left: Measure
    op: Literal["<", "<=", ">", ">="]
    right: Value


class Predicate(Item):
    """`collision(ego)` (it touches anything), `arrived(ego)` (it has reached its goal)."""

    kind: Literal["predicate"] = "predicate"
    what: Literal["collision", "arrived"]
    actor: Name


class Not(Item):
    """`not CONDITION`."""

    kind: Literal["not"] = "not"
    condition: Condition


class Both(Item):
    """`A and B and C`."""

    kind: Literal["and"] = "and"
    conditions: tuple[Condition, ...] = Field(min_length=2)


class Either(Item):
    """`A or B or C`; binds weaker than `and`, brackets as usual."""

    kind: Literal["or"] = "or"
    conditions: tuple[Condition, ...] = Field(min_length=2)


Condition = Annotated[Comparison | Predicate | Not | Both | Either, Field(discriminator="kind")]

Not.model_rebuild()
Both.model_rebuild()
Either.model_rebuild()
