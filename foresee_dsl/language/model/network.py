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
    cross every road that has a sidewalk.
    """

    kind: Literal["junction"] = "junction"
    name: Name
    at: Point
    control: Literal["signals", "priority", "right_before_left", "stop"] = "priority"
    crossings: bool = False
    stages: tuple[Stage, ...] = ()


class Road(Item):
    """`road west from west_end to j4 { lanes 2; back 1; speed 50 km/h; sidewalk 2 m; median 2 m; via [(..)] }`.

    A road is two edges: `west` runs from the first junction to the second with `lanes` lanes, `west_back` the other way
    with `back` lanes (same number when absent, none for a one-way road). SUMO drives on the right. A median keeps
    the two directions apart.
    """

    kind: Literal["road"] = "road"
    name: Name
    start: Name
    end: Name
    lanes: Count | None = None
    back: Count | None = None
    lane_width: Length | None = None
    speed: Speed | None = None
    sidewalk: Length | None = None
    median: Length | None = None
    via: tuple[Point, ...] = ()


NetworkItem = Annotated[Doc | Junction | Road, ONE_OF]


class Network(Item):
    """`network town { ... }`: a file of its own, or a block `network { ... }` inside a scenario (then the name is
    `here`)."""

    kind: Literal["network"] = "network"
    name: Name
    body: tuple[NetworkItem, ...]


class VehicleModel(Item):
    """`model car.compact { ... }`: one entry of a catalogue. For pedestrians and obstacles only the size and the
    speed matter; what is absent takes the class's default (`compile.catalogue`)."""

    kind: Literal["model"] = "model"
    name: ModelName
    length: Length
    width: Length
    wheelbase: Length | None = None
    front_overhang: Length | None = None
    mass: Mass | None = None
    max_speed: Speed | None = None
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
