"""Road networks that are written in the language, and catalogues of models."""

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.item import ONE_OF, Block, Bounds, Item, Names
from foresee_dsl.language.model.streets import BannedTurn, Bump, LaneEnd, LaneTurns, OffRamp, OnRamp, Roundabout, Zebra


class Doc(Item):
    """`doc "One sentence."`: a sentence for people, without effect on the run."""

    pattern = "doc {text}"
    words = 'doc (statement): a sentence for people | doc "One sentence."'

    text: v.Text


class Stage(Item):
    """`stage ns_go for 25 s green [north, south]`: one stage of a junction's signal. Every movement that starts on the
    named roads has green (left turns and turns over crossings give way to conflicting traffic); all others have red."""

    pattern = "stage {name} for {duration} green {green}"
    words = """
        stage (statement): a stage of a junction's signal | stage ns_go for 25 s green [north, south]
        green (link): the roads that have green in a stage, or the colour of a signal | green [north, south]
    """

    name: Annotated[v.Name, Names("stage", defines=True)]
    green: tuple[Annotated[v.Name, Names("road")], ...] = Field(min_length=1)
    duration: Annotated[v.Time, Bounds(0.1)]


class Junction(Item):
    """`junction j4 at (0 m, 0 m) signals { ... }`: a place where roads meet or one road ends.

    Control: `signals` (stages in the order written, each followed by 3 s amber and 2 s all red), `priority` (the wider
    or faster road goes first), `right_before_left`, `stop` (all-way stop). With `crossings`, pedestrians can cross
    every road that has a sidewalk; with `crossings [south, east]` only those.
    """

    pattern = "junction {name} at {at} [{control}] [{ crossings [{crossings}]; ...stages }]"
    words = """
        junction (statement): a place where roads meet or end; in a condition, its outline
            | junction j4 at (0 m, 0 m) signals { ... }
        crossings (statement): pedestrians can cross every road with a sidewalk at this junction, or only the named
            roads | crossings
        signals (constant): the junction is controlled by a signal; after `ignores`, an actor ignores signals
            | junction j4 at (0 m, 0 m) signals { ... }
        priority (constant): the wider or faster road has priority; after `ignores`, an actor ignores priority
            | ignores priority at j4
        right_before_left (constant): vehicles from the right have priority at the junction | right_before_left
        stop (statement): a bus stop of a network; as a junction's control, an all-way stop
            | stop market on mill_west at 60 m length 20 m
    """
    one_line_without = ("stages",)

    name: Annotated[v.Name, Names("junction", defines=True)]
    at: v.Point
    control: Literal["signals", "priority", "right_before_left", "stop"] = "priority"
    crossings: tuple[v.Name, ...] | None = None
    """The roads that pedestrians can cross; an empty tuple means all roads, None means no roads."""
    stages: tuple[Stage, ...] = ()


class Road(Item):
    """`road west from west_end to j4 { lanes 2; back 1; speed 50 km/h; parking 2.2 m; sidewalk 2 m; via [(..)] }`.

    A road is two edges: `west` runs from the first junction to the second with `lanes` lanes, `west_back` the other way
    with `back` lanes (same number when absent, none for a one-way road). SUMO drives on the right. A median keeps
    the two directions apart. Right of the lanes of either direction come, in this order, a bus lane, a cycle lane, a
    shoulder, a parking strip, a cycle track and the sidewalk.
    """

    pattern = (
        "road {name} from {start} to {end} [{ lanes; back; lane_width; speed; bus_lane; cycle_lane; shoulder; "
        "parking; cycle_track; sidewalk; median; via }]"
    )
    words = """
        road (statement): two edges: NAME from the first junction to the second, NAME_back the other way
            | road west from west_end to j4 { lanes 2; speed 50 km/h }
        via (statement): points through which the road's line goes | via [(-60 m, 2 m)]
        lanes (setting): the number of lanes of a road's first edge, 1 to 8 | lanes 2
        back (setting): the number of lanes of a road's other edge, 0 for a one-way road; as a turn, back to where the
            vehicle came from | back 1
        lane_width (setting): the width of each lane; the default is 3.3 m | lane_width 3.5 m
        parking (setting): a strip for parked vehicles of this width, right of each edge's lanes | parking 2.2 m
        sidewalk (setting): a sidewalk of this width, right of each edge | sidewalk 2 m
        bus_lane (setting): a lane for buses of this width, right of each edge's lanes | bus_lane 3.5 m
        cycle_lane (setting): a lane for bicycles of this width on the carriageway, right of each edge's lanes
            | cycle_lane 1.8 m
        cycle_track (setting): a way for bicycles of this width, between the parking strip and the sidewalk
            | cycle_track 2 m
        shoulder (setting): a strip of this width for stops in an emergency, right of each edge's lanes | shoulder 2.5 m
        median (setting): the distance between a road's two directions | median 1.5 m
    """
    one_line_without = ("via",)

    name: Annotated[v.Name, Names("road", defines=True)]
    start: Annotated[v.Name, Names("junction")]
    end: Annotated[v.Name, Names("junction")]
    lanes: Annotated[v.Count, Bounds(1, 8)] | None = None  # ours: the widest motorway halves have eight lanes
    back: Annotated[v.Count, Bounds(0, 8)] | None = None
    lane_width: Annotated[v.Length, Bounds(1.0, 10.0)] | None = None  # ours: from a cycle lane's to a bus stop's
    speed: Annotated[v.Speed, Bounds(0.1)] | None = None
    # Ours: from a stand for bicycles to a bay in which a lorry parks at a right angle to the road.
    parking: Annotated[v.Length, Bounds(1.0, 10.0)] | None = None
    sidewalk: Annotated[v.Length, Bounds(0.0, 50.0)] | None = None
    median: Annotated[v.Length, Bounds(0.0, 50.0)] | None = None
    # Ours: from the width of a bus's body to that of a bus lane which bicycles share.
    bus_lane: Annotated[v.Length, Bounds(2.5, 6.0)] | None = None
    # Ours: from the width of one handlebar to that of three bicycles abreast.
    cycle_lane: Annotated[v.Length, Bounds(0.8, 5.0)] | None = None
    cycle_track: Annotated[v.Length, Bounds(0.8, 5.0)] | None = None
    shoulder: Annotated[v.Length, Bounds(0.5, 5.0)] | None = None
    via: tuple[v.Point, ...] = ()


class Building(Item):
    """`building bank [(10 m, 20 m), (30 m, 20 m), (30 m, 40 m), (10 m, 40 m)]`: an outline that hides everything behind
    it. The outline is closed automatically."""

    pattern = "building {name} {outline}"
    words = """
        building (statement): an outline that hides what is behind it
            | building bank [(10 m, 20 m), (30 m, 20 m), (30 m, 40 m)]
    """

    name: v.Name
    outline: tuple[v.Point, ...] = Field(min_length=3)


class BusStop(Item, kind="stop"):
    """`stop market on mill_west at 60 m length 20 m bay 3 m`: a bus stop on the rightmost lane for cars of a road's
    edge. The front of a vehicle that stops there stands at this length along the edge (negative: from the edge's end).

    With a bay, buses stop on a lane of that width beside the other lanes; this lane begins and ends with the bay's
    tapers.
    """

    pattern = "stop {name} on {road} at {at} [length {length}] [bay {bay}]"
    words = """
        bay (link): a lane of this width beside the others, in which buses stop
            | stop market on mill_west at 60 m length 20 m bay 3 m
    """

    name: Annotated[v.Name, Names("stop", defines=True)]
    road: Annotated[v.Name, Names("road")]
    at: v.Length
    length: Annotated[v.Length, Bounds(1.0, 200.0)] | None = None  # ours: from a moped to a platform for five buses
    bay: Annotated[v.Length, Bounds(2.5, 6.0)] | None = None  # ours: the widths of a bus lane


NetworkItem = Annotated[
    Doc
    | Junction
    | Roundabout
    | Road
    | OnRamp
    | OffRamp
    | Zebra
    | Bump
    | LaneEnd
    | LaneTurns
    | BannedTurn
    | Building
    | BusStop,
    ONE_OF,
]


class Network(Block):
    """`network town { ... }`: a file of its own, or a block `network { ... }` inside a scenario (then the name is
    `here`)."""

    pattern = "network {name} { ...body }"
    words = "network (definition): a road network: junctions and roads | network town { ... }"

    name: v.Name
    body: tuple[NetworkItem, ...]


_Size = Annotated[v.Length, Bounds(0.01, 100.0)]
_Overhang = Annotated[v.Length, Bounds(0.0, 100.0)]
SUM_SLACK_M = 0.0101
"""Largest difference between the length and the sum of overhangs and wheelbase, m: tables round each value to a
centimetre (ours)."""


class VehicleModel(Item, kind="model"):
    """`model car.compact { ... }`: one entry of a catalogue. A missing value is the class's default
    (`compile.catalogue`). Obstacles need only the size; pedestrians have no wheels.

    Front overhang, wheelbase and rear overhang add up to the length; if one of the three is missing, it is computed as
    the rest of the length. `cruise_speed` is its speed if the scenario does not state one, `max_speed` its highest
    possible speed.
    """

    pattern = (
        "model {name} { length; width; height; wheelbase; front_overhang; rear_overhang; mass; max_speed; "
        "cruise_speed; acceleration; braking; emergency_braking; max_steer; steer_rate; source }"
    )
    words = """
        model (statement): an entry of a catalogue: the sizes and abilities of a class.variant
            | model car.sports { length 4.38 m; width 1.80 m }
        length (setting): the length of a model, a ramp's extra lane or a speed bump | length 4.38 m
        width (setting): the width of a model or of a zebra crossing | width 1.80 m
        height (setting): the height of a model, with its rider; it hides lower actors behind it | height 1.48 m
        wheelbase (setting): the distance between a model's axles | wheelbase 2.57 m
        front_overhang (setting): the distance from the front axle to the front bumper | front_overhang 0.85 m
        rear_overhang (setting): the distance from the rear axle to the rear bumper | rear_overhang 0.96 m
        mass (setting): a model's mass | mass 1350 kg
        max_speed (setting): the highest speed that a model can reach | max_speed 180 km/h
        cruise_speed (setting): the speed of a model if the scenario states none | cruise_speed 1.3 m/s
        acceleration (setting): the acceleration of a model, or of an actor in its state | acceleration 3 m/s^2
        braking (setting): the deceleration with which a model brakes comfortably | braking 4 m/s^2
        emergency_braking (setting): the largest deceleration of a model | emergency_braking 9 m/s^2
        max_steer (setting): the largest angle of the front wheels | max_steer 35 deg
        steer_rate (setting): the speed at which the front wheels turn | steer_rate 40 deg/s
        source (setting): where the numbers of a model come from | source "data sheet of 2024"
    """

    name: Annotated[v.ModelName, Names("model", defines=True)]
    length: _Size
    width: _Size
    height: _Size | None = None
    wheelbase: v.Length | None = None
    front_overhang: _Overhang | None = None
    rear_overhang: _Overhang | None = None
    mass: v.Mass | None = None
    max_speed: v.Speed | None = None
    cruise_speed: Annotated[v.Speed, Bounds(0.01)] | None = None
    acceleration: v.Acceleration | None = None
    braking: v.Acceleration | None = None
    emergency_braking: v.Acceleration | None = None
    max_steer: v.Angle | None = None
    steer_rate: v.AngularRate | None = None
    source: v.Text | None = None


class Catalogue(Block, kind="models"):
    """`models standard { model car.compact { ... } ... }`: a catalogue of models."""

    pattern = "models {name} { ...body }"
    words = """
        models (definition): a catalogue: sizes and abilities; in traffic, the models that take part
            | models more { ... }
    """

    name: v.Name
    body: tuple[Annotated[Doc | VehicleModel, ONE_OF], ...]
