"""Scenarios that extend another: the file says only what is different."""

from __future__ import annotations

from typing import Annotated, Literal

from foresee_dsl.language.model.actors import Actor, Ego, Traffic, When
from foresee_dsl.language.model.derived import Change
from foresee_dsl.language.model.network import Doc, Network
from foresee_dsl.language.model.scenario import (
    Case,
    Cases,
    End,
    Expect,
    Param,
    Require,
    SignalState,
    Tags,
    UseModels,
    UseNetwork,
    Weather,
)
from foresee_dsl.language.model.values import ONE_OF, FilePath, Id, Item, Name

Statement = Annotated[
    UseNetwork
    | UseModels
    | Network
    | Param
    | Require
    | Weather
    | Ego
    | Actor
    | Traffic
    | SignalState
    | When
    | Expect
    | End
    | Case
    | Cases,
    ONE_OF,
]
"""What can be added to a scenario or replaced in one."""

Droppable = Literal[
    "param",
    "weather",
    "vehicle",
    "bicycle",
    "pedestrian",
    "obstacle",
    "traffic",
    "signal",
    "when",
    "expect",
    "end",
    "case",
    "cases",
]


class Add(Item):
    """`add vehicle late: car.compact { ... }`: one statement more."""

    kind: Literal["add"] = "add"
    item: Statement


class Replace(Item):
    """`change vehicle runner: car.suv { ... }`: the statement of the same kind and name is this one now.

    What stands once at most (the ego, the network, `weather`, `end`) needs no name; a `when` or `expect` needs one.
    """

    kind: Literal["replace"] = "replace"
    item: Statement


class Drop(Item):
    """`drop vehicle runner`, `drop when late`, `drop weather`, `drop cases` (the drawn ones)."""

    kind: Literal["drop"] = "drop"
    what: Droppable
    name: Id | None = None


ExtensionItem = Annotated[Doc | Tags | Add | Replace | Change | Drop, ONE_OF]


class Extension(Item):
    """`scenario wet_runner extends "runner.foresee" { ... }`: the other scenario with its cases, and these differences.

    `doc` and `tags` are its own; tags that it does not give are the other's.
    """

    kind: Literal["extension"] = "extension"
    name: Name
    parent: FilePath
    body: tuple[ExtensionItem, ...]
