"""Lane changes that SUMO cannot do: across the middle of a road or back, as a path."""

from __future__ import annotations

import math
from collections.abc import Iterator

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.compile.placement.statements import lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.language import model as m
from foresee_dsl.simulate.actors.bend_speeds import TURNS_WITH
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2
from foresee_exchange.naming import quantity
from foresee_exchange.openscenario.losses import Losses, NotExpressed
from foresee_exchange.openscenario.reading.entities import EntityState
from foresee_exchange.openscenario.reading.places import Places
from foresee_exchange.openscenario.reading.ways import trajectories as tracks

USUAL_S = 3.3
"""Duration of a lane change if the file states none, s. Ours: vehicles on lanes change by a lane's width of 3.3 m at 1
m/s."""
_SLOWEST_MPS = 3.0
"""Least assumed speed of an actor that changes lane, if its speed is unknown or lower, m/s (ours)."""
_SLOWER = 0.98
_APART_M = 20.0
"""Distance between the path's points after the change, m. Ours: in a bend of 250 m radius the error is 0.2 m."""
_ONWARDS_M = 300.0
"""Length of the path in a lane of the other direction, m (ours: 20 s at 54 km/h)."""
_PARTS = 6


def over_the_middle(
    state: EntityState,
    target: int,
    took_s: float | None,
    distance_m: float | None,
    places: Places,
    network: RoadNetwork,
    losses: Losses,
    *,
    waited_for: bool,
) -> list[m.Action]:
    """Return the actions of a change to a lane that SUMO does not change to: a path, then the edges of that lane if it
    leads in the actor's direction; `NotExpressed` if the lanes are unknown.

    `took_s`: duration of the change, s; `distance_m`: its length instead. `waited_for`: events wait for its end.
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
    # Peak of the lateral acceleration of a sinusoidal change, m/s^2.
    sideways = abs(left) * math.pi**2 / 2 * (speed / length) ** 2
    if sideways > TURNS_WITH * lateral_limit_mps2(state.entity.spec.name, DRY_FRICTION):
        losses.note(
            f"{name} slows down in a lane change with {sideways:.1f} m/s^2 sideways, because its tyres do not hold more"
        )
    points = tuple(_points(name, length, left, state.entity.spec.length_m / 2))
    kind = lane_kind(state.entity.spec)
    way: tuple[str, ...] = ()
    if places.roads.forward(place.road, target) == state.ahead:
        beginning = Pose(there.x, there.y, math.remainder(heading, math.tau))
        way = tracks.straight_on(network, tracks.route_through(network, [beginning], kind), kind)
        if min(lane.speed_mps for edge in way for lane in network.edges[edge].drivable) < speed * _SLOWER:
            way = ()  # a speed limit would slow it down, so it continues beside its previous way
    if not way:
        state.on_lanes = False
        if not waited_for:
            return [m.FollowsPath(actor=name, points=(*points, *_onwards(name, length, left)))]
        further = m.Then(actions=(m.FollowsPath(actor=name, points=tuple(_onwards(name, 0.0, 0.0))),))
        return [m.FollowsPath(actor=name, points=points), further]
    state.on_lanes = True
    return [m.FollowsPath(actor=name, points=points, edges=way)]


def _onwards(name: str, begin: float, left: float) -> Iterator[m.Place]:
    """Yield places along an actor's way at a lateral offset, from a distance ahead of the actor."""
    offset = quantity(left, "length") if left else None
    for k in range(1, round(_ONWARDS_M / _APART_M) + 1):
        yield m.AheadOf(actor=name, at=quantity(begin + k * _APART_M, "length"), offset=offset)


def _points(name: str, length: float, left: float, half: float) -> Iterator[m.Place]:
    """Yield places ahead of an actor on a sinusoidal curve to the side, for the path of its centre."""
    for k in range(1, _PARTS + 1):
        share = k / _PARTS
        beside = left * (1 - math.cos(math.pi * share)) / 2
        ahead = max(length * share - half, 0.1 * k)
        yield m.AheadOf(actor=name, at=quantity(ahead, "length"), offset=quantity(beside, "length"))
