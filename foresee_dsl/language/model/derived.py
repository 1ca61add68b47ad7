"""Clips and mutants: files that pin a parent and say only what is theirs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model.actors import Actor, Ego, When
from foresee_dsl.language.model.item import ONE_OF, Item, Names
from foresee_dsl.language.model.network import Doc
from foresee_dsl.language.model.scenario import ParamValue, SignalState
from foresee_dsl.language.model.values import ActorName, FilePath, Length, Name, Point, Quantity, Text, Time

Pin = Annotated[str, Field(pattern=r"^sha256:[0-9a-f]{12}$")]
"""The first twelve digits of the hash of the parent's meaning (`language.meaning`)."""


class Window(Item):
    """`window 12.40 s..22.40 s`: in the parent's time."""

    pattern = "window {start}..{end}"
    words = "window (statement): the seconds of the parent's run that a clip holds | window 12.40 s..22.40 s"

    kind: Literal["window"] = "window"
    start: Time
    end: Time


class Risk(Item):
    """`risk "critical crossing: ..."`: the forecaster's sentence."""

    pattern = "risk {text} [at {at}] [with {actor}]"
    words = """
        risk (statement): the forecaster's sentence | risk "what the forecaster saw" at 17.40 s with runner
        with (link): which actor the risk is about | risk "..." at 17.40 s with runner
    """

    kind: Literal["risk"] = "risk"
    text: Text
    at: Time | None = None
    """The risky point in the parent's time: `risk "..." at 17.40 s`."""
    actor: ActorName | None = None
    """`risk "..." at 17.40 s with runner`."""


class Goal(Item):
    """`goal (118.30 m, 40.10 m)`: the waypoint of the ego's route nearest to where the parent's ego was at the
    window's end."""

    pattern = "goal {at}"

    kind: Literal["clip_goal"] = "clip_goal"
    at: Point


class Fidelity(Item):
    """`fidelity 0.00 m ego 0.12 m`: how far the run of the unmutated clip is from its parent's, at most.

    The first length is about the other actors, the one behind `ego` about the ego, whose driver starts afresh. Without
    a second length, the first is about all actors.
    """

    pattern = "fidelity {deviation} [ego {ego}]"
    words = """
        fidelity (statement): how far the unmutated clip's run is from its parent's, at most
            | fidelity 0.00 m ego 0.12 m
    """

    kind: Literal["fidelity"] = "fidelity"
    deviation: Length
    ego: Length | None = None


ClipItem = Annotated[Doc | Window | Risk | Ego | Goal | Actor | SignalState | When | Fidelity, ONE_OF]


class Clip(Item):
    """`clip NAME of "parent.foresee" case r02 pin sha256:... { ... }`.

    The parent gives network, models, weather and expectations; everything that moves is in the clip.
    """

    pattern = "clip {name} of {parent} [case {case}] pin {pin} { ...body }"
    words = """
        clip (definition): an exact snapshot of seconds of a run, which pins its parent
            | clip runner_p1 of "runner.foresee" case r02 pin sha256:5ef2c6120a41 { ... }
        pin (link): the hash of what the parent means | pin sha256:5ef2c6120a41
    """

    kind: Literal["clip"] = "clip"
    name: Name
    parent: FilePath
    case: Annotated[Name, Names("case")] | None = None
    pin: Pin
    body: tuple[ClipItem, ...]

    @property
    def start_s(self) -> float:
        """Where its window begins, in the parent's time."""
        window = next((item for item in self.body if isinstance(item, Window)), None)
        return window.start.si if window and isinstance(window.start, Quantity) else 0.0

    @property
    def risk(self) -> Risk | None:
        """The forecaster's sentence, if any."""
        return next((item for item in self.body if isinstance(item, Risk)), None)


class Change(Item):
    """`change runner.model: car.compact => car.sports`, `change runner.steer: 0.00 => 0.12 from 4.00 s for 1.00 s`.

    Properties of an actor: `model`; `steer` (-1 right .. 1 left, share of the largest steering angle; from `start` of
    the clip, for `duration`); `timing` (ratio of speed along its own path); `speed` (at the clip's start; in a scenario
    its cruise speed); `delay` (a time: it stands that much longer); `line` (a length: it keeps that far to the left of
    its way); `moving` (a length: where on its path it begins). `weather.rain` and the like; `expect.NAME`, the number
    that a named expectation compares with. In a scenario that extends another also `param.NAME`, a parameter's
    default, and `end.after`.
    """

    pattern = "change {actor}.{property}: {was} => {now} [from {start}] [for {duration}]"
    words = """
        change (statement): one change: in a mutant WAS => NOW, in an extension a whole statement
            | change runner.timing: 1.00 => 0.80
    """

    kind: Literal["change"] = "change"
    actor: ActorName
    """The actor, or one of `weather`, `expect`, `param` and `end`."""
    property: Name
    was: Annotated[ParamValue, Names("model")]
    now: Annotated[ParamValue, Names("model")]
    start: Time | None = None
    duration: Time | None = None


class Origin(Item):
    """Where a mutant comes from; nothing in it changes what the mutant means."""

    pattern = "origin { operator; preset; seed; tool; driver; found; minimised; preventable }"
    words = """
        origin (statement): where a mutant comes from; means nothing to the run | origin { operator [steer]; seed 91 }
        operator (statement): what made the changes | operator [model_swap, steer]
        preventable (setting): whether another driver would have prevented it | preventable yes
        tool (setting): the version that wrote the mutant | tool "0.1.0"
        driver (setting): the driver that was under test | driver "pdm 2"
        found (setting): the failure that the mutant showed | found "F4 lateral collision with runner at 3.15 s"
        minimised (setting): how the mutant was made smaller | minimised "3 changes to 2"
        yes (constant): of `preventable` | preventable yes
        no (constant): of `preventable` | preventable no
        unknown (constant): of `preventable` | preventable unknown
    """

    kind: Literal["origin"] = "origin"
    operator: tuple[Name, ...] = ()
    preset: Name | None = None
    seed: Quantity | None = None
    tool: Text | None = None
    driver: Text | None = None
    found: Text | None = None
    minimised: Text | None = None
    preventable: Literal["yes", "no", "unknown"] | None = None


MutantItem = Annotated[Doc | Change | Origin, ONE_OF]


class Mutant(Item):
    """`mutant NAME of "clip.foresee" pin sha256:... { change ...; origin { ... } }`."""

    pattern = "mutant {name} of {parent} pin {pin} { ...body }"
    words = """
        mutant (definition): a few changes of a clip, which it pins
            | mutant runner_p1_m3 of "runner_p1.foresee" pin sha256:c347e6a70b92 { ... }
    """

    kind: Literal["mutant"] = "mutant"
    name: Name
    parent: FilePath
    pin: Pin
    body: tuple[MutantItem, ...]

    @property
    def changes(self) -> tuple[Change, ...]:
        """The change lines, in order."""
        return tuple(item for item in self.body if isinstance(item, Change))

    @property
    def origin(self) -> Origin | None:
        """The origin block, if any."""
        return next((item for item in self.body if isinstance(item, Origin)), None)
