"""Takes over an OpenSCENARIO XML file: its common subset becomes a scenario; what is not expressed is said."""

from __future__ import annotations

import dataclasses
import math
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile import placement_mistakes
from foresee_dsl.compile.foreign.networks import SUFFIXES, foreign_net
from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.placement.statements import WHEELS
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.errors import Diagnostic
from foresee_dsl.exchange.naming import name_of, number, quantity, sentence
from foresee_dsl.exchange.openscenario.reading.actions import ROUTING, TriggerBuilder
from foresee_dsl.exchange.openscenario.reading.actors import ActorBuilder, trajectory_of
from foresee_dsl.exchange.openscenario.reading.beginnings import Beginning
from foresee_dsl.exchange.openscenario.reading.conditions import ConditionReader
from foresee_dsl.exchange.openscenario.reading.distributions import MOST_SETS, Values, Variation, read_variation
from foresee_dsl.exchange.openscenario.reading.entities import (
    Asked,
    Participants,
    made_stronger,
    possible_egos,
    read_participants,
)
from foresee_dsl.exchange.openscenario.reading.entity_state import EntityState
from foresee_dsl.exchange.openscenario.reading.handedness import is_left_handed
from foresee_dsl.exchange.openscenario.reading.inits import Inits
from foresee_dsl.exchange.openscenario.reading.losses import Losses
from foresee_dsl.exchange.openscenario.reading.merging import Part, merged, shape_of
from foresee_dsl.exchange.openscenario.reading.places import Places, positions_of
from foresee_dsl.exchange.openscenario.reading.roads import Roads
from foresee_dsl.exchange.openscenario.reading.source import Source, declared_names, network_file, read_source
from foresee_dsl.exchange.openscenario.reading.storyboard import (
    Event,
    arrange,
    asked_for,
    at_once,
    begins_at,
    changing,
    read_events,
)
from foresee_dsl.exchange.openscenario.reading.ways.curves import vertices
from foresee_dsl.exchange.outcome import (
    Coordinates,
    ExchangeError,
    Imported,
    NotExpressed,
    SourceError,
    import_together,
    write_text,
)
from foresee_dsl.language import model as m
from foresee_dsl.language.project.loading import load_test_cases

_END_S = 60.0
"""Where the file gives no time (the language's own default)."""


def run(
    file: Path,
    *,
    out: Path,
    ego: str = "",
    road: Path | None = None,
    coordinates: Coordinates = Coordinates.auto,
    partial: bool = False,
    allow_outside: bool = False,
) -> Imported:
    """Write the scenario `NAME.foresee`, its network, and the catalogue `NAME_models.foresee` where it is needed.

    Args:
        file: the `.xosc` file. out: the folder.
        ego: the entity under test; by default the one that is called so, else the first vehicle.
        road: the network (`.xodr`, `.net.xml`), or a folder in which the one that the file names is looked for, and
            catalogues whose folders are missing; by default the one that the file names.
        coordinates: how world positions are meant.
        partial: also write a scenario from which actions, triggers or participants are lost, with comments.
        allow_outside: whether the file may name files outside its project folder.

    Raises:
        ExchangeError: it cannot be read, has no network or no vehicle, lacks a catalogue, or something would be lost.
        InputError: the scenario that comes out is impossible; nothing is written.
    """
    settings = _Settings(out, ego, road, coordinates, partial, allow_outside)
    variation = read_variation(file, allow_outside=allow_outside)
    if variation is not None:
        return _import_variation(variation, settings)
    reading = _read_playable(file, settings)
    kinds = Counter(actor.kind for actor in reading.scenario.actors)
    taken = {f"of the kind {kind}": count for kind, count in sorted(kinds.items())}
    losses = reading.losses

    def write(folder: Path) -> Imported:
        _write(reading, folder)
        return Imported((), 1, taken, +losses.left_out, tuple(losses.notes), +losses.lost)

    return import_together(out, write)


@dataclasses.dataclass(frozen=True)
class _Settings:
    """The options of an import; see `run`."""

    out: Path
    ego: str
    road: Path | None
    coordinates: Coordinates
    partial: bool
    allow_outside: bool


@dataclasses.dataclass(frozen=True)
class _Reading:
    """A file that was read, with one set of values for its parameters: the scenario, its comments, and its other files.

    Attributes:
        catalogue: of new models. asked: what each of them is asked to do, by its name.
    """

    scenario: m.Scenario
    remarks: Mapping[int, Sequence[str]]
    catalogue: m.Catalogue | None
    asked: Mapping[str, Asked]
    losses: Losses
    network_path: Path
    network_name: str
    values: Values = dataclasses.field(default_factory=dict)

    @property
    def kind(self) -> tuple[str, str, str]:
        """What readings have in common that differ only in their values."""
        return str(self.network_path), shape_of(self.scenario), repr(self.catalogue)


def _read_playable(file: Path, settings: _Settings, values: Values | None = None, name: str = "") -> _Reading:
    """Read a file with some values of its parameters, and make sure that the actors of what comes out have places; with
    `partial`, a file that nothing varies is read without those that stand on others.

    Raises:
        ExchangeError: it cannot be read or not be played on its network, or something would be lost.
    """
    source = read_source(file, allow_outside=settings.allow_outside, given=values)
    source.elsewhere = settings.road if settings.road is not None and settings.road.is_dir() else None
    name = name or name_of(file.name.partition(".")[0], "scenario")
    without: set[str] = set()
    while True:
        reading = _read(source, settings, name, without)
        if reading.losses.lost and not settings.partial:
            raise _LostError(_refusal(file, reading.losses))
        try:
            with tempfile.TemporaryDirectory(prefix="foresee-import-") as folder:
                return dataclasses.replace(_with_places(reading, file, Path(folder)), values=values or {})
        except _OnTopError as err:
            if not settings.partial or values is not None or not err.names - without - {"ego"}:
                raise
            without |= err.names - {"ego"}


def _read(source: Source, settings: _Settings, name: str, without: Set[str]) -> _Reading:
    """Read a file without some actors, by their names here, which stand on others."""
    network_path = network_file(source, settings.road, SUFFIXES)
    suffix = next(suffix for suffix in SUFFIXES if network_path.name.endswith(suffix))
    network_name = name_of(network_path.name.partition(".")[0], "map") + suffix
    nowhere: ExchangeError | None = None
    for chosen in [settings.ego] if settings.ego else possible_egos(source):
        losses = Losses()
        try:
            participants = read_participants(source, losses, name=f"{name}_models", ego=chosen)
            work = _Import(source, participants, network_path, losses, settings.coordinates, without)
            scenario, remarks = work.scenario(name, network_name)
            break
        except _NowhereError as err:
            nowhere = err
    else:
        raise nowhere or ExchangeError(f"{source.path} has no ego")
    asked = work.asked_of_models(scenario)
    return _Reading(scenario, remarks, work.catalogue, asked, losses, network_path, network_name)


def _with_places(reading: _Reading, file: Path, folder: Path) -> _Reading:
    """Return a reading whose actors have places, as a check in an empty folder says: without its goal where that is
    beside the ego's way."""
    mistakes = _write(reading, folder)
    if mistakes and all("the goal is" in mistake.message for mistake in mistakes):
        reading.losses.left_out["goals beside the ego's way (it goes to its end)"] += 1
        reading = dataclasses.replace(reading, scenario=_without_goal(reading.scenario))
        mistakes = _write(reading, folder)
    if mistakes:
        found = "; ".join(dict.fromkeys(f"{d.message}{f' ({d.help})' if d.help else ''}" for d in mistakes))
        said = f"{file} cannot be played on its network: {found}".replace(f"{folder}{os.sep}", "")
        if all(_ON_TOP in d.message for d in mistakes):
            raise _OnTopError(said, {d.message.partition(_ON_TOP)[0] for d in mistakes})
        raise ExchangeError(said)
    return reading


def _write(reading: _Reading, folder: Path) -> tuple[Diagnostic, ...]:
    """Write the files of a reading; return what is impossible in its test cases."""
    name = reading.scenario.name
    if not (folder / reading.network_name).exists():
        shutil.copyfile(reading.network_path, folder / reading.network_name)
    if reading.catalogue is not None:
        write_text(folder / f"{name}_models.foresee", made_stronger(reading.catalogue, reading.asked))
    write_text(folder / f"{name}.foresee", reading.scenario, reading.remarks)
    return placement_mistakes(load_test_cases([folder / f"{name}.foresee"]))


_MOST_SETS = 200
"""As many sets of values are read (ours: half a minute of computing)."""


def _import_variation(variation: Variation, settings: _Settings) -> Imported:
    """Import a scenario with each set of values that a file gives its parameters: a file for each kind of scenario that
    comes out, with parameters and cases."""
    name = name_of(variation.path.name.partition(".")[0], "scenario")
    sets = variation.sets(_MOST_SETS)
    groups: dict[tuple[str, str, str], list[_Reading]] = {}
    faults: dict[str, ExchangeError] = {}
    total = Losses()
    for values in sets:
        try:
            reading = _read_playable(variation.scenario, settings, values, name)
        except _LostError:
            raise
        except ExchangeError as err:
            faults.setdefault(str(err), err)
            total.lost[f"sets of parameter values: {err}"] += 1
        else:
            groups.setdefault(reading.kind, []).append(reading)
    if not groups:
        raise next(iter(faults.values()))
    if total.lost and not settings.partial:
        raise ExchangeError(_refusal(variation.path, total))
    if variation.count > len(sets):
        total.left_out["sets of parameter values (an even choice is written)"] += variation.count - len(sets)
    for unknown in sorted(set().union(*sets) - declared_names(variation.scenario)):
        total.left_out[f"values of '{unknown}', which the scenario does not declare"] += 1
    found = [
        _joined(name if len(groups) == 1 else f"{name}_{k + 1:02d}", group, variation, whole=len(groups) == 1)
        for k, group in enumerate(groups.values())
    ]
    for one in (reading.losses for group in groups.values() for reading in group):
        total.notes |= one.notes
        total.lost |= one.lost  # of each kind as many as one set of values loses
        total.left_out |= one.left_out

    def write(folder: Path) -> Imported:
        for reading in found:
            mistakes = _write(reading, folder)
            if mistakes:
                raise ExchangeError(f"{variation.path} cannot be played on its network: {mistakes[0].message}")
        cases = len(load_test_cases([folder / f"{reading.scenario.name}.foresee" for reading in found]))
        taken = {"sets of parameter values": sum(map(len, groups.values()))}
        return Imported((), cases, taken, +total.left_out, tuple(total.notes), +total.lost)

    return import_together(settings.out, write)


def _joined(name: str, group: Sequence[_Reading], variation: Variation, *, whole: bool) -> _Reading:
    """Return readings of one kind as one, with parameters and cases; `whole`: they are all that the file means."""
    first = group[0]
    same = {key: value for key, value in first.values.items() if all(one.values.get(key) == value for one in group)}
    doc = ", ".join([variation.description, *(f"{key} = {value}" for key, value in same.items())]).strip(", ")
    parts = [Part(one.values, one.scenario, one.remarks) for one in group]
    drawn = variation.drawn if whole else {}
    one = merged(parts, doc, drawn, min(variation.runs, MOST_SETS), variation.seed)
    asked: dict[str, Asked] = {}
    for reading in group:
        for model, wanted in reading.asked.items():
            asked[model] = Asked(*map(max, wanted, asked.get(model, wanted)))
    body = tuple(
        m.UseModels(path=f"{name}_models.foresee") if isinstance(item, m.UseModels) else item
        for item in one.scenario.body
    )
    scenario = one.scenario.model_copy(update={"name": name, "body": body})
    catalogue = first.catalogue and first.catalogue.model_copy(update={"name": f"{name}_models"})
    return dataclasses.replace(first, scenario=scenario, remarks=one.remarks, catalogue=catalogue, asked=asked)


def _refusal(file: Path, losses: Losses) -> str:
    what = "; ".join(f"{count} {what}" for what, count in losses.lost.items())
    return (
        f"{file} holds what the language does not express, and without it something else happens: {what}. Nothing is "
        "written; --partial writes the rest, with a comment at each place"
    )


_ON_TOP = " starts on top of "


class _OnTopError(SourceError):
    """Actors begin on top of others."""

    def __init__(self, message: str, names: set[str]) -> None:
        super().__init__(message)
        self.names = names


class _LostError(ExchangeError):
    """Something would be lost, whatever the values of the parameters are."""


class _NowhereError(SourceError):
    """The ego has no place on the network; another vehicle may have one."""


@lru_cache(maxsize=2)
def _network(path: Path, changed_ns: int) -> RoadNetwork:
    """Return a network, which the sets of a distribution have in common."""
    del changed_ns
    return RoadNetwork.from_net(foreign_net(path))


@lru_cache(maxsize=2)
def _roads(path: Path, changed_ns: int) -> Roads:
    del changed_ns
    return Roads(path)


class _Import:
    """One import: everything about a file that is read, and the statements made of it."""

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
                f"coordinates are left-handed ({why}), and turned round; places are of the vehicles' middle, as CARLA's"
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
        """Return the scenario, and the comments that stand before its statements."""
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
        reader = self._reader(dataclasses.replace(self._reader(), entities=built))
        arrange(self.events, reader)
        builder = TriggerBuilder(states, self.losses, self.places, self.network, self._only_end())
        for when in builder.whens([*self.inits.events, *self.events]):
            self._add(when)
        self._add(m.Expect(mode="never", condition=m.Predicate(what="collision", actor="ego")))
        self._add(m.End(after=quantity(_end_s(self.source, self.losses), "time")))
        return m.Scenario(name=name, body=tuple(self._body)), self._remarks

    def asked_of_models(self, scenario: m.Scenario) -> dict[str, Asked]:
        """Return what a scenario asks of the new models, by their names: the speeds of its actors, and how fast these
        change."""
        asked: dict[str, float] = {}
        for actor in scenario.actors:
            speeds = [actor.state.speed] if actor.state is not None else []
            speeds += [item.speed for item in actor.body if isinstance(item, m.CruiseSpeed)]
            asked[actor.name] = max((speed.si for speed in speeds if isinstance(speed, m.Quantity)), default=0.0)
        for when in scenario.all(m.When):
            for change in _changes_of_speed(when.actions):
                if isinstance(change.to, m.Quantity):
                    asked[change.actor] = max(asked.get(change.actor, 0.0), change.to.si)
        most: dict[str, Asked] = {}
        for ref, entity in self.entities.items():
            state = self.states.get(ref)
            own = Asked(asked.get(entity.name, 0.0), *((state.rises_mps2, state.falls_mps2) if state else ()))
            most[entity.model] = Asked(*map(max, own, most.get(entity.model, own)))
        return most

    def _add(self, item: m.ScenarioItem) -> None:
        """Put a statement into the scenario, with comments on what was lost since the one before."""
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

    def _reader(self, base: ConditionReader | None = None) -> ConditionReader:
        """Return a reader of conditions, with what is known of the actors' ways by now."""
        if base is not None:
            return dataclasses.replace(base, ways=self._ways)
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
        """Return the variables that actions change and that nothing asks for but what ends the storyboard."""
        return changing(self._all_events) - asked_for(self._all_events)

    def _fill_places(self) -> None:
        """Take places and speeds of what happens at once, and of entities that only have a trajectory."""
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
        found = dict(self.inits.routing)
        for event in self.events:
            for action in (action for kind in event.actions for action in kind.iterfind("RoutingAction/*")):
                if action.tag in ROUTING:
                    found = {**dict.fromkeys(event.refs, action), **found}
        return found

    def _begins(self) -> dict[str, float | None]:
        """Return when the first routing action of each entity's events begins, s; None where the run decides it."""
        found: dict[str, float | None] = {}
        for event in self.events:
            if any(action.tag in ROUTING for kind in event.actions for action in kind.iterfind("RoutingAction/*")):
                found = {**dict.fromkeys(event.refs, begins_at(event, self.events, self._reader())), **found}
        return found

    def _actors(self) -> dict[str, EntityState]:
        """Add the actors; return what is known of each."""
        changers = self._acting("LaneChangeAction")
        builder = ActorBuilder(
            self.source,
            self.network,
            self.places,
            self.losses,
            # Who keeps somewhere across a lane needs lanes, and who changes them where the map does not say where they
            # are.
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
            made = builder.actor(
                state,
                state.way,
                begins_s=0.0 if at_start else begins.get(ref, 0.0),
                at_start=at_start,
                acts=ref in acting,
            )
            if made is not None:
                self._add(made.statement)
                states[ref] = state
                first += made.whens
            elif entity.name == "ego":
                raise _NowhereError(
                    f"{self.source.path}: the ego '{ref}' stands on no lane that goes its way, and could not be "
                    "driven: name another vehicle with --ego"
                )
        for when in first:
            self._add(when)
        return states

    def _acting(self, *tags: str) -> set[str]:
        """Return the entities that have a lateral action of some kinds."""
        events = (*self.events, *self.inits.events)
        asked = (
            e
            for e in events
            if any(kind.find(f"LateralAction/{tag}") is not None for kind in e.actions for tag in tags)
        )
        return {ref for e in asked for ref in e.refs}

    def _beginnings(self, *, with_ego: bool = False) -> dict[str, tuple[Pose, float]]:
        """Return where the middle of each entity (but the ego) is at the beginning, and how fast it is, m/s."""
        found = {}
        for ref, entity in self.entities.items():
            if entity.name == "ego" and not with_ego:
                continue
            try:
                middle = self.places.initial(ref).ahead(entity.centre_m)
            except (NotExpressed, SourceError):
                continue
            found[ref] = middle, self.inits.speeds.get(ref, 0.0)
        return found

    def _lane(self, ref: str) -> tuple[int | None, bool]:
        """Return the id of the lane that an entity is on, if its road is known, and whether it looks in the road's
        direction."""
        place = self.places.lane_of(ref) if self.places.roads is not None else None
        if place is None or self.places.roads is None:
            return None, True
        road = self.places.roads.on_reference(place.road, place.s, 0.0).heading_rad
        try:
            off = self.places.initial(ref).heading_rad - road
        except NotExpressed:
            return None, True
        return place.lane or None, abs(math.remainder(off, math.tau)) < math.pi / 2


def _without_goal(scenario: m.Scenario) -> m.Scenario:
    """Return a scenario whose ego drives to the end of its route."""
    body: list[m.ScenarioItem] = []
    for item in scenario.body:
        if isinstance(item, m.Ego):
            kept = tuple(part for part in item.body if not isinstance(part, m.GoalAt))
            body.append(item.model_copy(update={"body": kept}))
        else:
            body.append(item)
    return scenario.model_copy(update={"body": tuple(body)})


def _changes_of_speed(actions: Sequence[m.Action]) -> Iterator[m.ChangesSpeed]:
    for action in actions:
        if isinstance(action, m.ChangesSpeed):
            yield action
        elif isinstance(action, m.Then):
            yield from _changes_of_speed(action.actions)


def _end_s(source: Source, losses: Losses) -> float:
    """Return the time at which the storyboard stops."""
    times = []
    for group in source.root.iterfind("Storyboard/StopTrigger/ConditionGroup"):
        conditions = group.findall("Condition")
        found = [condition.find("ByValueCondition/SimulationTimeCondition") for condition in conditions]
        if len(found) == 1 and found[0] is not None and found[0].get("rule") != "lessThan":
            times.append(number(found[0], "value") + number(conditions[0], "delay", 0.0))
        else:
            losses.leave("conditions that end the storyboard (the run goes on)")
    positive = [t for t in times if t > 0]
    return min(positive) if positive else _END_S
