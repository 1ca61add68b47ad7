"""Takes over an OpenSCENARIO XML file: its common subset becomes a scenario; what is not expressed is counted."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile import placement_mistakes
from foresee_dsl.compile.foreign.networks import SUFFIXES, foreign_net
from foresee_dsl.compile.foreign.opendrive_geometry import RoadMap
from foresee_dsl.compile.placement.scene import DRY_FRICTION, WET_FRICTION
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.exchange.naming import name_of, number, quantity, sentence
from foresee_dsl.exchange.openscenario.reading.actions import ROUTING, EntityState, TriggerBuilder
from foresee_dsl.exchange.openscenario.reading.actors import ActorBuilder
from foresee_dsl.exchange.openscenario.reading.entities import Participants, read_participants
from foresee_dsl.exchange.openscenario.reading.places import Places
from foresee_dsl.exchange.openscenario.reading.source import Source, read_source
from foresee_dsl.exchange.openscenario.reading.storyboard import ConditionReader, Event, read_events
from foresee_dsl.exchange.openscenario.writing.participants import CLEAR_M
from foresee_dsl.exchange.outcome import ExchangeError, Imported, import_together, write_text
from foresee_dsl.language import model as m
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.sensing.weather import FOG_VISIBILITY_M, RAIN_MM_H

_END_S = 60.0
"""Where the file gives no time (the language's own default)."""


def run(file: Path, *, out: Path, ego: str = "", road: Path | None = None, allow_outside: bool = False) -> Imported:
    """Write the scenario `NAME.foresee`, its network, and the catalogue `NAME_models.foresee` where it is needed.

    Args:
        file: the `.xosc` file. out: the folder.
        ego: the entity under test; by default the one that is called so, else the first vehicle.
        road: the network (`.xodr`, `.net.xml`); by default the one that the file names.
        allow_outside: whether the file may name files outside its project folder.

    Raises:
        ExchangeError: it cannot be read, has no network or no vehicle, or lacks a catalogue.
        InputError: the scenario that comes out is impossible; nothing is written.
    """
    source = read_source(file, allow_outside=allow_outside)
    network_file = _network_file(source, road)
    left_out: Counter[str] = Counter()
    name = name_of(file.name.partition(".")[0], "scenario")
    participants = read_participants(source, left_out, name=f"{name}_models", ego=ego)
    suffix = next(suffix for suffix in SUFFIXES if network_file.name.endswith(suffix))
    network_name = name_of(network_file.name.partition(".")[0], "map") + suffix
    scenario, notes = _scenario(source, participants, network_file, name, left_out, network_name)

    kinds = Counter(actor.kind for actor in scenario.actors)
    taken = {f"of the kind {kind}": count for kind, count in sorted(kinds.items())}

    def write(folder: Path) -> Imported:
        shutil.copyfile(network_file, folder / network_name)
        if participants.catalogue is not None:
            write_text(folder / f"{name}_models.foresee", participants.catalogue)
        write_text(folder / f"{name}.foresee", scenario)
        mistakes = placement_mistakes(load_test_cases([folder / f"{name}.foresee"]))
        if mistakes:
            found = "; ".join(dict.fromkeys(f"{d.message}{f' ({d.help})' if d.help else ''}" for d in mistakes))
            raise ExchangeError(f"{file} cannot be played on its network: {found}")

        return Imported((), 1, taken, +left_out, tuple(notes))

    return import_together(out, write)


def _scenario(
    source: Source, participants: Participants, network_file: Path, name: str, left_out: Counter[str], network_name: str
) -> tuple[m.Scenario, list[str]]:
    left_out["programs of signals"] += len(source.root.findall("RoadNetwork/TrafficSignals/TrafficSignalController"))
    inits = _Inits(source, left_out)
    roads = RoadMap.read(network_file) if network_file.name.endswith(".xodr") else None
    places = Places(roads, inits.positions)
    reader = ConditionReader(participants.entities, places)
    events = read_events(source, reader, left_out)
    actors = ActorBuilder(source, RoadNetwork.from_net(foreign_net(network_file)), places, left_out)
    entities = participants.entities
    states = {ref: EntityState(e, inits.speeds.get(ref, 0.0), inits.lane(ref)) for ref, e in entities.items()}
    routing = inits.routing | {ref: found for ref, found in _routing(events).items() if ref not in inits.routing}
    acting = {ref for event in _all(events) for ref in event.refs}
    statements: list[m.ScenarioItem] = []
    first: list[m.ScenarioItem] = []
    for ref, entity in sorted(entities.items(), key=lambda e: e[1].name != "ego"):
        made = actors.actor(states[ref], routing.get(ref), at_start=ref in inits.routing, acts=ref in acting)
        if made is not None:
            statements.append(made.statement)
            first += made.whens
        elif entity.name == "ego":
            raise ExchangeError(f"{source.path}: the ego '{ref}' stands nowhere on the network")
        else:
            del states[ref]
    whens = TriggerBuilder(states, left_out).whens(_known(events, states, left_out))
    header: list[m.ScenarioItem] = [
        m.Doc(text=sentence(source.description or source.path.name)),
        m.Tags(names=("openscenario",)),
        m.UseNetwork(path=network_name),
        *([m.UseModels(path=f"{name}_models.foresee")] if participants.catalogue is not None else []),
        *inits.weather(),
    ]
    never = m.Expect(mode="never", condition=m.Predicate(what="collision", actor="ego"))
    end = m.End(after=quantity(_end_s(source, left_out), "time"))
    body = (*header, *statements, *first, *whens, never, end)
    return m.Scenario(name=name, body=body), list(actors.notes)


class _Inits:
    """What the storyboard's `<Init>` says."""

    def __init__(self, source: Source, left_out: Counter[str]) -> None:
        """Read it; actions that we do not have are counted."""
        self._source = source
        self.positions: dict[str, Element] = {}
        self.speeds: dict[str, float] = {}
        self.routing: dict[str, Element] = {}
        self._environment: Element | None = None
        actions = source.root.find("Storyboard/Init/Actions")
        for action in actions if actions is not None else ():
            if action.tag == "Private":
                for private in action.iterfind("PrivateAction"):
                    self._private(action.get("entityRef", ""), private, left_out)
            else:
                self._global(action, left_out)

    def lane(self, ref: str) -> int | None:
        """Return the id of the lane that an entity is placed on, if its position names one."""
        position = self.positions.get(ref)
        lane = position.find("LanePosition") if position is not None else None
        return round(number(lane, "laneId")) if lane is not None else None

    def weather(self) -> list[m.Weather]:
        """Return the weather statement, if there is any: visual range, mm/h and friction there, ratios here."""
        found = self._environment
        if found is None:
            return []
        fog, rain, road = (found.find(p) for p in ("Weather/Fog", "Weather/Precipitation", "RoadCondition"))
        visual_range_m = number(fog, "visualRange", 0.0) if fog is not None else 0.0
        rain_mm_h = 0.0
        if rain is not None:  # version 1.0 gives a share
            rain_mm_h = number(rain, "precipitationIntensity", number(rain, "intensity", 0.0) * RAIN_MM_H)
        friction = number(road, "frictionScaleFactor", 1.0) if road is not None else 1.0
        ratios = {
            "fog": FOG_VISIBILITY_M / visual_range_m if visual_range_m and visual_range_m < CLEAR_M / 10 else 0.0,
            "rain": rain_mm_h / RAIN_MM_H,
            "wetness": (1.0 - friction) * DRY_FRICTION / (DRY_FRICTION - WET_FRICTION),
        }
        over_zero = {
            key: quantity(min(round(value, 3), 1.0), "ratio") for key, value in ratios.items() if round(value, 3) > 0
        }
        return [m.Weather.model_validate(over_zero)] if over_zero else []

    def _global(self, action: Element, left_out: Counter[str]) -> None:
        kind = next(iter(action), action)
        if kind.tag == "EnvironmentAction":
            reference = kind.find("CatalogReference")
            self._environment = kind.find("Environment") if reference is None else self._source.entry(reference)
        else:
            left_out[f"actions at the beginning: {kind.tag}"] += 1

    def _private(self, ref: str, private: Element, left_out: Counter[str]) -> None:
        kind = next(iter(private), private)
        inner = next(iter(kind), kind)
        position = private.find("TeleportAction/Position")
        speed = private.find("LongitudinalAction/SpeedAction/SpeedActionTarget/AbsoluteTargetSpeed")
        if position is not None:
            self.positions[ref] = position
        elif speed is not None:
            self.speeds[ref] = max(number(speed, "value"), 0.0)
        elif inner.tag in ROUTING:
            self.routing[ref] = inner
        else:
            left_out[f"actions at the beginning: {inner.tag}"] += 1


def _routing(events: list[Event]) -> dict[str, Element]:
    """Return the first routing action of each entity in the events, those that wait for others included."""
    found: dict[str, Element] = {}
    for event in _all(events):
        for action in (action for kind in event.actions for action in kind.iterfind("RoutingAction/*")):
            if action.tag in ROUTING:
                found = {**dict.fromkeys(event.refs, action), **found}
    return found


def _all(events: Sequence[Event]) -> Iterator[Event]:
    """Yield events and those that wait for them."""
    for event in events:
        yield event
        yield from _all((*event.at_start, *event.at_end))


def _known(events: list[Event], states: dict[str, EntityState], left_out: Counter[str]) -> list[Event]:
    """Return the events whose conditions are about actors that were taken over."""
    from foresee_dsl.language.traversal import mentioned

    names = {state.entity.name for state in states.values()}
    found = []
    for event in events:
        if event.condition is not None and not mentioned(event.condition) <= names:
            left_out["conditions about entities that were left out"] += 1
            continue
        event.at_start = _known(event.at_start, states, left_out)
        event.at_end = _known(event.at_end, states, left_out)
        found.append(event)
    return found


def _network_file(source: Source, road: Path | None) -> Path:
    if road is None:
        logic = source.root.find("RoadNetwork/LogicFile")
        written = logic.get("filepath", "") if logic is not None else ""
        if not written:
            raise ExchangeError(f"{source.path} names no network: name one with --map")
        road = source.named(written, "the network")
    if not road.name.endswith(SUFFIXES):
        raise ExchangeError(f"the network {road} is of no known kind: name one ({' or '.join(SUFFIXES)}) with --map")
    return road


def _end_s(source: Source, left_out: Counter[str]) -> float:
    """Return the time at which the storyboard stops."""
    times = []
    for condition in source.root.iterfind("Storyboard/StopTrigger/ConditionGroup/Condition"):
        time = condition.find("ByValueCondition/SimulationTimeCondition")
        if time is not None and time.get("rule") != "lessThan":
            times.append(number(time, "value") + number(condition, "delay", 0.0))
        else:
            left_out["conditions that end the storyboard"] += 1
    positive = [t for t in times if t > 0]
    return min(positive) if positive else _END_S
