"""What a road network is made of: lanes, edges, junctions, the movements through them, and where people walk."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from foresee_dsl.compile.roads.polyline import Points, Polyline
from foresee_dsl.language.model import Turn

if TYPE_CHECKING:
    from shapely import LineString

LaneKind = Literal["car", "bicycle", "pedestrian"]
"""Whom a lane is for, as far as we tell them apart; `car` stands for everything with an engine."""


@dataclass(frozen=True, eq=False)
class Lane:
    """One lane, from the right: index 0 is the rightmost (often the sidewalk).

    Attributes:
        shape: the centreline's points, m, as SUMO has it. length_m: as SUMO says; lengths in this package are measured
            along `line`, which can differ by the rounding.
        internal: inside a junction. parking: a strip where vehicles are parked; nobody drives on it.
    """

    id: str
    edge: str
    index: int
    shape: Points
    length_m: float
    speed_mps: float
    width_m: float
    kinds: frozenset[LaneKind]
    internal: bool
    parking: bool = False

    @cached_property
    def line(self) -> Polyline:
        """The centreline, finely divided."""
        return Polyline.of(self.shape)

    @cached_property
    def centreline(self) -> LineString:
        """The same as SUMO has it."""
        import shapely  # here: it takes long to import, and placing actors does without

        return shapely.LineString(self.shape)


@dataclass(frozen=True, eq=False)
class Edge:
    """A road in one direction: `start` and `end` are junctions."""

    id: str
    start: str
    end: str
    lanes: tuple[Lane, ...]

    def for_kind(self, kind: LaneKind) -> tuple[Lane, ...]:
        """Return the lanes that a kind may use, from the right."""
        return tuple(lane for lane in self.lanes if kind in lane.kinds)

    @property
    def drivable(self) -> tuple[Lane, ...]:
        """The lanes for cars; for bicycles where there is none for cars; else all."""
        return self.for_kind("car") or self.for_kind("bicycle") or self.lanes


@dataclass(frozen=True, eq=False)
class Junction:
    """Where edges meet.

    `requests[k]` belongs to link k: (response, foes) as bit masks over links: bit j of `response` is set when link k
    must let link j go first, bit j of `foes` when the two conflict at all.
    """

    id: str
    type: str
    x: float
    y: float
    polygon: Points
    requests: tuple[tuple[int, int], ...] = ()

    def yields(self, link: int, other: int) -> bool:
        """Say whether link `link` must let link `other` go first."""
        return 0 <= link < len(self.requests) and bool(self.requests[link][0] >> other & 1)

    def conflicts(self, link: int, other: int) -> bool:
        """Say whether two links conflict."""
        return 0 <= link < len(self.requests) and bool(self.requests[link][1] >> other & 1)


@dataclass(frozen=True, eq=False)
class Movement:
    """A way from one lane over a junction to another.

    Attributes:
        via: the lanes inside the junction, in driving order (two where vehicles may wait in the middle; none in nets
            without internal lanes).
        direction: SUMO's letter; `turn` is what we make of it.
        tls: id of the signal that controls it, or None; `link` its index there.
        index: its row in the junction's `requests`, -1 where it has none.
    """

    from_edge: str
    to_edge: str
    from_lane: str
    to_lane: str
    via: tuple[str, ...]
    junction: str
    turn: Turn
    direction: str
    tls: str | None
    link: int
    index: int
    kinds: frozenset[LaneKind]


@dataclass(frozen=True, eq=False)
class Crossing:
    """A pedestrian crossing: its centreline, its signal (or None) and its row in the junction's `requests`."""

    id: str
    lane: Lane
    junction: str
    tls: str | None
    link: int
    index: int


@dataclass(frozen=True, eq=False)
class WalkingArea:
    """A corner where sidewalks and crossings meet. `polygon` is open."""

    id: str
    junction: str
    polygon: Points
