"""Reader of one OpenSCENARIO file with given parameter values: actors, triggers and end of a scenario."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Set
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.placement.statements import WHEELS
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import all_actions
from foresee_exchange.naming import number, quantity, sentence
from foresee_exchange.openscenario.losses import Coordinates, Losses, NotExpressed, SourceError
from foresee_exchange.openscenario.reading.actions import ROUTING, TriggerBuilder
from foresee_exchange.openscenario.reading.actors import ActorBuilder, trajectory_of
from foresee_exchange.openscenario.reading.beginnings import Beginning
from foresee_exchange.openscenario.reading.conditions import ConditionReader
from foresee_exchange.openscenario.reading.entities import (
    EntityState,
    Participants,
    Requirements,
)
from foresee_exchange.openscenario.reading.inits import Inits
from foresee_exchange.openscenario.reading.places import Places, positions_of
from foresee_exchange.openscenario.reading.roads import Roads
from foresee_exchange.openscenario.reading.source import Source
from foresee_exchange.openscenario.reading.storyboard import (
    Event,
    arrange,
    at_once,
    begins_at,
    changing,
    read_events,
    used_names,
)
from foresee_exchange.openscenario.reading.ways.curves import vertices
from foresee_exchange.openscenario.reading.ways.trajectories import nearest

_END_S = 60.0
"""Duration of the run if the file states no duration, s (the language's own default)."""
_SAYS_SO = re.compile(r"\s*CARLA\s*:", re.IGNORECASE)
_ENOUGH = 2
"""Least number of vehicles whose places decide whether coordinates are left-handed, if the file gives no hint: a single
vehicle may be on the wrong side on purpose (ours)."""
_TOWN = re.compile(r"(^|[/\\])Town\d\d", re.IGNORECASE)


class NowhereError(SourceError):
    """Raised if the ego has no place on the network; another vehicle may have one."""


@lru_cache(maxsize=2)
def _network(path: Path, changed_ns: int) -> RoadNetwork:
    """Return a network, cached because all value sets of a variation share it."""
    del changed_ns
    return read_network(foreign_net(path))


@lru_cache(maxsize=2)
def _roads(path: Path, changed_ns: int) -> Roads:
    del changed_ns
    return Roads(path)


class ScenarioReader:
    """Reads one file, with one set of parameter values, into the statements of a scenario."""

    def __init__(
        self,
        source: Source,
        participants: Participants,
        network_path: Path,
        losses: Losses,
        coordinates: Coordinates,
        without: Set[str] = frozenset(),
    ) -> None:
        self.source, self.losses = source, losses
        self.network = _network(network_path, network_path.stat().st_mtime_ns)
        self.entities = dict(participants.entities)
        self.catalogue = participants.catalogue
        ego = next(ref for ref, entity in self.entities.items() if entity.name == "ego")
        self.inits = Inits.read(source, ego, losses)
        for ref in self.inits.removed - {ego}:
            self.entities.pop(ref, None)
        for ref in [ref for ref, entity in self.entities.items() if entity.name in without]:
            losses.lose("entities that begin on top of others", f"'{ref}'")
            del self.entities[ref]
        self.events = read_events(source, losses)
        placed = self.inits.positions
        vehicles = [placed[ref] for ref, e in self.entities.items() if e.kind in WHEELS and ref in placed]
        mirrored, why = is_left_handed(source, vehicles, self.network, coordinates)
        if mirrored:
            losses.note(
                f"coordinates are left-handed ({why}), and mirrored; places are the vehicles' centres, as in CARLA"
            )
            self.entities = {ref: dataclasses.replace(e, centre_m=0.0) for ref, e in self.entities.items()}
        self.places = Places(
            _roads(network_path, network_path.stat().st_mtime_ns) if network_path.name.endswith(".xodr") else None,
            self.inits.positions,
            source.referred,
            self._along,
            mirrored,
            source.minor,
            self.inits.earlier,
            line_of=lambda trajectory, places: [vertex.pose for vertex in vertices(trajectory, places)],
        )
        self._fill_places()
        self.states: dict[str, EntityState] = {}
        self._remarks: dict[int, list[str]] = {}
        self._body: list[m.ScenarioItem] = []

    def scenario(self, name: str, network_name: str) -> tuple[m.Scenario, dict[int, list[str]]]:
        """Return the scenario, and the comments before its statements by their index."""
        self._body += [
            m.Doc(text=sentence(self.source.description or self.source.path.name)),
            m.Tags(names=("openscenario",)),
            m.UseNetwork(path=network_name),
            *([m.UseModels(path=f"{name}_models.foresee")] if self.catalogue is not None else []),
        ]
        for _ in self.source.root.iterfind("RoadNetwork/TrafficSignals/TrafficSignalController"):
            self.losses.leave("programs of signals")
        for weather in self.inits.weather():
            self._add(weather)
        self.states = states = self._actors()
        built = {ref: self.entities[ref] for ref in states}
        arrange(self.events, dataclasses.replace(self._reader(), entities=built, ways=self._ways))
        builder = TriggerBuilder(states, self.losses, self.places, self.network, self._only_end())
        for when in builder.whens([*self.inits.events, *self.events]):
            self._add(when)
        self._add(m.Expect(mode="never", condition=m.Predicate(what="collision", actor="ego")))
        self._add(m.End(after=quantity(_end_s(self.source, self.losses), "time"), where="anywhere"))
        return m.Scenario(name=name, body=tuple(self._body)), self._remarks

    def requirements_of_models(self, scenario: m.Scenario) -> dict[str, Requirements]:
        """Return what a scenario requires of the new models, by their names: the speeds of its actors, and how fast
        these change."""
        highest_mps: dict[str, float] = {}
        for actor in scenario.actors:
            speeds = [actor.state.speed] if actor.state is not None else []
            speeds += [item.speed for item in actor.body if isinstance(item, m.CruiseSpeed)]
            highest_mps[actor.name] = max((speed.si for speed in speeds if isinstance(speed, m.Quantity)), default=0.0)
        for when in scenario.all(m.When):
            for change in all_actions(when.actions):
                if isinstance(change, m.ChangesSpeed) and isinstance(change.to, m.Quantity):
                    highest_mps[change.actor] = max(highest_mps.get(change.actor, 0.0), change.to.si)
        requirements: dict[str, Requirements] = {}
        for ref, entity in self.entities.items():
            state = self.states.get(ref)
            own = Requirements(
                highest_mps.get(entity.name, 0.0), *((state.rises_mps2, state.falls_mps2) if state else ())
            )
            requirements[entity.model] = Requirements(*map(max, own, requirements.get(entity.model, own)))
        return requirements

    def _add(self, item: m.ScenarioItem) -> None:
        """Append a statement, with comments on the parts lost since the previous one."""
        if remarks := self.losses.remarks():
            self._remarks[len(self._body)] = remarks
        self._body.append(item)

    def _along(self, x: float, y: float) -> float | None:
        """Return the direction of the road at a point (of the lane, without an OpenDRIVE map); None off the roads."""
        place = self.places.roads.locate(Pose(x, y, math.nan)) if self.places.roads is not None else None
        if place is not None and self.places.roads is not None:
            return self.places.roads.on_reference(place.road, place.s, 0.0).heading_rad
        near = self.network.nearest_lane(x, y, None, "car", 5.0)
        return None if near is None else near.lane.line.at(near.pos_m)[2]

    def _reader(self) -> ConditionReader:
        """Return a reader of conditions that knows the actors' beginnings, but not yet their ways."""
        values = self.source.variables()
        beginnings = {
            self.entities[ref].name: Beginning(
                middle, speed, self.entities[ref].spec.length_m, self.entities[ref].spec.width_m
            )
            for ref, (middle, speed) in self._beginnings(with_ego=True).items()
        }
        return ConditionReader(
            self.entities, self.places, self.losses, {}, values, changing(self._all_events), beginnings
        )

    @property
    def _all_events(self) -> list[Event]:
        return [*self.inits.events, *self.events]

    def _only_end(self) -> frozenset[str]:
        """Return the variables that actions change and that only the end of the storyboard uses."""
        return changing(self._all_events) - used_names(self._all_events)

    def _fill_places(self) -> None:
        """Fill in places and speeds from immediate events, and places of entities that have only a trajectory."""
        self.inits.take_at_once(at_once(self.events, self._reader()))
        moved = {ref for event in (*self.events, *self.inits.events) for ref in event.refs} | set(self.inits.routing)
        ego = next(ref for ref, entity in self.entities.items() if entity.name == "ego")
        self.places.moving = frozenset({ego, *moved, *(ref for ref, speed in self.inits.speeds.items() if speed)})
        for ref, routing in self._routing().items():
            trajectory = trajectory_of(self.source, routing) if routing.tag == "FollowTrajectoryAction" else None
            first = next(positions_of(trajectory), None) if trajectory is not None else None
            if first is not None and ref not in self.inits.positions:
                self.inits.positions[ref] = first

    def _routing(self) -> dict[str, Element]:
        """Return the first routing action of each entity."""
        routing = dict(self.inits.routing)
        for event in self.events:
            for action in (action for kind in event.actions for action in kind.iterfind("RoutingAction/*")):
                if action.tag in ROUTING:
                    routing = {**dict.fromkeys(event.refs, action), **routing}
        return routing

    def _begins(self) -> dict[str, float | None]:
        """Return when the first routing action of each entity's events begins, s; None if the run decides."""
        begins: dict[str, float | None] = {}
        for event in self.events:
            if any(action.tag in ROUTING for kind in event.actions for action in kind.iterfind("RoutingAction/*")):
                begins = {**dict.fromkeys(event.refs, begins_at(event, self.events, self._reader())), **begins}
        return begins

    def _actors(self) -> dict[str, EntityState]:
        """Add the actors; return the state of each."""
        changers = self._acting("LaneChangeAction")
        builder = ActorBuilder(
            self.source,
            self.network,
            self.places,
            self.losses,
            # An actor that keeps a lateral position needs lanes, and so does one that changes lane on a map without
            # lane positions.
            lane_keepers=self._acting("LaneOffsetAction", "LateralDistanceAction")
            | (changers if self.places.roads is None else set()),
            lane_changers=changers,
            beginnings=self._beginnings(),
        )
        self._ways = builder.ways
        routing, begins = self._routing(), self._begins()
        acting = {ref for event in (*self.events, *self.inits.events) for ref in event.refs}
        states: dict[str, EntityState] = {}
        first: list[m.When] = []
        for ref, entity in sorted(self.entities.items(), key=lambda e: e[1].name != "ego"):
            state = EntityState(entity, self.inits.speeds.get(ref, 0.0), *self._lane(ref))
            state.way = routing.get(ref)
            at_start = ref in self.inits.routing
            built = builder.actor(
                state,
                state.way,
                begins_s=0.0 if at_start else begins.get(ref, 0.0),
                at_start=at_start,
                acts=ref in acting,
            )
            if built is not None:
                self._add(built.statement)
                states[ref] = state
                first += built.whens
            elif entity.name == "ego":
                raise NowhereError(
                    f"{self.source.path}: the ego '{ref}' does not stand on a lane of its direction and cannot be "
                    "driven: choose another vehicle with --ego"
                )
        for when in first:
            self._add(when)
        return states

    def _acting(self, *tags: str) -> set[str]:
        """Return the entities that have a lateral action of the given kinds."""
        events = (*self.events, *self.inits.events)
        acting = (
            e
            for e in events
            if any(kind.find(f"LateralAction/{tag}") is not None for kind in e.actions for tag in tags)
        )
        return {ref for e in acting for ref in e.refs}

    def _beginnings(self, *, with_ego: bool = False) -> dict[str, tuple[Pose, float]]:
        """Return the pose of the centre of each entity (except the ego) at the beginning, and its speed, m/s."""
        beginnings = {}
        for ref, entity in self.entities.items():
            if entity.name == "ego" and not with_ego:
                continue
            try:
                middle = self.places.initial(ref).ahead(entity.centre_m)
            except (NotExpressed, SourceError):
                continue
            beginnings[ref] = middle, self.inits.speeds.get(ref, 0.0)
        return beginnings

    def _lane(self, ref: str) -> tuple[int | None, bool]:
        """Return the id of an entity's lane, if its road is known, and whether it faces in the road's direction."""
        place = self.places.lane_of(ref) if self.places.roads is not None else None
        if place is None or self.places.roads is None:
            return None, True
        road = self.places.roads.on_reference(place.road, place.s, 0.0).heading_rad
        try:
            off = self.places.initial(ref).heading_rad - road
        except NotExpressed:
            return None, True
        return place.lane or None, abs(math.remainder(off, math.tau)) < math.pi / 2


def _end_s(source: Source, losses: Losses) -> float:
    """Return the time at which the storyboard stops, s."""
    times = []
    for group in source.root.iterfind("Storyboard/StopTrigger/ConditionGroup"):
        conditions = group.findall("Condition")
        stop_times = [condition.find("ByValueCondition/SimulationTimeCondition") for condition in conditions]
        if len(stop_times) == 1 and stop_times[0] is not None and stop_times[0].get("rule") != "lessThan":
            times.append(number(stop_times[0], "value") + number(conditions[0], "delay", 0.0))
        else:
            losses.leave("conditions that end the storyboard (the run goes on)")
    positive = [t for t in times if t > 0]
    return min(positive) if positive else _END_S


def is_left_handed(
    source: Source, positions: Iterable[Element], network: RoadNetwork, wanted: Coordinates
) -> tuple[bool, str]:
    """Return whether a file's world positions are left-handed, and the reason (empty if they are not).

    `positions`: the positions of the file's vehicles. CARLA's scenario_runner takes coordinates as left-handed if the
    description begins with `CARLA:`. Otherwise they are left-handed if all vehicles stand on lanes only when mirrored;
    in a CARLA town, if more vehicles stand on lanes when mirrored than when not.
    """
    if wanted is not Coordinates.auto:
        return wanted is Coordinates.left, "as --coordinates says" if wanted is Coordinates.left else ""
    if _SAYS_SO.match(source.description):
        return True, "the file's description says CARLA"
    logic = source.root.find("RoadNetwork/LogicFile")
    town = logic is not None and _TOWN.search(logic.get("filepath", "")) is not None
    poses = [pose for position in positions if (pose := _world(position)) is not None]
    plain, mirrored = (sum(_fits(network, pose, side) for pose in poses) for side in (1.0, -1.0))
    decided = plain < mirrored if town else plain == 0 and len(poses) >= _ENOUGH
    if mirrored == len(poses) > 0 and decided:
        return True, "only then do its actors stand on lanes"
    return False, ""


def _world(position: Element) -> Pose | None:
    kind = position.find("WorldPosition")
    try:
        return None if kind is None else Pose(number(kind, "x"), number(kind, "y"), number(kind, "h", math.nan))
    except ExchangeError:
        return None


def _fits(network: RoadNetwork, pose: Pose, side: float) -> bool:
    """Return whether a pose is on a lane and, if it has a heading, faces in the lane's direction; `side` -1 mirrors the
    pose."""
    if math.isnan(pose.heading_rad):
        return network.nearest_lane(pose.x, pose.y * side, None, "car", 3.0) is not None
    return nearest(network, Pose(pose.x, pose.y * side, pose.heading_rad * side), "car") is not None
