"""Scenarios and their statements: a logical scenario has parameters and cases, a concrete one only values.

The expected result of a run with a driver (`Expected`) is recorded with a test case, but is not part of its meaning.
"""

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.actors import Actor, Ego, Traffic
from foresee_dsl.language.model.conditions import Condition
from foresee_dsl.language.model.item import ONE_OF, Block, Bounds, Item, Names, Phrase
from foresee_dsl.language.model.network import Doc, Network
from foresee_dsl.language.model.triggers import When
from foresee_dsl.language.units import Dimension, dimension_of

FailureName = Literal["F1", "F2", "F3", "F4", "F5", "stuck", "rule", "timeout"]
"""Names of failures, the same as in `simulate.results.verdict`. A crash cannot be expected."""


class Expected(Item):
    """`expected pdm fails F2 with walker`, `expected "pdm 2" passes`, `expected idm in case r02 fails`: the recorded
    result of a run with a driver.

    The driver is named as on the command line, or by its own name with a version if only that version is meant.
    """

    pattern = "expected {driver} [in case {case}] {outcome} [{failure}] [with {actor}]"
    words = """
        expected (statement): the recorded result of a run with a driver; it has no effect on the run
            | expected pdm fails F2 with walker
        fails (link): the run ends in a failure, of this kind and with this actor if they are named
            | expected pdm fails F2 with walker
        F1 (constant): the failure of an ego that leaves the road or hits an object | expected pdm fails F1
        F2 (constant): the failure of an ego that collides with a pedestrian | expected pdm fails F2 with walker
        F3 (constant): the failure of an ego in a frontal collision | expected pdm fails F3 with oncoming
        F4 (constant): the failure of an ego in a lateral collision | expected pdm fails F4 with runner
        F5 (constant): the failure of an ego in a rear collision | expected pdm fails F5 with lead
        stuck (constant): the failure of an ego that stands although nothing makes it wait | expected pdm fails stuck
        rule (constant): the failure of an ego that breaks a traffic rule | expected pdm fails rule
        timeout (constant): the failure of an ego that does not arrive in time | expected pdm fails timeout
    """

    driver: v.Id
    case: Annotated[v.Name, Names("case")] | None = None
    """The case of the scenario for which the result was recorded; None: for every case."""
    outcome: Literal["passes", "fails"]
    failure: FailureName | None = None
    """The kind of failure; None: any kind."""
    actor: v.ActorName | None = None


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
ParamValue = v.Quantity | v.Word
"""The value of a parameter: a quantity, or a word that names a road (arm), a turn, a model, a junction, a stage or a
side."""


class Tags(Item):
    """`tags [scenario7, junction]`: words by which test cases are selected; `scenarioN` is the family in the paper's
    table of scenarios."""

    pattern = "tags {names}"
    words = """
        tags (statement): words by which test cases are selected; `scenarioN` is the family in the paper's table of
            scenarios | tags [scenario7, junction]
    """

    names: tuple[v.Name, ...]


class UseNetwork(Item):
    """`use network "networks/town.foresee"`: a network from another file (also `.net.xml`, `.xodr`), relative to this
    file."""

    pattern = "use network {path}"
    words = 'use (statement): the network, or models, of another file | use network "networks/town.foresee"'

    path: v.FilePath


class UseModels(Item):
    """`use models "models.foresee"`: a catalogue in addition to the bundled one; its entries replace bundled ones of
    the same name."""

    pattern = "use models {path}"

    path: v.FilePath


class UseTracks(Item):
    """`use tracks "cut_in.tracks.csv" pin sha256:0123456789ab`: recorded tracks of actors, from a file relative to this
    file; the pin is the beginning of the SHA-256 of the file's bytes."""

    pattern = "use tracks {path} [pin {pin}]"
    words = """
        tracks (statement): the recorded tracks of actors, in a file of their own
            | use tracks "cut_in.tracks.csv" pin sha256:0123456789ab
    """

    path: v.FilePath
    pin: v.Pin | None = None


class Range(Phrase, kind=""):
    """`0 s..4 s step 0.1 s`: the range that a parameter's values must lie in, and the distance between them."""

    pattern = "{low}..{high} [step {step}]"
    words = """
        step (link): before the distance between the values of a range, counted from its low end
            | in 0 s..4 s step 0.1 s
    """

    low: v.Quantity
    high: v.Quantity
    step: v.Quantity | None = None


class Uniform(Phrase):
    """`as uniform`: every value of the range (every step, every option) is equally likely; the default."""

    pattern = "uniform"
    words = "uniform (link): every value of the range is equally likely | as uniform"


class Normal(Phrase):
    """`as normal(1.5 s, 0.4 s)`: a normal distribution with this mean and standard deviation, cut off at the ends of
    the range."""

    pattern = "normal({mean}, {deviation})"
    words = """
        normal (link): a normal distribution with this mean and standard deviation, cut off at the ends of the range
            | as normal(1.5 s, 0.4 s)
    """

    mean: v.Quantity
    deviation: v.Quantity


class Choice(Phrase):
    """`as choice(3, 1)`: each option is drawn with this relative frequency."""

    pattern = "choice({weights:, })"
    words = "choice (link): each option is drawn with this frequency, relative to the others | as choice(3, 1)"

    weights: tuple[v.Quantity, ...] = Field(min_length=1)


class Grid(Phrase):
    """`as grid`: the steps (or options) are taken in turn instead of at random, so that all combinations of all grids
    occur before one is repeated."""

    pattern = "grid"
    words = "grid (link): the values are taken in turn, so that every combination occurs once | as grid"


Distribution = Annotated[Uniform | Normal | Choice | Grid, ONE_OF]


class Param(Item):
    """`param gap: time = 1.5 s in 0 s..4 s step 0.1 s as normal(1.5 s, 0.4 s)`, `param approach: arm = south in [south,
    east]`: a parameter with its type, default, range or options, and distribution."""

    pattern = "param {name}: {type} = {default} [in {range}] [in {options}] [as {distribution}]"
    words = """
        param (statement): a parameter: type, default, and the range that its values must lie in
            | param gap: time = 1.5 s in 0 s..4 s step 0.1 s
        in (link): before the range or the options of a parameter; in a condition, inside a junction or a lane
            | in 0 s..4 s step 0.1 s
        as (link): before the distribution from which a parameter's values are drawn | as normal(1.5 s, 0.4 s)
        angle (type): the type of a parameter that holds a quantity in deg or rad | param turn_in: angle = 10 deg
        ratio (type): the type of a parameter that holds a plain number | param wet: ratio = 0.3
        arm (type): the type of a parameter that holds the name of a road | param approach: arm = south in [south, east]
        turn (type): the type of a parameter that holds straight, left, right or back | param way: turn = straight
        side (type): the type of a parameter that holds left or right | param evades: side = left
    """

    name: Annotated[v.Name, Names("parameter", defines=True)]
    type: ParamType
    default: ParamValue
    range: Range | None = None
    options: Annotated[tuple[ParamValue, ...], Field(min_length=1)] | None = None
    distribution: Distribution | None = None
    """Distribution from which `cases ... from seed` and `foresee sample` draw its values."""

    @property
    def dimension(self) -> Dimension | None:
        """The dimension of its values; None if they are words."""
        return dimension_of(self.type)


class Require(Item):
    """`require gap < 2 s or approach is south`: a condition on the values of each case, written or drawn."""

    pattern = "require {condition}"
    words = "require (statement): a condition that the values of every case must satisfy | require gap < 2 s"

    condition: Condition


class Cases(Item):
    """`cases 20 from seed 7`: 20 cases with drawn values, called `seed7_01`, `seed7_02`, ..."""

    pattern = "cases {count} from seed {seed}"
    words = "cases (statement): the number of cases whose values are drawn | cases 20 from seed 7"

    count: v.Quantity
    seed: v.Quantity


_Share = Annotated[v.Ratio, Bounds(0.0, 1.0)]


class Weather(Item):
    """`weather rain 0.3, wetness 0.4`: ratios from 0 to 1. Wetness lowers the friction; rain, fog and sun affect the
    sensors."""

    pattern = "weather [rain {rain}], [fog {fog}], [wetness {wetness}], [sun {sun}]"
    words = """
        weather (statement): ratios from 0 to 1; wetness lowers the friction, the others affect the sensors
            | weather rain 0.3, wetness 0.4
        rain (setting): how strong the rain is, from 0 to 1; it affects the sensors | weather rain 0.3
        fog (setting): how dense the fog is, from 0 to 1; it affects the sensors | weather fog 0.1
        wetness (setting): how wet the road is, from 0 to 1; it lowers the friction from 0.9 to 0.5
            | weather wetness 0.4
        sun (setting): how strong the sun is, from 0 to 1; it affects the sensors | weather sun 0.5
    """

    rain: _Share | None = None
    fog: _Share | None = None
    wetness: _Share | None = None
    sun: _Share | None = None

    def own_pattern(self) -> str:
        """Return the pattern for the settings that are given, with commas between them."""
        names = (name for name in ("rain", "fog", "wetness", "sun") if getattr(self, name) is not None)
        return f"weather {', '.join(f'{name} {{{name}}}' for name in names)}"


class Slippery(Item):
    """`slippery oil at 12 m before j4 on ego.route radius 2.5 m friction 0.2`: a round patch of slippery ground.

    Its friction does not depend on the weather; if the road around it is more slippery, the road's friction applies.
    The driver under test gets no information about it.
    """

    pattern = "slippery {name} at {place} radius {radius} friction {friction}"
    words = """
        slippery (statement): a round patch of ground with a lower friction
            | slippery oil at 12 m before j4 on ego.route radius 2.5 m friction 0.2
        friction (setting): the friction of a slippery patch; a dry road has 0.9, ice has 0.1
            | slippery ice at (12 m, 4 m) radius 3 m friction 0.1
    """

    name: Annotated[v.Name, Names("patch", defines=True)]
    place: v.Place
    radius: Annotated[v.Length, Bounds(0.1, 50.0)]  # ours: from the puddle of a bucket to a frozen square
    friction: Annotated[v.Ratio, Bounds(0.02, 1.0)]  # ours: wet ice has 0.05; at 0 nothing could ever stop


class Expect(Item):
    """`expect never collision(ego)`, `expect always ttc(ego, lead) > 1 s`, `expect eventually within 60 s
    arrived(ego)`: a condition that should hold in the run."""

    pattern = "expect [{name}:] {mode} [within {within}] {condition}"
    words = """
        expect (statement): a condition that should hold in the run; the result is reported beside the verdict
            | expect never collision(ego)
        never (condition): the condition holds in no frame | expect never collision(ego)
        always (condition): the condition holds in every frame | expect always ttc(ego, lead) > 1 s
        eventually (condition): the condition holds in at least one frame | expect eventually within 60 s arrived(ego)
    """

    name: Annotated[v.Name, Names("label", defines=True)] | None = None
    """The label that `extends`, mutants and messages use: `expect safe: always ttc(ego, lead) > 1 s`."""
    mode: Literal["never", "always", "eventually"]
    within: v.Duration | None = None
    condition: Condition


DEFAULT_END_S = 60.0
"""Duration of a run without an `end` statement, s. Ours: a route of 180 m, the longest of CARLA's on Town10HD, at
20 km/h with a red light on the way."""


class End(Item):
    """`end after 60 s`: the longest duration of the run. An ego that has not arrived by then is a `timeout`; with
    `anywhere` it need not arrive."""

    pattern = "end after {after} [{where}]"
    words = """
        end (statement): the time at which the run ends; the default is 60 s | end after 60 s
        anywhere (constant): the ego need not arrive: the run passes wherever the ego is at its end
            | end after 10 s anywhere
    """

    after: Annotated[v.Time, Bounds(0.05)]  # one step of the simulation
    where: Literal["anywhere"] | None = None


class Assignment(Item, kind=""):
    """`gap = 1.2 s`: a value that a case gives to a parameter; `gap = 2 * other` is calculated from the case's other
    values."""

    pattern = "{name} = {value}"

    name: Annotated[v.Name, Names("parameter")]
    value: ParamValue | v.Expression


class Case(Item):
    """`case r01 { approach = south; gap = 1.2 s }`: one test case, which gives values to parameters."""

    pattern = "case {name} [{ ...values }]"
    words = "case (statement): one test case: a value for each of some parameters | case r01 { gap = 1.2 s }"
    one_line_without = ()

    name: Annotated[v.Name, Names("case", defines=True)]
    values: tuple[Assignment, ...] = ()


class SignalState(Item, kind="signal"):
    """`signal j4 stage ns_go elapsed 11.35 s`: state of a junction's signal at the beginning.

    For signals of the language's networks and of OpenDRIVE maps: the stage's name, and the time since its green began
    (amber and all red follow the green and belong to the stage). For signals of SUMO nets: the phase's index as
    `phase_N`, and the time since it began.
    """

    pattern = "signal {junction} stage {stage} elapsed {elapsed}"
    words = """
        signal (statement): what a signal shows, at the beginning or in a condition
            | signal j4 stage ns_go elapsed 11.35 s
        elapsed (link): before the time since the stage began | signal j4 stage ns_go elapsed 11.35 s
    """

    junction: v.JunctionId
    stage: v.StageId
    elapsed: v.Duration


_Statement = (
    UseNetwork
    | UseModels
    | UseTracks
    | Network
    | Param
    | Require
    | Weather
    | Slippery
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
"""Statements of a scenario other than `doc`, `tags` and `expected`: an extension can add and replace them."""

ScenarioItem = Annotated[Doc | Tags | Expected | _Statement, ONE_OF]


class Scenario(Block):
    """`scenario red_light_runner { ... }`: a traffic situation; the body keeps the author's order."""

    pattern = "scenario {name} { ...body }"
    words = """
        scenario (definition): a traffic situation, with or without parameters and cases
            | scenario red_light_runner { ... }
    """

    name: v.Name
    body: tuple[ScenarioItem, ...]

    @property  # not cached: `model_copy` would carry the old actors into a copy with another body
    def actors(self) -> tuple[Ego | Actor, ...]:
        """The ego (first) and the named actors."""
        return self.all(Ego) + self.all(Actor)

    @property
    def family(self) -> str:
        """The paper's family, such as `3` for the tag `scenario3`; empty without such a tag."""
        tags = self.first(Tags)
        names = tags.names if tags else ()
        return next((t.removeprefix("scenario") for t in names if t.startswith("scenario") and t[8:].isdigit()), "")
