"""Scenarios: a logical one has parameters and cases, a concrete one only values."""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

from pydantic import Field

from foresee_dsl.language.model.actors import Actor, Ego, Traffic, When
from foresee_dsl.language.model.conditions import Condition
from foresee_dsl.language.model.network import Doc, Network
from foresee_dsl.language.model.values import ONE_OF, FilePath, Id, Item, Name, Quantity, Ratio, Ref, Time

ParamType = Literal[
    "time",
    "length",
    "speed",
    "acceleration",
    "angle",
    "ratio",
    "count",
    "arm",
    "turn",
    "model",
    "junction",
    "stage",
    "side",
]
ParamValue = Quantity | Id
"""A quantity, or a word: a road (arm), a turn, a model's name, a junction, a stage, a side."""


class Tags(Item):
    """`tags [scenario7, junction]`; the tag `scenarioN` is the family in the paper's table of scenarios."""

    kind: Literal["tags"] = "tags"
    names: tuple[Name, ...]


class UseNetwork(Item):
    """`use network "networks/town.foresee"` (also `.net.xml`, `.xodr`), relative to the file that says it."""

    kind: Literal["use_network"] = "use_network"
    path: FilePath


class UseModels(Item):
    """`use models "models.foresee"`: a catalogue in addition to the bundled one; its entries win."""

    kind: Literal["use_models"] = "use_models"
    path: FilePath


class Range(Item):
    """`0 s..4 s step 0.1 s`."""

    low: Quantity
    high: Quantity
    step: Quantity | None = None


class Uniform(Item):
    """`as uniform`: every value of the range (every step, every option) is as likely; the default."""

    kind: Literal["uniform"] = "uniform"


class Normal(Item):
    """`as normal(1.5 s, 0.4 s)`: mean and standard deviation, cut off at the ends of the range."""

    kind: Literal["normal"] = "normal"
    mean: Quantity
    deviation: Quantity


class Choice(Item):
    """`as choice(3, 1)`: how often each option is drawn, relative to the others."""

    kind: Literal["choice"] = "choice"
    weights: tuple[Quantity, ...] = Field(min_length=1)


class Grid(Item):
    """`as grid`: nothing is drawn; the steps (or options) are taken in turn, so that every combination of all grids
    comes before one comes again."""

    kind: Literal["grid"] = "grid"


Distribution = Annotated[Uniform | Normal | Choice | Grid, ONE_OF]


class Param(Item):
    """`param gap: time = 1.5 s in 0 s..4 s step 0.1 s as normal(1.5 s, 0.4 s)`, `param approach: arm = south in [south,
    east]`."""

    kind: Literal["param"] = "param"
    name: Name
    type: ParamType
    default: ParamValue
    range: Range | None = None
    options: Annotated[tuple[ParamValue, ...], Field(min_length=1)] | None = None
    distribution: Distribution | None = None
    """How `cases ... from seed` and `foresee sample` draw its values."""


class Require(Item):
    """`require gap < 2 s or approach is south`: what the values of a case must satisfy, written and drawn ones."""

    kind: Literal["require"] = "require"
    condition: Condition


class Cases(Item):
    """`cases 20 from seed 7`: so many cases with drawn values, called `seed7_01`, `seed7_02`, ..."""

    kind: Literal["cases"] = "cases"
    count: Quantity
    seed: Quantity


class Weather(Item):
    """`weather rain 0.3, wetness 0.4`: ratios from 0 to 1. Wetness lowers the friction; the rest is for sensors."""

    kind: Literal["weather"] = "weather"
    rain: Ratio | None = None
    fog: Ratio | None = None
    wetness: Ratio | None = None
    sun: Ratio | None = None


class Expect(Item):
    """`expect never collision(ego)`, `expect always ttc(ego, lead) > 1 s`, `expect eventually within 60 s
    arrived(ego)`."""

    kind: Literal["expect"] = "expect"
    name: Name | None = None
    """What `extends`, mutants and messages call it by: `expect safe: always ttc(ego, lead) > 1 s`."""
    mode: Literal["never", "always", "eventually"]
    within: Time | None = None
    condition: Condition


class End(Item):
    """`end after 60 s`."""

    kind: Literal["end"] = "end"
    after: Time


class Assignment(Item):
    """`gap = 1.2 s` inside a case."""

    name: Name
    value: ParamValue


class Case(Item):
    """`case r01 { approach = south; gap = 1.2 s }`: one test case."""

    kind: Literal["case"] = "case"
    name: Name
    values: tuple[Assignment, ...] = ()


class SignalState(Item):
    """`signal j4 stage ns_go elapsed 11.35 s`: what a junction's signal shows at the beginning.

    For a signal that the language wrote, and of an OpenDRIVE map, the stage's name, and time since its green began
    (amber and all red follow the green and belong to the stage); for one of a SUMO net, the phase's index as `phase_N`,
    with time since it began.
    """

    kind: Literal["signal"] = "signal"
    junction: Id | Ref
    stage: Id | Ref
    elapsed: Time


_Statement = (
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
    | Cases
)
Statement = Annotated[_Statement, ONE_OF]
"""What a scenario says besides `doc` and `tags`: what one that extends another can add and replace."""

ScenarioItem = Annotated[Doc | Tags | _Statement, ONE_OF]

_T = TypeVar("_T", bound=Item)


class Scenario(Item):
    """`scenario red_light_runner { ... }`; the body keeps the author's order."""

    kind: Literal["scenario"] = "scenario"
    name: Name
    body: tuple[ScenarioItem, ...]

    def all(self, kind: type[_T]) -> tuple[_T, ...]:
        """Return the items of one kind, in the author's order."""
        return tuple(item for item in self.body if isinstance(item, kind))

    def one(self, kind: type[_T]) -> _T | None:
        """Return the first item of one kind, or None."""
        return next(iter(self.all(kind)), None)

    @property  # not cached: `model_copy` would carry the old actors into a copy with another body
    def actors(self) -> tuple[Ego | Actor, ...]:
        """The ego (first) and the named actors."""
        return self.all(Ego) + self.all(Actor)

    @property
    def family(self) -> str:
        """The paper's family, such as `3` for the tag `scenario3`; empty without such a tag."""
        tags = self.one(Tags)
        names = tags.names if tags else ()
        return next((t.removeprefix("scenario") for t in names if t.startswith("scenario") and t[8:].isdigit()), "")
