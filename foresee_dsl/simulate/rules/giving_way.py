"""Judges whether an actor gives way: to pedestrians on a crossing, and to vehicles with the right of way.

An actor fails to give way if it enters the area where its way and another actor's way meet (`Conflict.own`), although
the other has priority and would have to stop or to brake abruptly: moving on as it did at that moment, the other would
arrive before the first has left. That follows from VCRT article 1(aa), by which giving way means not to go on where
that may compel others to change speed or direction abruptly. How the other actor then reacts does not count.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from foresee_dsl.compile.roads.conflicts import HALF_WIDTH_M, Conflict, conflicts_of
from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.compile.roads.topology import Crossing, Movement
from foresee_dsl.kernels.constants import COMFORTABLE_MPS2
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.rules.infraction import Rule
from foresee_dsl.simulate.rules.stopping import ALL_WAY_STOP

ON_CROSSING_M = 0.5
"""Distance from a crossing within which a pedestrian counts as on it, m. Ours: a pedestrian's width."""
ABOUT_TO_M = 3.0
"""A pedestrian that walks towards a crossing and is this near to its end is about to use it, m: VCRT article 21(2) asks
drivers to heed such pedestrians, too. Ours: 2 s of walking."""
WALKS_MPS = 0.3
"""A pedestrian beside an actor's way that is slower than this does not cross it, m/s. Ours, as `simulate.sensing` and
`compile.placement.paths` use it: a slower pedestrian does not get across in time."""
APPROACH_M = 150.0
"""A vehicle with the right of way counts up to this distance, m. Ours: 7 s at 80 km/h, longer than any passage of a
junction."""
WAITS_WITHIN_M = 20.0
"""A vehicle that stands at most this far before an area that an actor blocks counts as stopped by that actor, m. Ours:
the width of a junction, and a car's length before its stop line."""
_GO = "gG"
"""SUMO's letters for a green light; with `g` a stream must yield to others."""


@dataclass(slots=True)
class Contender:
    """An actor that has priority when another actor enters its way.

    Attributes:
        actor: its id.
        room_m: distance from its front to the area that both ways share.
        speed_mps: its speed along its way.
        since_s: time for which a pedestrian has been on the crossing or about to use it; infinite for others.
    """

    actor: str
    room_m: float
    speed_mps: float
    since_s: float = math.inf


@dataclass(slots=True, eq=False)
class YieldArea:
    """An area where an actor's way meets another way, to which the actor has to give way there.

    Attributes:
        junction: id of the junction.
        begin_s, end_s: the area along the actor's line, m.
        conflict: the other way.
        movement: the actor's movement through the junction.
        contenders: the actors that had priority when the actor entered.
        entered_s: time at which the actor entered, s; infinite before that.
    """

    junction: str
    begin_s: float
    end_s: float
    conflict: Conflict
    movement: Movement
    entered_s: float = math.inf
    contenders: list[Contender] = field(default_factory=list)

    @property
    def rule(self) -> Rule:
        """The rule by which the actor has to give way."""
        return Rule.CROSSING if self.conflict.pedestrian else Rule.PRIORITY

    @property
    def joins(self) -> bool:
        """Whether both ways continue on the same lane."""
        other = self.conflict.of
        return isinstance(other, Movement) and other.to_lane == self.movement.to_lane

    def taken_from(self, time_s: float, speed_mps: float) -> Iterator[str]:
        """Yield the ids of the actors that were not given way, if the actor leaves the area at this time and speed."""
        for contender in self.contenders:
            if _hindered(contender, time_s - self.entered_s, speed_mps, self):
                yield contender.actor


def _hindered(contender: Contender, inside_s: float, speed_mps: float, area: YieldArea) -> bool:
    room, speed = contender.room_m, contender.speed_mps
    if area.conflict.pedestrian:
        return room <= speed * inside_s
    if area.joins:
        faster = max(speed - speed_mps, 0.0)
        return faster * faster / (2 * max(room, 0.1)) > COMFORTABLE_MPS2
    if speed * inside_s <= room:
        return False
    braking = 2 * (speed * inside_s - room) / (inside_s * inside_s)
    if braking * inside_s > speed:  # it would come to a stand before the actor has left
        braking = speed * speed / (2 * max(room, 0.1))
    return braking > COMFORTABLE_MPS2


def yield_areas(simulation: Simulation, passage: Passage) -> Sequence[YieldArea]:
    """Return the areas on an actor's passage over a junction at which it has to give way, in the order in which it
    reaches them.
    """
    network, movement = simulation.network, passage.movement
    all_stop = network.junctions[passage.junction].type == ALL_WAY_STOP
    areas = [
        YieldArea(passage.junction, passage.entry_s + c.own[0], passage.entry_s + c.own[1], c, movement)
        for c in conflicts_of(network, movement)
        # At an all-way stop the first vehicle to arrive goes first, so no way has priority.
        if c.yields and not (all_stop and not c.pedestrian)
    ]
    return sorted(areas, key=lambda area: area.begin_s)


def contenders(simulation: Simulation, actor: SimulatedActor, area: YieldArea) -> Iterator[Contender]:
    """Yield the actors to which an actor that enters an area now has to give way."""
    if not _has_priority(simulation, area):
        return
    for other in simulation.others(actor):
        contender = _on_crossing(other, area, actor) if area.conflict.pedestrian else _coming(simulation, other, area)
        if contender is not None:
            yield contender


def _has_priority(simulation: Simulation, area: YieldArea) -> bool:
    """Return whether the other way goes first now: always if there is no signal, otherwise if both ways have a green
    light.
    """
    signals, conflict, own = simulation.world.signals, area.conflict, area.movement
    if not conflict.tls:
        return True
    if conflict.pedestrian:
        return signals.colour(conflict.tls, conflict.link) == "green"
    if own.tls != conflict.tls:
        return True
    state = signals.state(conflict.tls)
    return state[conflict.link] in _GO and state[own.link] == "g"


def _on_crossing(other: SimulatedActor, area: YieldArea, actor: SimulatedActor) -> Contender | None:
    """Return a pedestrian that is on a crossing in the actor's way, or walks towards it; None for other actors."""
    crossing = area.conflict.of
    if other.placed.model.kind != "pedestrian" or not isinstance(crossing, Crossing):
        return None
    line, beside_m = crossing.lane.line, (actor.width + other.width) / 2 - HALF_WIDTH_M
    s, left_m = line.project(other.x, other.y)
    if not -ON_CROSSING_M <= s <= line.length_m + ON_CROSSING_M:
        return None
    if abs(left_m) > crossing.lane.width_m / 2 + ON_CROSSING_M:
        return None
    along = other.speed * math.cos(other.heading - line.at(s)[2])
    first, last = area.conflict.other[0] - beside_m, area.conflict.other[1] + beside_m
    walked = (s if along > 0 else line.length_m - s) + ABOUT_TO_M
    since_s = walked / abs(along) if abs(along) >= WALKS_MPS else math.inf
    if first <= s <= last:
        return Contender(other.id, 0.0, abs(along), since_s)
    room = first - s if s < first else s - last
    towards = along if s < first else -along
    return Contender(other.id, room, towards, since_s) if towards >= WALKS_MPS else None


def _coming(simulation: Simulation, other: SimulatedActor, area: YieldArea) -> Contender | None:
    """Return a vehicle that comes along the other way; None for other actors."""
    conflict, on_way = area.conflict, _on_other_way(other, area)
    if on_way is None or other.speed < WALKS_MPS:
        return None
    front, entry_s, room = on_way
    if not 0.0 < room <= APPROACH_M:
        return None  # an actor that is in the area already is followed, not hindered
    if front < entry_s and conflict.tls and simulation.world.signals.colour(conflict.tls, conflict.link) != "green":
        return None
    return Contender(other.id, room, other.speed)


def blocks_others(simulation: Simulation, actor: SimulatedActor, passage: Passage, rear_s: float) -> bool:
    """Return whether an actor that stands in a junction blocks a vehicle that has a green light there, or no signal."""
    front_s, signals = rear_s + actor.length, simulation.world.signals
    for conflict in conflicts_of(simulation.network, passage.movement):
        begin_s, end_s = passage.entry_s + conflict.own[0], passage.entry_s + conflict.own[1]
        if conflict.pedestrian or end_s <= rear_s or begin_s >= front_s:
            continue
        if conflict.tls and signals.colour(conflict.tls, conflict.link) != "green":
            continue
        area = YieldArea(passage.junction, begin_s, end_s, conflict, passage.movement)
        if not area.joins and any(_waits(other, area) for other in simulation.others(actor)):
            return True
    return False


def _waits(other: SimulatedActor, area: YieldArea) -> bool:
    """Return whether a vehicle stands close before the common area, on the other way."""
    on_way = _on_other_way(other, area) if other.speed < WALKS_MPS else None
    return on_way is not None and 0.0 < on_way[2] <= WAITS_WITHIN_M


def _on_other_way(other: SimulatedActor, area: YieldArea) -> tuple[float, float, float] | None:
    """Return where a vehicle is on its line that leads along the area's other way, m: its front, the entry into the
    junction, and the room from its front to the area; None for other actors."""
    line, conflict = other.placed.line, area.conflict
    if line is None or other.placed.control == "static":
        return None
    theirs = next((p for p in line.passages if p.movement is conflict.of), None)
    if theirs is None:
        return None
    front = line.project(other.x, other.y)[0] + other.length / 2
    return front, theirs.entry_s, theirs.entry_s + conflict.other[0] - conflict.entry_s - front
