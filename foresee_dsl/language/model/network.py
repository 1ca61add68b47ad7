"""Networks written in the language, and catalogues of models."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model.values import (
    ONE_OF,
    Acceleration,
    Angle,
    AngularRate,
    Count,
    Item,
    Length,
    Mass,
    ModelName,
    Name,
    Point,
    Speed,
    Text,
    Time,
)


class Doc(Item):
    """`doc "One sentence."`"""

    kind: Literal["doc"] = "doc"
    text: Text


class Stage(Item):
    """`stage ns_go for 25 s green [north, south]`: one stage of a junction's signal; every movement that starts on
    the named
    roads has green (left turns and turns over crossings give way to what conflicts), the rest red."""

    kind: Literal["stage"] = "stage"
    name: Name
    green: tuple[Name, ...] = Field(min_length=1)
    duration: Time


class Junction(Item):
    """`junction j4 at (0 m, 0 m) signals { ... }`: where roads meet, or where one ends.

    Control: `signals` (stages in the order written, each followed by 3 s amber and 2 s all red), `priority` (the
    wider or faster road goes first), `right_before_left`, `stop` (all-way stop). With `crossings`, pedestrians can
    cross every road that has a sidewalk; with `crossings [south, east]` only those.
    """

    kind: Literal["junction"] = "junction"
    name: Name
    at: Point
    control: Literal["signals", "priority", "right_before_left", "stop"] = "priority"
    crossings: tuple[Name, ...] | None = None
    """The roads that can be crossed: empty for all, None for none."""
    stages: tuple[Stage, ...] = ()


class Road(Item):
    """`road west from west_end to j4 { lanes 2; back 1; speed 50 km/h; parking 2.2 m; sidewalk 2 m; via [(..)] }`.

    A road is two edges: `west` runs from the first junction to the second with `lanes` lanes, `west_back` the other way
    with `back` lanes (same number when absent, none for a one-way road). SUMO drives on the right. A median keeps
    the two directions apart. A parking strip lies between the lanes and the sidewalk of either direction.
    """

    kind: Literal["road"] = "road"
    name: Name
    start: Name
    end: Name
    lanes: Count | None = None
    back: Count | None = None
    lane_width: Length | None = None
    speed: Speed | None = None
    parking: Length | None = None
    sidewalk: Length | None = None
    median: Length | None = None
    via: tuple[Point, ...] = ()


class Building(Item):
    """`building bank [(10 m, 20 m), (30 m, 20 m), (30 m, 40 m), (10 m, 40 m)]`: hides what is behind it; its outline
    is closed by itself."""

    kind: Literal["building"] = "building"
    name: Name
    outline: tuple[Point, ...] = Field(min_length=3)


NetworkItem = Annotated[Doc | Junction | Road | Building, ONE_OF]


class Network(Item):
    """`network town { ... }`: a file of its own, or a block `network { ... }` inside a scenario (then the name is
    `here`)."""

    kind: Literal["network"] = "network"
    name: Name
    body: tuple[NetworkItem, ...]


class VehicleModel(Item):
    """`model car.compact { ... }`: one entry of a catalogue. What is absent takes the class's default
    (`compile.catalogue`); for obstacles only the size matters, pedestrians have no wheels.

    Front overhang, wheelbase and rear overhang make up the length: of the three, one that is absent is what the others
    leave. `cruise_speed` is what it walks or drives where nobody says a speed, `max_speed` the most that it can.
    """

    kind: Literal["model"] = "model"
    name: ModelName
    length: Length
    width: Length
    height: Length | None = None
    wheelbase: Length | None = None
    front_overhang: Length | None = None
    rear_overhang: Length | None = None
    mass: Mass | None = None
    max_speed: Speed | None = None
    cruise_speed: Speed | None = None
    acceleration: Acceleration | None = None
    braking: Acceleration | None = None
    emergency_braking: Acceleration | None = None
    max_steer: Angle | None = None
    steer_rate: AngularRate | None = None
    source: Text | None = None


class Catalogue(Item):
    """`models standard { model car.compact { ... } ... }`."""

    kind: Literal["models"] = "models"
    name: Name
    body: tuple[Annotated[Doc | VehicleModel, ONE_OF], ...]
