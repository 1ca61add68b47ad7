"""Checks a scenario on its network: unknown names, actors off the road, excessive speeds, overlapping actors."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from foresee_dsl.compile.bundle import PlacedActor, Signal
from foresee_dsl.compile.placement.paths import joined_way
from foresee_dsl.compile.placement.spots import Spot, UnsettledError
from foresee_dsl.compile.placement.starts import OFF_ROUTE_M
from foresee_dsl.compile.placement.statements import WHEELS, lane_kind, path_of
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Points, line_of
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.errors import MessageText, measured
from foresee_dsl.helps import HelpText, one_of, write
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.printer import written
from foresee_dsl.language.project.document import Problem, TestCase
from foresee_dsl.language.traversal import all_actions, parts, si_of, word_of

NEAR_ROAD_M = 30.0
"""Maximum distance of pedestrians, obstacles and actors on paths from a lane, m (ours: a larger distance is probably a
mistake of the author).
"""
GOAL_OFF_M = 5.0
"""A goal that is farther than this from the ego's centreline is on another road, m (ours: more than a lane's width)."""
_MOST_NAMED = 20
"""Maximum number of reported problems of a kind (ours: they fill a screen; without a limit, 500 actors in one place
would make 124,750 problems).
"""
_MOST_COUNTED = 10_000
"""Maximum number of further overlapping pairs that are counted (ours: counting them takes 0.2 s)."""
_TOUCH_M2 = 1e-4
"""Largest overlap of two footprints that is attributed to rounding, m^2 (ours: 1 cm^2)."""

_OTHER_COLOURS = {"yellow": "amber", "orange": "amber"}
"""Other names of signal colours, each with the colour of the language."""


def of_place(actor: m.Ego | m.Actor, placed: PlacedActor, network: RoadNetwork) -> Iterator[Problem]:
    """Yield a problem if an actor is too far from the road, or in a building."""
    path = path_of(actor)
    at = "state" if actor.state is not None else (path.kind if path is not None else "start_at")
    if placed.control in ("ego", "sumo"):
        kind = lane_kind(placed.model)
        away = network.distance_to_lanes(placed.x, placed.y, kind)
        if away > OFF_ROUTE_M:
            how_far = measured(f"{away:.1f}") + " m" if math.isfinite(away) else "nowhere"
            message = f"{placed.id} is off the road: the nearest lane for a {kind} is " + how_far + " away"
            yield Problem(placed.id, at, "FS253", message, _nearest_road(placed.x, placed.y, network))
        return
    far = network.far_from_lanes(((placed.x, placed.y), *placed.path), NEAR_ROAD_M)
    if far is not None:
        x, y = far
        spot = "(" + measured(f"{x:.1f}") + " m, " + measured(f"{y:.1f}") + " m)"
        message = f"{placed.id} is off the road: " + spot + f" is over {NEAR_ROAD_M:.0f} m from every lane"
        yield Problem(placed.id, at, "FS253", message, _nearest_road(x, y, network))
    wall = network.wall_on_the_way(placed.path or ((placed.x, placed.y),))
    if wall is not None:
        x, y = wall
        message = (
            f"{placed.id} is in a building: its outline has a corner at ("
            + measured(f"{x:.1f}")
            + " m, "
            + measured(f"{y:.1f}")
            + " m)"
        )
        help_ = "lead it around the building, or make the building smaller"
        yield Problem(placed.id, at, "FS259", message, help_)


def of_speed(actor: m.Ego | m.Actor, placed: PlacedActor, slack: float) -> Iterator[Problem]:
    """Yield a problem if an actor's speed exceeds its model's maximum by more than the factor `slack`, which allows for
    rounding."""
    if placed.control == "static":
        return
    speeds = [("speed", placed.cruise_mps)] if any(isinstance(i, m.CruiseSpeed) for i in actor.body) else []
    speeds.append(("state" if actor.state is not None else "start_speed", placed.speed_mps))
    too_fast = next(((at, speed) for at, speed in speeds if speed > placed.model.max_speed_mps * slack), None)
    if too_fast is not None:
        at, speed = too_fast
        most = placed.model.max_speed_mps * slack / slack * 3.6
        message = (
            f"{placed.id} has a speed of "
            + measured(f"{speed * 3.6:.0f}")
            + f" km/h, but {placed.model.name} can reach only "
            + measured(f"{most:.0f}")
            + " km/h"
        )
        help_ = "use at most " + write(f"{math.floor(most)} km/h") + ", or a faster model"
        yield Problem(placed.id, at, "FS256", message, help_)


def of_overlaps(
    placed: Sequence[PlacedActor], actors: Mapping[str, m.Ego | m.Actor], *, clip: bool
) -> Iterator[Problem]:
    """Yield a problem for each pair of actors that overlap.

    In a clip only overlaps with the ego count: pedestrians on paths do not evade each other, and a clip reproduces the
    moment of a run in which two of them overlap.
    """
    pairs = 0
    boxes = [footprint(actor) for actor in placed]
    reach = [math.hypot(actor.model.length_m, actor.model.width_m) for actor in placed]
    for k, box in enumerate(boxes):
        for j in range(min(k, 1) if clip else k):
            if placed[k].comes_later or placed[j].comes_later or (_is_recorded(placed[k]) and _is_recorded(placed[j])):
                continue
            apart = math.hypot(placed[k].x - placed[j].x, placed[k].y - placed[j].y)
            if apart < reach[k] + reach[j] and common_area(box, boxes[j]) > _TOUCH_M2:
                message = f"{placed[k].id} starts on top of {placed[j].id}"
                help_: HelpText = (
                    f"both are at ({placed[k].x:.1f} m, {placed[k].y:.1f} m), give one of them another start"
                )
                help_ += _farther(actors.get(placed[k].id), placed[k], placed[j])
                yield Problem(placed[k].id, "start_at", "FS254", message, help_)
                pairs += 1
                if pairs == _MOST_NAMED + _MOST_COUNTED:
                    return


def _is_recorded(actor: PlacedActor) -> bool:
    """Return whether an actor follows a recorded track; in recordings, boxes of neighbours may overlap."""
    return actor.control == "path" and actor.playback is not None


def few(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """Return the first problems of each kind; a single problem with a count replaces the others of a kind."""
    named: list[Problem] = []
    rest: dict[str, list[Problem]] = {}
    counts = Counter[str]()
    for problem in problems:
        counts[problem.code] += 1
        if counts[problem.code] <= _MOST_NAMED:
            named.append(problem)
        else:
            rest.setdefault(problem.code, []).append(problem)
    for code, left in rest.items():
        if len(left) == 1:
            named += left
            continue
        least = "at least " if code == "FS254" and len(left) >= _MOST_COUNTED else ""
        message = least + measured(f"{len(left):,}") + " more errors of this kind: the last is that " + left[-1].message
        named.append(replace(left[-1], message=message, help="correct the errors above, and check again"))
    return tuple(named)


def _farther(actor: m.Ego | m.Actor | None, first: PlacedActor, other: PlacedActor) -> HelpText:
    """Return a start farther along at which there is room; "" if the actor's start is not a position along an edge or
    route."""
    start = next((item for item in actor.body if isinstance(item, m.StartAt)), None) if actor is not None else None
    place = start.place if start is not None else None
    if not isinstance(place, m.AlongEdge | m.AlongRoute) or not isinstance(place.at, m.Quantity):
        return ""
    room = math.ceil(first.model.length_m + other.model.length_m)
    at = m.Quantity.of(place.at.si + room, "length", 2)
    return ": " + write(f"start at {written(place.model_copy(update={'at': at}))}")


def footprint(actor: PlacedActor) -> Points:
    """Return the corners of an actor's oriented box, counter-clockwise."""
    back = actor.model.length_m / 2 if actor.control in ("ego", "sumo") else 0.0
    c, s = math.cos(actor.heading_rad), math.sin(actor.heading_rad)
    x, y = actor.x - back * c, actor.y - back * s
    half_length, half_width = actor.model.length_m / 2, actor.model.width_m / 2
    corners = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return tuple(
        (x + a * half_length * c - b * half_width * s, y + a * half_length * s + b * half_width * c) for a, b in corners
    )


def common_area(first: Points, second: Points) -> float:
    """Return the common area of two convex outlines, both counter-clockwise, m^2 (Sutherland-Hodgman)."""
    left: list[XY] = list(first)
    for k, (x0, y0) in enumerate(second):
        x1, y1 = second[(k + 1) % len(second)]
        sides = [(x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) for x, y in left]
        clipped: list[XY] = []
        for i, ((x, y), side) in enumerate(zip(left, sides, strict=True)):
            (px, py), before = left[i - 1], sides[i - 1]
            if (side < 0) != (before < 0):
                share = before / (before - side)
                clipped.append((px + share * (x - px), py + share * (y - py)))
            if side >= 0:
                clipped.append((x, y))
        left = clipped
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(left, left[1:] + left[:1], strict=True)) / 2


def _nearest_road(x: float, y: float, network: RoadNetwork) -> HelpText:
    near = network.nearest_lane(x, y, within_m=1000.0)
    if near is None:
        return ""
    nx, ny, _ = near.lane.line.at(near.pos_m)
    return f"the nearest lane is on {near.lane.edge}, at " + write(f"({nx:.1f} m, {ny:.1f} m)")


class NameChecks:
    """Checks the statements of a concrete scenario that name parts of the network.

    `signals` holds the signals by junction. `spot` returns the position of a place, or raises `RouteError`.
    """

    def __init__(
        self, case: TestCase, network: RoadNetwork, signals: Mapping[str, Signal], spot: Callable[[m.Place], Spot]
    ) -> None:
        self._case, self._network, self._signals, self._spot = case, network, signals, spot
        self._actors = {actor.name for actor in case.scenario.actors} | {
            f"{traffic.name}_{k:02d}"
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
        for state in scenario.all(m.SignalState):
            yield from self._stage(state.kind, word_of(state.junction), word_of(state.stage))
        for kind, condition in self._conditions():
            for part in parts(condition):
                yield from self._part(kind, part, by_name)
        for when in scenario.all(m.When):
            for action in all_actions(when.actions):
                yield from self._action(when.kind, action, by_name)
        if not self._case.snapshot:  # a clip's routes lack the junctions that were passed before it begins
            yield from self._meetings(by_name)

    def _conditions(self) -> Iterator[tuple[str, m.Condition]]:
        """Yield every condition that a run evaluates, with the kind of its statement."""
        for when in self._case.scenario.all(m.When):
            yield when.kind, when.condition
            for action in all_actions(when.actions):
                if isinstance(action, m.Then) and action.condition is not None:
                    yield when.kind, action.condition
        for expect in self._case.scenario.all(m.Expect):
            yield expect.kind, expect.condition

    def _part(self, kind: str, part: m.Condition, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        if isinstance(part, m.Comparison) and isinstance(part.left, m.Measure) and part.left.other is not None:
            other = word_of(part.left.other)
            if other not in self._actors:
                yield from self._junction("", kind, other)
        elif isinstance(part, m.InJunction) and part.junction is not None:
            yield from self._junction("", kind, word_of(part.junction))
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
            case m.Meets() | m.Ignores() if action.junction is not None:
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
            yield Problem(
                "",
                kind,
                "FS252",
                f"{actor.id} does not pass {what}: its way is " + measured(f"{off_m:.0f}") + " m away from it",
                help,
                about,
            )

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
        elif end is not None:
            try:
                joined_way(self._network, action.edges, end, lane_kind(actor.model))
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

    def _junction(self, actor: str, at: str, junction: str) -> Iterator[Problem]:
        if not self._network.is_junction(junction):
            message = f"there is no junction called {junction}"
            yield Problem(actor, at, "FS251", message, did_you_mean(junction, self._network.junctions), junction)

    def _meetings(self, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        """Yield a problem for each meeting at a junction that is not on both actors' routes."""
        for actor in self._case.scenario.actors:
            for item in actor.body:
                if isinstance(item, m.MeetsState):
                    yield from _meeting(actor.name, item.kind, actor.name, item, placed)
        for when in self._case.scenario.all(m.When):
            for action in all_actions(when.actions):
                if isinstance(action, m.Meets):
                    yield from _meeting("", when.kind, action.actor, action, placed)


def _meeting(
    owner: str, at: str, name: str, item: m.Meets | m.MeetsState, placed: Mapping[str, PlacedActor]
) -> Iterator[Problem]:
    junction = word_of(item.junction)
    for member in (name, item.other):
        actor = placed.get(member)
        if actor is not None and (over := _misses(actor, junction)):
            message = f"{name} cannot meet {item.other} at {junction}: {member} does not go over it"
            yield Problem(owner, at, "FS258", message, f"{member} goes over " + over, junction)


def _beside(stop: m.BusStop) -> str:
    """Return, in the language, the place on the lane for cars beside a bus stop."""
    return f"{written(stop.at)} along {stop.road}"


def _misses(actor: PlacedActor, junction: str) -> HelpText:
    """Return a help with the junctions on an actor's route; "" if this junction is among them, or there is no route."""
    if actor.line is None or actor.line.passage(junction) is not None:
        return ""
    return one_of(p.junction for p in actor.line.passages) or "no junction"
