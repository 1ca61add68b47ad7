"""Lane changes that are no change between the lanes of one direction: over the middle of a road, or back, by a path."""

from __future__ import annotations

import math
from collections.abc import Iterator

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.placement.statements import lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.exchange.naming import quantity
from foresee_dsl.exchange.openscenario.reading.entity_state import EntityState
from foresee_dsl.exchange.openscenario.reading.places import Places
from foresee_dsl.exchange.openscenario.reading.ways import trajectories as tracks
from foresee_dsl.exchange.outcome import NotExpressed
from foresee_dsl.language import model as m

USUAL_S = 3.3
"""How long a change takes that does not say it. Ours: a lane of 3.3 m with 1 m/s, as vehicles on lanes do it."""
_SLOWEST_MPS = 3.0
"""An actor whose speed is not known, or nearly none, changes lane as one that drives so fast (ours)."""
_ONWARDS_M = 300.0
"""So far it goes on in a lane of the other direction (ours: 20 s at 54 km/h)."""
_PARTS = 6


def over_the_middle(
    state: EntityState,
    target: int,
    took_s: float | None,
    distance_m: float | None,
    places: Places,
    network: RoadNetwork,
    *,
    waited_for: bool,
) -> list[m.Action]:
    """Return the actions of a change to a lane that traffic does not change to: a path, and the traffic of the lane
    where it goes the actor's way; `NotExpressed` where the lanes are not known.

    `took_s`: how long it takes; `distance_m`: over what length instead. `waited_for`: others wait for its end.
    """
    place = places.lane_of(state.entity.ref) if places.roads is not None else None
    if place is None or places.roads is None or state.lane is None:
        raise NotExpressed("actions: LaneChangeAction (of an actor that follows no lane)")
    here = places.roads.on_lane(place.road, state.lane, place.s, 0.0)
    there = places.roads.on_lane(place.road, target, place.s, 0.0)
    heading = here.heading_rad if state.ahead else here.heading_rad + math.pi
    left = (there.y - here.y) * math.cos(heading) - (there.x - here.x) * math.sin(heading)
    speed = max(state.speed_mps or 0.0, _SLOWEST_MPS)
    length = distance_m if distance_m is not None else speed * (USUAL_S if took_s is None else max(took_s, 0.5))
    name = state.entity.name
    points = tuple(_points(name, length, left, state.entity.spec.length_m / 2))
    if places.roads.forward(place.road, target) != state.ahead:
        state.on_lanes = False
        onwards = m.AheadOf(actor=name, at=quantity(_ONWARDS_M, "length"))
        if not waited_for:
            return [m.FollowsPath(actor=name, points=(*points, _beside(onwards, left)))]
        further = m.Then(actions=(m.FollowsPath(actor=name, points=(onwards,)),))
        return [m.FollowsPath(actor=name, points=points), further]
    kind = lane_kind(state.entity.spec)
    way = tracks.straight_on(
        network, tracks.route_through(network, [Pose(there.x, there.y, math.remainder(heading, math.tau))], kind), kind
    )
    state.on_lanes = True
    return [m.FollowsPath(actor=name, points=points, edges=way)]


def _beside(onwards: m.AheadOf, left: float) -> m.AheadOf:
    """Return a place as seen from where the change begins."""
    return onwards.model_copy(update={"offset": quantity(left, "length")})


def _points(name: str, length: float, left: float, half: float) -> Iterator[m.Place]:
    """Yield places ahead of an actor on a sinusoidal curve to the side; a path is that of its middle."""
    for k in range(1, _PARTS + 1):
        share = k / _PARTS
        beside = left * (1 - math.cos(math.pi * share)) / 2
        ahead = max(length * share - half, 0.1 * k)
        yield m.AheadOf(actor=name, at=quantity(ahead, "length"), offset=quantity(beside, "length"))
