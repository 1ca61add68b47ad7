"""Checks the statements of a scenario that name parts of its network, such as junctions and stops, and finds conditions
that can never hold, because an actor's way never comes near the place that they name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

from foresee_dsl.compile.bundle import PlacedActor, Signal
from foresee_dsl.compile.placement.checks import GOAL_OFF_M
from foresee_dsl.compile.placement.paths import joined_way
from foresee_dsl.compile.placement.spots import Spot, UnsettledError
from foresee_dsl.compile.placement.statements import WHEELS, lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Points, distance_to, line_of
from foresee_dsl.compile.roads.routing import RouteError, metres
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.errors import MessageText, measured
from foresee_dsl.helps import HelpText, one_of, remove, write
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Problem, TestCase
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import all_actions, parts, si_of, word_of

_BESIDE_M = {"ego": 30.0, "sumo": 30.0, "path": 1.0, "static": 0.0}
"""Largest distance of an actor from the middle of its way, m, by its control. Ours: for `ego` and `sumo` the width of
eight lanes, for `path` more than rounding errors; a `static` actor does not move.
"""
_OTHER_COLOURS = {"yellow": "amber", "orange": "amber"}
"""Other names of signal colours, each with the colour of the language."""


class NameChecks:
    """Checks the statements of a concrete scenario that name parts of the network.

    `signals` holds the signals by junction. `spot` returns the position of a place, or raises `RouteError`.
    """

    def __init__(
        self, case: TestCase, network: RoadNetwork, signals: Mapping[str, Signal], spot: Callable[[m.Place], Spot]
    ) -> None:
        self._case, self._network, self._signals, self._spot = case, network, signals, spot
        self._actors = {actor.name for actor in case.scenario.actors} | {
            m.name_in_traffic(traffic.name, k)
            for traffic in case.scenario.all(m.Traffic)
            for k in range(1, int(si_of(traffic.count)) + 1)
        }
        self.places: dict[m.Place | m.AtStop, XY] = {}
        """Coordinates of the places in conditions and actions, m; filled by `problems`."""

    def problems(self, placed: Iterable[PlacedActor]) -> Iterator[Problem]:
        """Yield the problems, given the actors that could be placed."""
        scenario, by_name = self._case.scenario, {actor.id: actor for actor in placed}
        for actor in scenario.actors:
            for item in actor.body:
                if isinstance(item, m.IgnoresRule | m.MeetsState) and item.junction is not None:
                    yield from self._junction(actor.name, item.kind, word_of(item.junction))
                if isinstance(item, m.MeetsState):
                    yield from self._meeting(actor.name, item.kind, actor.name, item, by_name)
        for state in scenario.all(m.SignalState):
            yield from self._stage(state.kind, word_of(state.junction), word_of(state.stage))
        for kind, condition in _conditions(scenario):
            for part in parts(condition):
                yield from self._part(kind, part, by_name)
        for when in scenario.all(m.When):
            for action in all_actions(when.actions):
                yield from self._action(when.kind, action, by_name)

    def _part(self, kind: str, part: m.Condition, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        if isinstance(part, m.Comparison) and isinstance(part.left, m.Measure) and part.left.other is not None:
            other = word_of(part.left.other)
            if part.left.what == "eta" or other not in self._actors:
                yield from self._junction("", kind, other, (part.left.kind, "other"))
            else:
                yield from self._one_meaning(kind, other)
        elif isinstance(part, m.InJunction | m.RunsRed | m.YieldsAt | m.YieldsAtCrossing) and part.junction is not None:
            yield from self._junction("", kind, word_of(part.junction), (part.kind, "junction"))
        elif isinstance(part, m.InLane):
            yield from self._lane(kind, part)
        elif isinstance(part, m.Within):
            yield from self._within(kind, part)
        elif isinstance(part, m.Shows):
            yield from self._shows(kind, part, placed)

    def _lane(self, kind: str, part: m.InLane) -> Iterator[Problem]:
        """Yield a problem if the named edge (without a name: every edge) does not exist or has too few lanes."""
        number = round(si_of(part.number))
        if part.road is None:
            most = max((len(edge.drivable) for edge in self._network.edges.values()), default=0)
            where: MessageText = "no road of the network"
        else:
            road = word_of(part.road)
            pieces = self._network.pieces(road)
            if not pieces:
                message: MessageText = f"there is no edge called {road}"
                yield Problem("", kind, "FS251", message, did_you_mean(road, self._network.edges), road)
                return
            most = max(len(self._network.edges[piece].drivable) for piece in pieces)
            where = f"{road} has no lane " + measured(f"{number}") + ": it"
        if number > most:
            count, noun = (most, "lane" if most == 1 else "lanes") if part.road is not None else (number, "lanes")
            message = where + " has " + measured(f"{count}") + f" {noun}"
            yield Problem("", kind, "FS252", message, f"lanes are counted from 1 to {most}", part=part.number)

    def _within(self, kind: str, part: m.Within) -> Iterator[Problem]:
        if isinstance(part.of, m.Named):
            name = word_of(part.of.name)
            yield from self._one_meaning(kind, name)
            if name not in self._actors and not self._network.is_junction(name):
                names = (*self._actors, *self._network.junctions, *self._network.rings)
                message = f"there is no actor and no junction called {name}"
                yield Problem("", kind, "FS251", message, did_you_mean(name, names), name)
        elif not isinstance(part.of, m.Point | m.OfActor):  # these depend on their actor's position during the run
            try:
                spot = self._spot(part.of)
            except UnsettledError:
                return  # the error is reported at the actor to which the place refers
            except RouteError as err:
                yield Problem("", kind, "FS252", err.message, err.help, part=part.of)
            else:
                self.places[part.of] = (spot.x, spot.y)

    def _one_meaning(self, kind: str, name: str) -> Iterator[Problem]:
        """Yield a problem if both an actor and a junction have the name of a place in a condition."""
        if name in self._actors and self._network.is_junction(name):
            message = f"'{name}' is the name of an actor and of a junction"
            yield Problem("", kind, "FS251", message, "give the actor another name", name)

    def _shows(self, kind: str, part: m.Shows, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        junction = word_of(part.junction)
        state = word_of(part.state)
        if part.actor is None or junction not in self._signals:
            yield from self._stage(kind, junction, state)
        elif state not in m.SIGNAL_COLOURS:
            message = f"a signal shows {part.actor} green, amber or red, not {state}"
            stage = state in self._signals[junction].stages
            help = (
                "write " + write(f"signal({junction}) is {state}") + " for its stage"
                if stage
                else did_you_mean(_OTHER_COLOURS.get(state, state), m.SIGNAL_COLOURS)
            )
            yield Problem("", kind, "FS251", message, help, state)
        elif not self._case.snapshot:  # in a clip the actor may have passed the junction
            actor = placed.get(part.actor)
            if actor is not None and (over := _misses(actor, junction)):
                message = f"the route of {part.actor} does not go over {junction}"
                yield Problem("", kind, "FS252", message, "it goes over " + over, junction)

    def _action(self, kind: str, action: m.Action, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        match action:
            case m.Meets():
                yield from self._junction("", kind, word_of(action.junction))
                yield from self._meeting("", kind, action.actor, action, placed)
            case m.Ignores() if action.junction is not None:
                yield from self._junction("", kind, word_of(action.junction))
            case m.TurnsTo():
                yield from self._turn(kind, action)
            case m.Limit():
                yield from self._limit(kind, action)
            case m.StopsAt():
                yield from self._stop(kind, action, placed.get(action.actor))
            case m.FollowsPath():
                yield from self._path(kind, action, placed.get(action.actor))
            case m.Synchronises():
                yield from self._on_the_way(kind, action.place, placed.get(action.actor), action.actor)
                yield from self._on_the_way(kind, action.there, placed.get(action.other), action.other)

    def _turn(self, kind: str, action: m.TurnsTo) -> Iterator[Problem]:
        junction, stage = word_of(action.junction), word_of(action.stage)
        problems = self._stage(kind, junction, stage)
        bad = [replace(p, field=(action.kind, "junction")) if p.about == junction else p for p in problems]
        name, _, light = stage.rpartition("_")
        if bad and junction in self._signals and light in ("amber", "red"):
            # `ew_amber` is not a stage: it belongs to `ew_go`
            near = next((s for s in self._signals[junction].stages if s.rpartition("_")[0] == name), None)
            if near is not None:
                bad = [
                    replace(
                        bad[0], help="amber and red belong to a stage: " + write(f"{junction} turns to {near} {light}")
                    )
                ]
        yield from bad
        if not bad and self._signals[junction].phase_of(stage, action.light) is None:
            message = f"the stage {stage} at {junction} has no {action.light} of its own"
            yield Problem("", kind, "FS251", message, "write " + write(f"{junction} turns to {stage}"), stage)

    def _limit(self, kind: str, action: m.Limit) -> Iterator[Problem]:
        name = word_of(action.road)
        edges = [self._network.edges[piece] for piece in self._network.pieces(name)]
        lanes = max((len(edge.drivable) for edge in edges), default=0)
        if not edges:
            message: MessageText = f"there is no edge called {name}"
            yield Problem("", kind, "FS251", message, did_you_mean(name, self._network.edges), name)
        elif action.lane is not None and si_of(action.lane) > lanes:
            has = f"{name} has " + measured(f"{lanes}") + (" lanes" if lanes > 1 else " lane")
            message = has + ", so there is no lane " + measured(f"{si_of(action.lane):g}")
            yield Problem("", kind, "FS252", message, "lanes count from 1, the rightmost for cars", name)

    def _stop(self, kind: str, action: m.StopsAt, actor: PlacedActor | None) -> Iterator[Problem]:
        """Yield a problem if the place at which an actor should stop does not exist or is not on its way."""
        where = action.where
        if not isinstance(where, m.AtStop):
            yield from self._on_the_way(kind, where, actor, action.actor)
            return
        stop = self._network.bus_stops.get(where.stop)
        try:
            place = self._network.stop(where.stop)
        except RouteError as err:
            code = "FS251" if stop is None else "FS252"
            yield Problem("", kind, code, str(err), err.help, where.stop)
            return
        if stop is None:
            return
        if place.bay and (why := self._not_for(action.actor, actor)):
            message = f"{action.actor} cannot stop in the bay of {stop.name}: {why}"
            help = "name the place beside the bay: " + write(f"{action.actor} stops at {_beside(stop)}")
            yield Problem("", kind, "FS252", message, help, stop.name)
            return
        yield from self._on_the_way(kind, m.AlongEdge(edge=stop.road, at=stop.at), actor, stop.name, stop=stop)

    def _not_for(self, name: str, actor: PlacedActor | None) -> str:
        """Return why an actor cannot stop in a bay; "" if it can, or if that is not known."""
        if actor is None:
            own = any(actor.name == name for actor in self._case.scenario.actors)
            return "" if own or name not in self._actors else "the background traffic does not leave its lanes"
        return "" if lane_kind(actor.model) == "bus" else "only buses may use it"

    def _on_the_way(
        self, kind: str, place: m.Place, actor: PlacedActor | None, about: str, *, stop: m.BusStop | None = None
    ) -> Iterator[Problem]:
        """Yield a problem if a place that an actor should reach does not exist or is not on its way; store the
        place."""
        if isinstance(place, m.OfActor):
            return  # its position depends on the run
        try:
            spot = self._spot(place)
        except UnsettledError:
            return  # the error is reported at the actor to which the place refers
        except RouteError as err:
            yield Problem("", kind, "FS252", err.message, err.help, about)
            return
        if stop is not None:
            self.places[m.AtStop(stop=stop.name)] = spot.x, spot.y
        elif not isinstance(place, m.Point):
            self.places[place] = spot.x, spot.y
        if actor is None or self._case.snapshot:  # a clip's routes lack the places that were passed before it begins
            return
        line = actor.line if actor.line is not None else line_of(actor.path) if len(actor.path) else None
        spots = [(spot.x, spot.y)]
        if stop is not None and (bay := self._network.stop(stop.name)).bay:  # the actor's line may begin in the bay
            spots.append(bay.lane.line.at(bay.pos_m)[:2])
        off_m = 0.0 if line is None else min(abs(line.project(x, y)[1]) for x, y in spots)
        if off_m > GOAL_OFF_M:
            what = "that place" if stop is None else f"the stop {stop.name}"
            help = "name a place on its way" if stop is None else f"lead its route over {stop.road}"
            message = f"{actor.id} does not pass {what}: its way is " + metres(off_m, 0) + " away from it"
            yield Problem("", kind, "FS252", message, help, about)

    def _path(self, kind: str, action: m.FollowsPath, actor: PlacedActor | None) -> Iterator[Problem]:
        """Yield problems of the points of a path, and of the way that follows it."""
        end: XY | None = None
        for place in action.points:
            yield from self._on_the_way(kind, place, None, action.actor)
            end = (si_of(place.x), si_of(place.y)) if isinstance(place, m.Point) else self.places.get(place)
        if not action.edges or actor is None:
            return
        if actor.model.kind not in WHEELS:
            yield Problem("", kind, "FS257", f"{actor.id} cannot join the traffic", "leave out " + write("then joins"))
        else:
            kind_of_lane = lane_kind(actor.model)
            try:
                if end is not None:
                    joined_way(self._network, action.edges, end, kind_of_lane)
                else:  # where the path ends depends on the run, but not whether its edges exist and lead on
                    self._network.route_edges(m.EdgeRoute(edges=action.edges, shortest=True), kind_of_lane)
            except RouteError as err:
                yield Problem("", kind, "FS250", err.message, err.help, action.actor)

    def _stage(self, kind: str, junction: str, stage: str) -> Iterator[Problem]:
        signal = self._signals.get(junction)
        if signal is None:
            message = f"there is no signal at {junction}"
            help: HelpText = did_you_mean(junction, self._signals)
            if not self._signals:
                help = (
                    "no junction has a signal: write " + write("signals") + " and stages where the junction is defined"
                )
            field = ("shows" if kind != "signal" else "signal", "junction")
            yield Problem("", kind, "FS251", message, help, junction, field=field)
        elif stage not in signal.stages:
            message = f"the signal at {junction} has no stage called {stage}"
            help = "its stages are " + one_of(signal.stages)
            if stage in m.SIGNAL_COLOURS:
                help += "; for the colour that it shows to an actor, write " + write(
                    f"ego.signal({junction}) is {stage}"
                )
            yield Problem("", kind, "FS251", message, help, stage)

    def _junction(self, actor: str, at: str, junction: str, field: tuple[str, str] = ("", "")) -> Iterator[Problem]:
        """Yield a problem if there is no such junction; `field`: see `Problem`."""
        if not self._network.is_junction(junction):
            message, help = f"there is no junction called {junction}", did_you_mean(junction, self._network.junctions)
            yield Problem(actor, at, "FS251", message, help, junction, field=field)

    def _meeting(
        self, owner: str, at: str, name: str, item: m.Meets | m.MeetsState, placed: Mapping[str, PlacedActor]
    ) -> Iterator[Problem]:
        """Yield a problem for each actor of a meeting whose route does not go over the junction."""
        junction = word_of(item.junction)
        for member in (name, item.other):
            actor = placed.get(member)
            if actor is None or self._case.snapshot:  # a clip's routes lack the junctions passed before it begins
                continue
            if over := _misses(actor, junction):
                message = f"{name} cannot meet {item.other} at {junction}: {member} does not go over it"
                yield Problem(owner, at, "FS258", message, f"{member} goes over " + over, junction)


def _beside(stop: m.BusStop) -> str:
    """Return, in the language, the place on the lane for cars beside a bus stop."""
    return f"{written(stop.at)} along {stop.road}"


def _misses(actor: PlacedActor, junction: str) -> HelpText:
    """Return a help with the junctions on an actor's route; "" if this junction is among them, or there is no route."""
    if actor.line is None or actor.line.passage(junction) is not None:
        return ""
    return one_of((p.junction for p in actor.line.passages), wrong=junction) or "no junction"


def never_near(
    scenario: m.Scenario, placed: Iterable[PlacedActor], places: Mapping[m.Place | m.AtStop, XY], network: Topology
) -> Iterator[Problem]:
    """Yield a problem for each condition `within LENGTH of` a place or junction that its actor's way does not reach.

    `placed` holds the actors at the first frame; `places` holds the coordinates of the places on routes and edges, m.
    """
    by_name = {actor.id: actor for actor in placed}
    for kind, condition in _conditions(scenario):
        for part in parts(condition):
            actor = by_name.get(part.actor) if isinstance(part, m.Within) else None
            if not isinstance(part, m.Within) or actor is None:
                continue
            there = _outline(part.of, places, network)
            if not there:
                continue
            off = min(distance_to(x, y, _way(actor)) for x, y in there)
            room = math.hypot(actor.model.length_m, actor.model.width_m) / 2 + _BESIDE_M[actor.control] + _size(there)
            if off > si_of(part.distance) + room:
                message = f"{actor.id} never comes within that distance: its way remains " + metres(off, 0) + " away"
                yield Problem("", kind, "FS330", message, "name a place that its way passes", part=part.of)


_NEW_WAY = (m.FollowsPath, m.LeavesTrack)
"""Actions after which an actor may come to other junctions."""


def never_passed(scenario: m.Scenario, placed: Iterable[PlacedActor], network: Topology) -> Iterator[Problem]:
    """Yield a problem for each `ignores` or `meets` at a junction that an actor never passes.

    A meeting of actors on routes is checked as an error before.
    """
    by_name = {actor.id: actor for actor in placed}
    actions = [(when.kind, action) for when in scenario.all(m.When) for action in all_actions(when.actions)]
    rules: list[tuple[str, str, str, m.Item]] = [
        (actor.name, item.kind, actor.name, item)
        for actor in scenario.actors
        for item in actor.body
        if isinstance(item, m.IgnoresRule | m.MeetsState)
    ]
    rules += [("", kind, item.actor, item) for kind, item in actions if isinstance(item, m.Ignores | m.Meets)]
    elsewhere = {action.actor for _, action in actions if isinstance(action, _NEW_WAY)}
    elsewhere |= {a.name for a in scenario.actors if any(isinstance(item, m.Track | m.Joins) for item in a.body)}
    for owner, kind, name, item in rules:
        if not isinstance(item, m.IgnoresRule | m.Ignores | m.MeetsState | m.Meets) or item.junction is None:
            continue
        junction = word_of(item.junction)
        members = (name,) if isinstance(item, m.IgnoresRule | m.Ignores) else (name, item.other)
        for member in members:
            actor = by_name.get(member)
            if actor is not None and member not in elsewhere and _stays_off(actor, junction, network):
                message = f"{member} never passes {junction}, so this has no effect"
                help: HelpText = remove("remove it")
                if actor.line is not None and (over := _misses(actor, junction)):
                    help = f"{member} goes over " + over + "; or " + remove("remove it")
                yield Problem(owner, kind, "FS333", message, help, junction)


def _stays_off(actor: PlacedActor, junction: str, network: Topology) -> bool:
    """Return whether an actor's way neither goes over a junction nor ends at it."""
    there = _outline(m.Named(name=junction), {}, network)
    if not there or (actor.line is not None and actor.line.passage(junction) is not None):
        return False
    way = _way(actor)
    way = way[-1:] * 2 if actor.line is not None else way
    room = math.hypot(actor.model.length_m, actor.model.width_m) / 2 + _BESIDE_M["path"] + _size(there)
    return min(distance_to(x, y, way) for x, y in there) > room


def _conditions(scenario: m.Scenario) -> Iterator[tuple[str, m.Condition]]:
    """Yield every condition that a run evaluates, with the kind of its statement."""
    for when in scenario.all(m.When):
        yield when.kind, when.condition
        for action in all_actions(when.actions):
            if isinstance(action, m.Then) and action.condition is not None:
                yield when.kind, action.condition
    for expect in scenario.all(m.Expect):
        yield expect.kind, expect.condition


def _outline(of: m.Named | m.Place, places: Mapping[m.Place | m.AtStop, XY], network: Topology) -> Points:
    """Return the point of a place, or the corners of a junction; empty for a place that moves."""
    if isinstance(of, m.Named):
        junction = network.junctions.get(word_of(of.name))
        return junction.polygon if junction is not None else ()
    if isinstance(of, m.Point):
        return ((si_of(of.x), si_of(of.y)),)
    return (places[of],) if of in places else ()


def _size(outline: Points) -> float:
    """Return the largest distance between the first corner and another one, m, because a way may pass between two
    corners.
    """
    (x, y), *rest = outline
    return max((math.hypot(a - x, b - y) for a, b in rest), default=0.0)


def _way(actor: PlacedActor) -> Points:
    if actor.line is not None:
        return actor.line.xy
    return actor.path if len(actor.path) > 1 else ((actor.x, actor.y), (actor.x, actor.y))
