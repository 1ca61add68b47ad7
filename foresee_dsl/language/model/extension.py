"""Scenarios that extend another: the file says only what is different."""

from __future__ import annotations

from typing import Annotated, Literal

from foresee_dsl.language.model.derived import Change
from foresee_dsl.language.model.item import ONE_OF, Item
from foresee_dsl.language.model.network import Doc
from foresee_dsl.language.model.scenario import Statement, Tags
from foresee_dsl.language.model.values import FilePath, Id, Name

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

    pattern = "add {item}"
    words = "add (statement): one statement more than in the extended scenario | add weather rain 0.3"

    kind: Literal["add"] = "add"
    item: Statement


class Replace(Item):
    """`change vehicle runner: car.suv { ... }`: the statement of the same kind and name is this one now.

    A statement that a scenario has at most once (the ego, the network, `weather`, `end`) needs no name; a `when` or
    `expect` needs one.
    """

    pattern = "change {item}"

    kind: Literal["replace"] = "replace"
    item: Statement


class Drop(Item):
    """`drop vehicle runner`, `drop when late`, `drop weather`, `drop cases` (the drawn ones)."""

    pattern = "drop {what} [{name}]"
    words = "drop (statement): a statement of the extended scenario that is not in this one | drop vehicle runner"

    kind: Literal["drop"] = "drop"
    what: Droppable
    name: Id | None = None


ExtensionItem = Annotated[Doc | Tags | Add | Replace | Change | Drop, ONE_OF]


class Extension(Item):
    """`scenario wet_runner extends "runner.foresee" { ... }`: the other scenario with its cases, and these differences.

    `doc` and `tags` are its own; tags that it does not give are the other's.
    """

    pattern = "scenario {name} extends {parent} { ...body }"
    words = 'extends (link): the scenario is another one, with the differences that follow | wet extends "dry.foresee"'

    kind: Literal["extension"] = "extension"
    name: Name
    parent: FilePath
    body: tuple[ExtensionItem, ...]
