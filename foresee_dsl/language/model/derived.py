"""Files that build on another one and state only the differences (extensions, clips, mutants), and the properties that
`change` may name.

The parser, the checks, the editor and `language.project.changes`, which applies a change, all read `PROPERTIES` and
`OWNERS`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Literal

from foresee_dsl.language.model import actors as a
from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.actions import HARDEST_MPS2, WIDEST_LINE_M
from foresee_dsl.language.model.item import ONE_OF, Block, Item, Names
from foresee_dsl.language.model.network import Doc
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.model.scenario import Expected, ParamValue, SignalState, Slippery, Statement, Tags
from foresee_dsl.language.model.triggers import When
from foresee_dsl.language.units import Dimension

# ---- what a change may name -----------------------------------------------------------------------------------------


NOTHING = "nothing"
"""The value of `ignores` for an actor that obeys all rules."""
USUAL = "usual"
"""The value of `style` for an actor that drives as its model says."""


@dataclass(frozen=True, slots=True)
class Property:
    """A property of an actor that can change.

    Attributes:
        statement: the class of the statement in the actor's block with this property, and its field; None if the actor
            itself has a field of the property's name.
        neutral: the value for an actor without the statement; None if such an actor has nothing to change.
        accepts: function that returns whether a value, in SI units, is allowed.
        needs: the allowed values in words, for messages.
        for_ego: True if the ego's property can change too, although the driver under test drives it.
        timed: True if a change may state a start and a duration.
        words: the allowed words, first the one for an actor without the statement; empty for other values.
    """

    statement: tuple[type[Item], str] | None = None
    neutral: float | None = None
    accepts: Callable[[float], bool] = lambda _: True
    needs: str = ""
    for_ego: bool = False
    timed: bool = False
    words: tuple[str, ...] = ()

    @property
    def dimension(self) -> Dimension | None:
        """The dimension of its value; None for the name of a model."""
        return form_of(*self.statement).dimension if self.statement is not None else None

    @property
    def default(self) -> v.Quantity | None:
        """The value for an actor without the statement, as a quantity."""
        dimension = self.dimension
        return v.Quantity.of(self.neutral, dimension, 0) if dimension is not None and self.neutral is not None else None


@dataclass(frozen=True, slots=True)
class Owner:
    """A target of `change` other than an actor.

    Attributes:
        properties: the words that may follow the dot; empty if the name of a parameter or an expectation follows it.
        dimension: the dimension of the values; None if it depends on the name.
        not_in_clips: the reason why a mutant cannot change it, worded so that it can follow `a clip` in a message; ""
            if a mutant can change it.
    """

    properties: tuple[str, ...] = ()
    dimension: Dimension | None = None
    not_in_clips: str = ""


PROPERTIES: Mapping[str, Property] = MappingProxyType(
    {
        "model": Property(for_ego=True),
        "steer": Property(
            (a.Steers, "value"),
            0,
            lambda share: -1 <= share <= 1,
            "steering is a share of the largest angle, from -1 (right) to 1 (left)",
            timed=True,
        ),
        "timing": Property((a.Timing, "factor"), 1, lambda factor: factor > 0, "timing must be a factor above zero"),
        "speed": Property(
            (a.CruiseSpeed, "speed"), None, lambda speed: speed >= 0, "a speed must be zero or more", for_ego=True
        ),
        "delay": Property((a.Delay, "time"), 0, lambda delay: delay >= 0, "a delay must be zero or more"),
        "line": Property(
            (a.Line, "left"),
            0,
            lambda left: -WIDEST_LINE_M <= left <= WIDEST_LINE_M,
            f"a line is at most {WIDEST_LINE_M:g} m to the left (positive) or right of the actor's way",
            timed=True,
        ),
        "brakes": Property(
            (a.Brakes, "braking"), 0, lambda b: 0 <= b <= HARDEST_MPS2, "braking is from 0 to 12 m/s^2", timed=True
        ),
        "ignores": Property((a.IgnoresRule, "what"), words=(NOTHING, "signals", "priority")),
        "style": Property((a.Style, "manner"), words=(USUAL, "takes_gap", "brakes_late", "creeps")),
        "moving": Property(
            (a.Walked, "along"),
            None,
            lambda along: along >= 0,
            "the length that it has covered on its path must be zero or more",
        ),
    }
)
"""The properties of actors. In a clip, `speed` is the speed of the actor's state; elsewhere it is the cruise speed."""

OWNERS: Mapping[str, Owner] = MappingProxyType(
    {
        "weather": Owner(("rain", "fog", "wetness", "sun"), "ratio"),
        "expect": Owner(),
        "param": Owner(not_in_clips="has no parameters"),
        "end": Owner(("after",), "time", not_in_clips="ends with its window"),
    }
)
"""Targets other than actors; no actor can have one of these names."""


def changeable_of(owner: str) -> tuple[str, ...]:
    """Return the properties that a `change` line may name for an actor or owner; empty if any name is allowed."""
    return OWNERS[owner].properties if owner in OWNERS else tuple(PROPERTIES)


class Change(Item):
    """`change runner.model: car.compact => car.sports`, `change runner.steer: 0.00 => 0.12 from 4.00 s for 1.00 s`: one
    value changes.

    Properties of an actor: `model`; `steer` (-1 right to 1 left, a share of the largest steering angle, from `start` of
    the clip, for `duration`); `timing` (a factor on the speed along its own path); `speed` (at the clip's start; in a
    scenario the cruise speed); `delay` (the time for which it stands longer); `line` (the distance that it keeps to the
    left of its way, on a lane from `start` for `duration`); `brakes` (a deceleration, from `start` for `duration`);
    `ignores` (`nothing`, `signals`, `priority`); `moving` (the length along its path at which it begins); `style`
    (`usual`, `takes_gap`, `brakes_late`, `creeps`). Other properties are `weather.rain` and the like; `expect.NAME`,
    the number that a named expectation compares with; and, in a scenario that extends another, `param.NAME`, a
    parameter's default, and `end.after`.
    """

    pattern = "change {actor}.{property}: {was} => {now} [from {start}] [for {duration}]"
    words = """
        change (statement): one change: WAS => NOW in a mutant, a whole statement in an extension
            | change runner.timing: 1.00 => 0.80
    """

    actor: v.ActorName
    """Name of the actor, or one of `weather`, `expect`, `param` and `end`."""
    property: v.Name
    was: Annotated[ParamValue | v.Expression, Names("model")]
    now: Annotated[ParamValue | v.Expression, Names("model")]
    start: v.Duration | None = None
    duration: v.Duration | None = None


# ---- scenarios that extend another ----------------------------------------------------------------------------------

Droppable = Literal[
    "param",
    "weather",
    "slippery",
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
    """`add vehicle late: car.compact { ... }`: adds a statement to the extended scenario."""

    pattern = "add {item}"
    words = "add (statement): a statement that the extended scenario does not have | add weather rain 0.3"

    item: Statement


class Replace(Item):
    """`change vehicle runner: car.suv { ... }`: replaces the statement of the same kind and name.

    A statement that a scenario has at most once (the ego, the network, `weather`, `end`) needs no name; a `when` or
    `expect` needs one.
    """

    pattern = "change {item}"

    item: Statement


class Drop(Item):
    """`drop vehicle runner`, `drop when late`, `drop weather`, `drop cases`: removes a statement of the extended
    scenario; `drop cases` removes the statement that draws cases."""

    pattern = "drop {what} [{name}]"
    words = "drop (statement): a statement of the extended scenario that this one does not have | drop vehicle runner"

    what: Droppable
    name: v.Id | None = None


ExtensionItem = Annotated[Doc | Tags | Expected | Add | Replace | Change | Drop, ONE_OF]


class Extension(Block):
    """`scenario wet_runner extends "runner.foresee" { ... }`: the other scenario with its cases, and these differences.

    The result has this file's `doc`, `tags` and `expected`; if this file has no tags, it has the other scenario's tags.
    """

    pattern = "scenario {name} extends {parent} { ...body }"
    words = 'extends (link): before the scenario from which this one differs | wet extends "dry.foresee"'

    name: v.Name
    parent: v.FilePath
    body: tuple[ExtensionItem, ...]


class _AnyName(frozenset[str]):
    """A set that holds every name."""

    def __contains__(self, name: object) -> bool:
        return True


ANY_NAME: frozenset[str] = _AnyName()
"""The parameters of a scenario that extends another: any word may be a parameter of the extended scenario, which is in
another file.

A word that is not a parameter becomes a name again when the two scenarios are joined (`extend.extended`).
"""


# ---- clips and mutants ----------------------------------------------------------------------------------------------


class Window(Item):
    """`window 12.40 s..22.40 s`: the part of the parent's run that the clip contains, in the parent's time."""

    pattern = "window {start}..{end}"
    words = "window (statement): the seconds of the parent's run that a clip contains | window 12.40 s..22.40 s"

    start: v.Time
    end: v.Time


class Risk(Item):
    """`risk "critical crossing: ..."`: the forecaster's sentence about why this part of the run is risky."""

    pattern = "risk {text} [at {at}] [with {actor}] [by {operator}]"
    words = """
        risk (statement): the forecaster's sentence about the risk
            | risk "critical crossing ahead" at 17.40 s with runner
        with (link): before the actor that the risk, the meeting or the failure is about
            | risk "..." at 17.40 s with runner
        by (link): before the operator that is proposed for the first mutation
            | risk "..." at 17.40 s with runner by steer
    """

    text: v.Text
    at: v.Time | None = None
    """The risky point in the parent's time: `risk "..." at 17.40 s`."""
    actor: v.ActorName | None = None
    """The actor that the risk is about: `risk "..." at 17.40 s with runner`."""
    operator: v.Name | None = None
    """The mutation operator that is proposed for this actor: `risk "..." at 17.40 s with runner by steer`."""


class Goal(Item, kind="clip_goal"):
    """`goal (118.30 m, 40.10 m)`: where the ego's route ends in the clip. It is the waypoint of the route that is
    nearest to the position of the parent's ego at the end of the window."""

    pattern = "goal {at}"

    at: v.Point


class Fidelity(Item):
    """`fidelity 0.00 m ego 0.12 m`: largest distance between the run of the unmutated clip and its parent's run.

    The first length is for the other actors, the second for the ego, whose driver starts without its memory. Without a
    second length, the first one is for all actors.
    """

    pattern = "fidelity {deviation} [ego {ego}]"
    words = """
        fidelity (statement): the largest distance between the run of the unmutated clip and its parent's run
            | fidelity 0.00 m ego 0.12 m
    """

    deviation: v.Length
    ego: v.Length | None = None


ClipItem = Annotated[
    Doc | Expected | Window | Risk | a.Ego | Goal | Slippery | a.Actor | SignalState | When | Fidelity, ONE_OF
]


class Clip(Block):
    """`clip NAME of "parent.foresee" case r02 pin sha256:... { ... }`.

    The network, models, weather and expectations are the parent's; the clip contains everything that moves.
    """

    pattern = "clip {name} of {parent} [case {case}] pin {pin} { ...body }"
    words = """
        clip (definition): an exact snapshot of some seconds of a run, with a pin of its parent
            | clip runner_p1 of "runner.foresee" case r02 pin sha256:5ef2c6120a41 { ... }
        pin (link): the hash of what the parent means | pin sha256:5ef2c6120a41
    """

    name: v.Name
    parent: v.FilePath
    case: Annotated[v.Name, Names("case")] | None = None
    pin: v.Pin
    body: tuple[ClipItem, ...]

    @property
    def start_s(self) -> float:
        """Beginning of its window, in the parent's time, s."""
        window = self.first(Window)
        return window.start.si if window and isinstance(window.start, v.Quantity) else 0.0

    @property
    def end_s(self) -> float:
        """End of its window, in the parent's time, s; infinite if it has none."""
        window = self.first(Window)
        return window.end.si if window and isinstance(window.end, v.Quantity) else math.inf

    @property
    def risk(self) -> Risk | None:
        """The forecaster's sentence, if any."""
        return self.first(Risk)


class Origin(Item):
    """The source of a mutant: its tool, driver, operators and results. None of these lines changes the mutant's
    meaning."""

    pattern = (
        "origin { operator; preset; seed; why; tool; driver; goal; found; minimised; preventable; anticipating; "
        "avoided }"
    )
    words = """
        origin (statement): where a mutant comes from; it has no effect on the run
            | origin { operator [steer]; seed 91 }
        operator (statement): the operators that made the changes | operator [model_swap, steer]
        preventable (setting): whether a careful driver that brakes would have prevented the failure | preventable yes
        anticipating (setting): how a driver that anticipates would have prevented the failure | anticipating braking
        avoided (setting): the other drivers that avoid the failure, and how | avoided "idm brakes 0.8 s earlier"
        why (setting): the reason for which the mutant was proposed
            | why "steer of van from 2.0 s: 9 of 41 changes reach the ego"
        tool (setting): the version of the tool that wrote the mutant | tool "0.1.0"
        driver (setting): the driver that was under test | driver "pdm 2"
        found (setting): the failure of the mutant's run | found "F4 lateral collision with runner at 3.15 s"
        minimised (setting): how the mutant was made smaller | minimised "3 changes to 2"
        yes (constant): the careful driver would have prevented it | preventable yes
        no (constant): the careful driver would not have prevented it | preventable no
        unknown (constant): whether the careful driver would have prevented it is not known | preventable unknown
        evading (constant): the driver that anticipates would have steered into free space | anticipating evading
        undecided (constant): whether the driver that anticipates would have prevented it is not decided
            | anticipating undecided
    """

    operator: tuple[v.Name, ...] = ()
    preset: v.Name | None = None
    seed: v.Quantity | None = None
    why: v.Text | None = None
    tool: v.Text | None = None
    driver: v.Text | None = None
    goal: v.Name | None = None
    found: v.Text | None = None
    minimised: v.Text | None = None
    preventable: Literal["yes", "no", "unknown"] | None = None
    anticipating: Literal["braking", "evading", "ahead", "no", "undecided"] | None = None
    avoided: v.Text | None = None


MutantItem = Annotated[Doc | Change | Expected | Origin, ONE_OF]
FOR_PEOPLE = (Doc, Tags, Risk, Fidelity, Expected, Origin)
"""Statements for people, which have no meaning: the hash and comparisons of files leave them out."""


class Mutant(Block):
    """`mutant NAME of "clip.foresee" pin sha256:... { change ...; origin { ... } }`."""

    pattern = "mutant {name} of {parent} pin {pin} { ...body }"
    words = """
        mutant (definition): a clip, which it pins, with a few changes
            | mutant runner_p1_m3 of "runner_p1.foresee" pin sha256:c347e6a70b92 { ... }
    """

    name: v.Name
    parent: v.FilePath
    pin: v.Pin
    body: tuple[MutantItem, ...]

    @property
    def changes(self) -> tuple[Change, ...]:
        """The change lines, in order."""
        return self.all(Change)

    @property
    def origin(self) -> Origin | None:
        """The origin block, if any."""
        return self.first(Origin)
